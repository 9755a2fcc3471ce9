"""The instructions of SX Functions of casadi, as ``graphs.c`` takes them."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.graph.graph import Graph, Instructions, library, operations
from symphys.codegen.program.program import Function

ALIASES = {
    "constpow": "pow",
    "if_else_zero": "iez",
    "lift": "assign",
    "input": "given",
    "const": "constant",
}
"""What ``graphs.c`` calls operations of casadi that have another name there."""
UNKNOWN = -1


@cache
def _numbers() -> dict[int, int]:
    """Return the number of each operation of casadi in ``graphs.c``."""
    foreign = library().foreign_names().decode().split()
    known = {name: number for number, name in enumerate((*operations(), *foreign))}
    names = {name.removeprefix("OP_").lower(): getattr(ca, name) for name in dir(ca) if name.startswith("OP_")}
    return {code: known[ALIASES.get(name, name)] for name, code in names.items() if ALIASES.get(name, name) in known}


def instructions_of(function: Function) -> Instructions:
    """Return the instructions of a function; KernelUnavailable if an operation has no counterpart."""
    count, numbers = function.n_instructions(), _numbers()
    ids = list(map(function.instruction_id, range(count)))
    codes = np.array([numbers.get(op, UNKNOWN) for op in ids] or [0], np.int32)
    if UNKNOWN in codes[:count]:
        op = ids[int(np.flatnonzero(codes == UNKNOWN)[0])]
        raise KernelUnavailable(
            f"casadi operation {op} has no counterpart in compiled kernels; use casadi's evaluation"
        )
    read, written = np.full((count + 1, 2), UNKNOWN, np.int32), np.full((count + 1, 2), UNKNOWN, np.int32)
    values = np.zeros(count + 1)
    for places, find in ((read, function.instruction_input), (written, function.instruction_output)):
        found = list(map(find, range(count)))
        for column in (0, 1):
            places[:count, column] = [each[column] if len(each) > column else UNKNOWN for each in found]
    for i, op in enumerate(ids):
        if op == ca.OP_CONST:
            values[i] = function.instruction_constant(i)
    given = np.array([function.numel_in(i) for i in range(function.n_in())] or [0], np.int32)
    results = np.array([function.numel_out(i) for i in range(function.n_out())] or [0], np.int32)
    address = library().function_new(
        count, codes.ctypes.data, read.ctypes.data, written.ctypes.data, values.ctypes.data, function.sz_w() + 1,
        function.n_in(), given.ctypes.data, function.n_out(), results.ctypes.data,
    )  # fmt: skip
    return Instructions(address, "function_free")


def graph_of(function: Function) -> Graph:
    """Return the graph of a function; KernelUnavailable if an operation has no counterpart."""
    return instructions_of(function).graph()
