"""The origin of the first number that is not finite: the start, a step, a formula, or a derivative of these."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

import casadi as ca
import numpy as np

from symphys.expression import Formula
from symphys.model.state_layout import Layout, input_columns
from symphys.problem import Constraint, Cost, Output, Target
from symphys.records import dataclass
from symphys.transcription.recorded_parts import (
    RolloutArrays,
    formula_arguments,
    part_numbers,
)
from symphys.transcription.rollout import Rollout
from symphys.transcription.terms import EvaluationPoints, instant, part_points, problem_terms
from symphys.types import Array

OPERATION_FORMATS = {
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
    """An operation with finite operands whose result is not finite, and on which a result depends.

    Attributes:
        operation: with the values that it was given, such as ``1 / 0``; empty where an argument itself is not finite.
        arguments: (argument, element) of everything that went into it.
        result: (output, element) that it spoils: the first that is not finite.
    """

    operation: str
    arguments: tuple[tuple[int, int], ...]
    result: tuple[int, int]


def non_finite_operation(function: ca.Function, arguments: Sequence[Array]) -> NonFiniteOperation | None:
    """Find the first operation of an SX function that is not finite; ``arguments``: one dense vector each."""
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
        """Return the operation with its operands' values as text."""
        if not self.operands[at]:
            return ""
        known = [f"{self.values[x]:.6g}" for x in self.operands[at]]
        pattern = OPERATION_FORMATS.get(
            self.codes[at], f"operation {self.codes[at]} of " + ", ".join("{}" for _ in known)
        )
        return pattern.format(*known)

    def origins(self, at: int) -> tuple[tuple[int, int], ...]:
        """Return the arguments on which a value depends."""
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


Objective = Cost | Target | Constraint | Output
Columns = Sequence[str]
"""A name for each element of a vector."""

MAX_NAMES = 4
"""Largest number of names in a clause."""


def first_non_finite(rollout: Rollout, arrays: RolloutArrays) -> str:
    """Return a clause with the place where the rollout or a formula first is not finite; empty if nowhere."""
    return _in_start(rollout, arrays) or _in_steps(rollout, arrays) or _in_formulas(rollout, arrays)


def first_non_finite_derivative(rollout: Rollout, arrays: RolloutArrays) -> str:
    """Find the first derivative that is not finite: of the formulas, then of the steps, from the last one back."""
    formulas = (_derivative_clause(rollout, arrays, *case) for case in _instants(rollout))
    return next(filter(None, formulas), "") or _in_steps_back(rollout, arrays)


def _in_start(rollout: Rollout, arrays: RolloutArrays) -> str:
    names = _argument_names(rollout)
    for values, columns in ((arrays.x[0], names[0]), (arrays.p, names[2]), (arrays.given.T, names[1])):
        bad = [name for name, value in zip(columns, values, strict=True) if not np.isfinite(value).all()]
        if bad:
            return f"it begins with {_listed(list(dict.fromkeys(bad)))}, as the variables set it"
    return ""


def _in_steps(rollout: Rollout, arrays: RolloutArrays) -> str:
    bad = ~(np.isfinite(arrays.x[1:]).all(axis=1) & np.isfinite(arrays.u).all(axis=1))
    if not bad.any():
        return ""
    k = int(np.argmax(bad))
    if rollout.feedback is not None and not np.isfinite(arrays.u[k]).all():
        known = [*_argument_names(rollout), ("time",)]
        found = non_finite_operation(rollout.feedback, arrays.control_arguments(k))
        where = f"in the output of controllers and force laws at t = {arrays.time[k]:g} s"
        return f"it begins {where}{_cause(found, known, known[1:2])}"
    found = non_finite_operation(rollout.step, arrays.step_arguments(k))
    names = _argument_names(rollout)
    return f"it begins in the step from t = {arrays.time[k]:g} s{_cause(found, names, names[:1])}"


def _in_formulas(rollout: Rollout, arrays: RolloutArrays) -> str:
    names = _argument_names(rollout)
    for kind, asked, formula, k, row in _instants(rollout):
        found = non_finite_operation(rollout.compiled(formula), _formula_arguments(rollout, arrays, formula, k, row))
        if found is not None:
            return f"{kind} {asked.name!r} is not finite at t = {arrays.time[k]:g} s{_cause(found, names)}"
    return ""


