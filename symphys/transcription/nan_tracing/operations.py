"""Which operation of a casadi function makes a number that is not finite: the function computed one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import casadi as ca

from symphys.types import Array

WORDS = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{} * {}",
    ca.OP_DIV: "{} / {}",
    ca.OP_INV: "1 / {}",
    ca.OP_POW: "{} ** {}",
    ca.OP_CONSTPOW: "{} ** {}",
    ca.OP_SQ: "{} squared",
    ca.OP_TWICE: "2 * {}",
    ca.OP_SQRT: "sqrt({})",
    ca.OP_LOG: "log({})",
    ca.OP_EXP: "exp({})",
    ca.OP_TAN: "tan({})",
    ca.OP_ASIN: "asin({})",
    ca.OP_ACOS: "acos({})",
    ca.OP_SINH: "sinh({})",
    ca.OP_COSH: "cosh({})",
}
"""How operations are written; ``{}`` stand for the values of their operands."""


@dataclass(frozen=True)
class NonFiniteOperation:
    """An operation with finite operands whose result is not, on the way to a result of the function.

    Attributes:
        operation: with the values that it was given, such as ``1 / 0``; empty where an argument itself is not finite.
        arguments: (argument, element) of everything that went into it.
        result: (output, element) that it spoils: the first that is not finite.
    """

    operation: str
    arguments: tuple[tuple[int, int], ...]
    result: tuple[int, int]


def non_finite_operation(function: ca.Function, arguments: Sequence[Array]) -> NonFiniteOperation | None:
    """What spoils the results of an SX function for these arguments, one dense vector each; None if nothing does."""
    run = _Run(function, arguments)
    spoilt = [(place, source) for place, source in run.results if not isfinite(run.values[source])]
    if not spoilt:
        return None
    result, at = min(spoilt)
    while bad := [source for source in run.operands[at] if not isfinite(run.values[source])]:
        at = bad[0]
    return NonFiniteOperation(run.words(at), run.origins(at), result)


class _Run:
    """Every instruction of a function with its value, its operands, and the argument that it reads."""

    def __init__(self, function: ca.Function, arguments: Sequence[Array]) -> None:
        self.values: list[float] = []
        self.operands: list[list[int]] = []
        self.codes: list[int] = []
        self.reads: dict[int, tuple[int, int]] = {}
        self.results: list[tuple[tuple[int, int], int]] = []
        work: dict[int, int] = {}
        for i in range(function.n_instructions()):
            code, takes, gives = (
                function.instruction_id(i),
                function.instruction_input(i),
                function.instruction_output(i),
            )
            operands: list[int] = []
            if code == ca.OP_OUTPUT:
                self.results.append(((gives[0], gives[1]), work[takes[0]]))
                continue
            if code == ca.OP_INPUT:
                self.reads[len(self.values)] = (takes[0], takes[1])
                value = float(arguments[takes[0]][takes[1]])
            elif code == ca.OP_CONST:
                value = function.instruction_constant(i)
            else:
                operands = [work[x] for x in takes]
                value = _compute(code, [self.values[x] for x in operands])
            work[gives[0]] = len(self.values)
            self.values.append(value)
            self.operands.append(operands)
            self.codes.append(code)

    def words(self, at: int) -> str:
        """The operation with its operands' values."""
        if not self.operands[at]:
            return ""
        known = [f"{self.values[x]:.6g}" for x in self.operands[at]]
        pattern = WORDS.get(self.codes[at], f"operation {self.codes[at]} of " + ", ".join("{}" for _ in known))
        return pattern.format(*known)

    def origins(self, at: int) -> tuple[tuple[int, int], ...]:
        """The arguments that a value is made from."""
        seen, left = set[int](), [at]
        while left:
            x = left.pop()
            if x not in seen:
                seen.add(x)
                left += self.operands[x]
        return tuple(sorted({self.reads[x] for x in seen if x in self.reads}))


def _compute(code: int, operands: list[float]) -> float:
    compute = ca.DM.unary if len(operands) == 1 else ca.DM.binary
    return float(compute(code, *operands))
