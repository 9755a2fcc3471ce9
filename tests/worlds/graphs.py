"""Graphs evaluated node by node."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from symphys.codegen.graph.graph import Graph

RULES: dict[str, Any] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "not": lambda a: not a,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "isnt0": lambda a: a != 0,
    "one": float,
    "iez": lambda a, b: b if a else 0.0,
    "select": lambda a, b, c: b if a else c,
    "pow": np.power,
    "fabs": np.abs,
    "erf": math.erf,
    "remainder": math.remainder,
}
NUMPY = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh", "acosh": "arccosh",
         "atanh": "arctanh", "atan2": "arctan2"}  # fmt: skip


@np.errstate(all="ignore")
def evaluated(graph: Graph, arguments: Sequence[np.ndarray]) -> np.ndarray:
    """Evaluate a graph node by node."""
    done: list[Any] = []
    for node in graph.nodes:
        if node.op == "input":
            done.append(np.float64(arguments[node.at[0]][node.at[1]]))
        elif node.op == "const":
            done.append(np.float64(node.value))
        else:
            rule = RULES.get(node.op) or getattr(np, NUMPY.get(node.op, node.op))
            done.append(rule(*(done[y] for y in node.operands)))
    return np.array([float(done[x]) for result in graph.results for x in result])