def _derivative_clause(
    rollout: Rollout, arrays: RolloutArrays, kind: str, asked: Objective, formula: Formula, k: int, row: int
) -> str:
    compiled = rollout.compiled(formula)
    arguments = _formula_arguments(rollout, arrays, formula, k, row)
    seeds = [np.zeros(compiled.numel_out(0)), np.ones(compiled.numel_out(0))]
    found = non_finite_operation(compiled.reverse(1), [*arguments, *seeds])
    if found is None:
        return ""
    names = _argument_names(rollout)
    return f"the derivative of {kind} {asked.name!r} is not finite at t = {arrays.time[k]:g} s{_cause(found, names)}"


def _in_steps_back(rollout: Rollout, arrays: RolloutArrays) -> str:
    backward = rollout.closed.expand().reverse(1)
    adjoint, results = np.ones(arrays.x.shape[1]), [np.zeros(arrays.x.shape[1])]
    if rollout.feedback is not None:
        results.append(np.zeros(arrays.u.shape[1]))
    for k in reversed(range(rollout.steps)):
        seeds = [adjoint, *(np.zeros(result.size) for result in results[1:])]
        arguments = [*arrays.closed_arguments(k, rollout), *results, *seeds]
        adjoint = np.array(backward(*arguments)[0]).ravel()
        if not np.isfinite(adjoint).all():
            names, found = _argument_names(rollout), non_finite_operation(backward, arguments)
            when = f"t = {arrays.time[k]:g} s to {arrays.time[k + 1]:g} s"
            return f"the derivative of the step from {when} is not finite{_cause(found, names, names)}"
    return ""


def _cause(found: NonFiniteOperation | None, names: Sequence[Columns], results: Sequence[Columns] = ()) -> str:
    """Such as ``: 1 / 0, made from ball.mass, on the way to ball.velocity``; arguments without a name are left out."""
    if found is None:
        return ""
    origins = dict.fromkeys(names[i][j] for i, j in found.arguments if i < len(names))
    made = f", made from {_listed(list(origins))}" if origins else ""
    output, element = found.result
    leads = f", on the way to {results[output][element]}" if output < len(results) else ""
    return f": {found.operation}{made}{leads}" if found.operation else f"{made}{leads}"


def _instants(rollout: Rollout) -> Iterator[tuple[str, Objective, Formula, int, int]]:
    """Yield (kind, objective, formula, number of the state, number of the inputs) of all evaluations of formulas."""
    found: list[tuple[Objective, EvaluationPoints]] = [(term.table, term.points) for term in problem_terms(rollout)]
    found += [(output, instant(rollout, output.at)) for output in rollout.problem.outputs]
    for asked, points in found:
        kind = type(asked).__name__.lower()
        for part in asked.formula.parts:
            yield from ((kind, asked, part.formula, k, row) for k, row in part_points(rollout, part).pairs)
        yield from ((kind, asked, asked.formula, k, row) for k, row in points.pairs)


def _formula_arguments(rollout: Rollout, arrays: RolloutArrays, formula: Formula, k: int, row: int) -> list[Array]:
    return [*formula_arguments(arrays, k, row), *part_numbers(rollout, arrays, formula)]


def _argument_names(rollout: Rollout) -> tuple[Columns, Columns, Columns]:
    """Return the names of the entries of x, u and p; components of one quantity share its name."""
    layout = Layout(rollout.world)
    states = [layout.owner(column) for column in range(layout.size)]
    states += [name for name, part in rollout.memory.columns.items() for _ in range(part.start, part.stop)]
    columns = input_columns(rollout.world, rollout.inputs)
    inputs = [name for name, part in columns.items() for _ in range(part.start, part.stop)]
    known = rollout.parameters
    sizes = zip(known.names, known.symbols, strict=True)
    return states, inputs, [name for name, symbol in sizes for _ in range(symbol.shape[0])]


def _listed(names: Sequence[str]) -> str:
    more = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {more} more" if more > 0 else "")
