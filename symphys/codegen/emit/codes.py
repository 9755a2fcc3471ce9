"""Functions as codes for an interpreter, which is compiled once for all programs: it runs until a kernel is compiled.

Codes of an operation are its number, the operand that it gives and those that it takes, in the order of the C code: so
sums are added up in the same order, and bits are the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.form import Form
from symphys.codegen.emit.source import DRIVER, head_of
from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.graph.graph import Graph, Handle, library, operations
from symphys.codegen.graph.operations import FORMS
from symphys.codegen.toolchain.source_file import SourceFile, resource
from symphys.records import dataclass
from symphys.types import Array

WORD_BITS = 21
"""Bits of an operand for the word; the others are for the place."""
OWN_CODES = ("end", "copy", "add_to", "fill")
REFUSED = {
    1: "a function is too large to be interpreted",
    2: "a function keeps too many values to be interpreted",
}
"""Why ``graphs.c`` makes no codes of a function."""
MASKED = {"not": "I", "and": "II", "or": "II", "one": "I", "iez": "IV", "select": "IVV"}
"""Types of operands where one is a mask."""


@dataclass(frozen=True)
class Codes:
    """The functions of a plan.

    Attributes:
        words: codes of all functions, (count,) uint32.
        starts: where each function begins.
        constants: numbers; every function finds their address at its codes 2 and 3.
    """

    words: NDArray[np.uint32]
    starts: list[int]
    constants: Array


def codes_of(functions: Sequence[tuple[Graph, Form]]) -> Codes:
    """Return the codes of a plan's functions; KernelUnavailable where a function is too large for them."""
    c, starts = library(), list[int]()
    made = Handle(c.codes_new(), "codes_free")
    for graph, form in functions:
        starts.append(c.codes_count(made.address))
        failed = c.codes_add(
            made.address, graph.address, form.primal, form.adds, form.backward, form.clears, form.shared
        )
        if failed:
            raise KernelUnavailable(REFUSED[failed])
    words = np.zeros(c.codes_count(made.address), np.uint32)
    constants = np.zeros(c.codes_constants(made.address))
    if len(constants) >> WORD_BITS:
        raise KernelUnavailable("a program has too many constants to be interpreted")
    c.codes_read(made.address, words.ctypes.data, constants.ctypes.data)
    return Codes(words, starts, constants)


SLOPES_DRIVER = ("slopes.c",)
"""Files of what calls the functions of slopes."""


def interpreter(lanes: int, single: bool, driver: Sequence[str] = (*DRIVER, "phases.c")) -> SourceFile:
    """Return the C file: it depends on nothing of a program. ``driver``: files of what calls the functions."""
    names = operations()[2:]
    cases = "".join(f"{name}_op: {{ {_case(name)} NEXT; }}\n" for name in names)
    labels = ", ".join([*(f"&&{name}" for name in OWN_CODES), *(f"&&{name}_op" for name in names)])
    text = resource("interpreter.c").replace("OPERATIONS", labels).replace("CASES", cases)
    start = f"{head_of(lanes, single)}#include <string.h>\n#define WORD_BITS {WORD_BITS}\n"
    return SourceFile(start + text + "".join(map(resource, driver)), straight=True)


def _case(name: str) -> str:
    count = max(i for i in range(3) if f"{{{i}}}" in FORMS[name]) + 1
    kinds = MASKED.get(name, "VVV")
    operands = [f"const {kinds[i]} {x} = ({kinds[i]})*AT(c[{i + 2}]);" for i, x in enumerate("xyz"[:count])]
    return f"{' '.join(operands)} *AT(c[1]) = (V)({FORMS[name].format('x', 'y', 'z')}); c += {count + 2};"
