"""Costs, targets and constraints of a problem as functions of one state and one input each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.expression import Formula
from symphys.problem import Constraint, Cost, Problem, Target
from symphys.suggest import quote
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.columns import ByColumns

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Expr = Any
"""casadi SX"""


@dataclass(frozen=True)
class Slopes:
    """A term along a motion.

    Attributes:
        value: (T, r) at its ticks.
        x: (T, r, q) by the ``columns`` of the state.
        u: (T, r, m) by the inputs.
        s: (T, r, s) by the static entries of z.
        curved: (T, q + m, q + m) second derivative of a cost that is no square, positive semidefinite; None of others,
            and of those that are linear.
    """

    value: Array
    x: Array
    u: Array
    s: Array
    curved: Array | None


@dataclass(frozen=True, eq=False)
class StageTerm:
    """A formula at some ticks.

    Attributes:
        name: of the table that it is from.
        kind: ``cost``: its values are summed; ``squares``: its squares are; ``limit``: it lies within bounds.
        weight: factor of the sum; of a limit, of its squared violations in the merit.
        states, inputs: (T,) the states that it looks at, and the steps whose inputs it looks at.
        columns: (q,) the entries of the state that it depends on.
        size: r, components of the formula.
        formula: casadi (x, u, p, time, z) -> (r,).
        statics: (s,) entries of z.
        dt: [s].
    """

    name: str
    kind: Literal["cost", "squares", "limit"]
    weight: float
    states: Indices
    inputs: Indices
    columns: Indices
    size: int
    formula: ca.Function
    statics: Indices
    dt: float

    def values(self, X: Array, U: Array, P: Array, Z: Array) -> Array:
        """(B, N + 1, nx), (B, N, m), (B, np), (B, len(z)) -> (B, T, r)."""
        batch, ticks = len(X), len(self.states)
        arguments = [np.repeat(P, ticks, axis=0), np.tile(self._times, batch)[:, None], np.repeat(Z, ticks, axis=0)]
        rows = [X[:, self.states].reshape(batch * ticks, -1), U[:, self.inputs].reshape(batch * ticks, -1), *arguments]
        (found,) = self._values(*(row.T for row in rows))
        return found.T.reshape(batch, ticks, self.size)

    def slopes(self, x: Array, u: Array, p: Array, z: Array, by_p: Array) -> Slopes:
        """(N + 1, nx), (N, m), (np,), (len(z),), and (np, s) the parameters by the static entries of z."""
        ticks = len(self.states)
        shared = (np.tile(p[:, None], ticks), self._times[None], np.tile(z[:, None], ticks))
        found = self._slopes(x[self.states].T, u[self.inputs].T, *shared)
        value, by_x, by_u, of_p, by_s, *curved = (_blocks(each, ticks) for each in found)
        second = None
        if curved:
            numbers, vectors = np.linalg.eigh((curved[0] + curved[0].transpose(0, 2, 1)) / 2)
            second = (vectors * np.maximum(numbers, 0.0)[:, None]) @ vectors.transpose(0, 2, 1)
        return Slopes(value[:, :, 0], by_x, by_u, by_s + of_p @ by_p, second)

    @property
    def _times(self) -> Array:
        """(T,) [s]."""
        return np.asarray(self.states * self.dt, float)

    @cached_property
    def _values(self) -> ByColumns:
        return ByColumns(self.formula)

    @cached_property
    def _slopes(self) -> ByColumns:
        """-> value, its derivatives by the columns of x, u, p and the static entries of z, and a second derivative."""
        arguments = self.formula.sx_in()
        x, u, p, _, z = arguments
        value = ca.densify(self.formula(*arguments))
        columns, statics = self.columns.tolist(), self.statics.tolist()
        results = [value, ca.jacobian(value, x)[:, columns], ca.jacobian(value, u), ca.jacobian(value, p)]
        results.append(ca.jacobian(value, z)[:, statics])
        if self.kind == "cost":
            both = ca.vertcat(x, u)
            acting = [*columns, *range(x.shape[0], both.shape[0])]
            second = ca.jacobian(ca.gradient(value, both), both)[acting, acting] if value.shape[0] else ca.SX(0, 0)
            results += [second] if second.nnz() else []
        return ByColumns(ca.Function("slopes", arguments, [ca.densify(result) for result in results]))


def _blocks(array: Array, count: int) -> Array:
    """(T, r, c) of what a mapped function gives: T blocks (r, c) beside each other."""
    return np.ascontiguousarray(array.reshape(array.shape[0], count, -1).transpose(1, 0, 2))


def stage_terms(rollout: Rollout, statics: Indices) -> list[StageTerm]:
    """Everything that a problem asks of its motion, term by term; their weighted sum is its objective.

    Raises:
        SymphysError: for a formula that is no function of one state and one input, and for a duration that varies.
    """
    require_stages(rollout.problem)
    return list(_terms(rollout, statics))


def require_stages(problem: Problem) -> None:
    """Refuse problems that cannot be taken step by step, before anything is built.

    Raises:
        SymphysError: see ``stage_terms``.
    """
    if problem.free_duration:
        text = "a variable sets simulation.duration, so all steps hang together"
        raise SymphysError(f"{problem.name}: {text}: take least_squares, gradient or ipopt")
    asked: tuple[Cost | Target | Constraint, ...] = (*problem.costs, *problem.targets, *problem.constraints)
    for each in asked:
        require_local(problem, each.name, each.formula)


def _terms(rollout: Rollout, statics: Indices) -> Iterator[StageTerm]:
    problem, steps, dt = rollout.problem, rollout.steps, rollout.dt
    for cost in problem.costs:
        every = np.arange(*(cost.during.ticks(steps) if cost.during else (0, steps)))
        kind: Literal["cost", "squares"] = "squares" if cost.squares else "cost"
        if cost.at != "always":
            yield _term(rollout, statics, cost.name, kind, cost.weight, cost.formula, *_instant(rollout, cost.at))
        elif rollout.moves(cost.formula):
            for states in (every, every + 1):
                yield _term(rollout, statics, cost.name, kind, cost.weight * dt / 2, cost.formula, states, every)
        else:
            yield _term(rollout, statics, cost.name, kind, cost.weight * dt, cost.formula, every, every)
    for target in problem.targets:
        ticks = _instant(rollout, target.at)
        yield _term(rollout, statics, target.name, "squares", target.weight, target.formula, *ticks)
    for limit in problem.constraints:
        every = np.arange(*(limit.during.ticks(steps) if limit.during else (0, steps)))
        always = limit.at == "always"
        ticks = (every + 1, every) if always else _instant(rollout, limit.at)
        weight = limit.penalty * (dt if always else 1.0)
        yield _term(rollout, statics, limit.name, "limit", weight, limit.formula, *ticks)


def _instant(rollout: Rollout, when: str | float) -> tuple[Indices, Indices]:
    tick = rollout.tick(when)
    return np.array([tick]), np.array([min(tick, rollout.steps - 1)])


def _term(
    rollout: Rollout,
    statics: Indices,
    name: str,
    kind: Literal["cost", "squares", "limit"],
    weight: float,
    formula: Formula,
    states: Indices,
    inputs: Indices,
) -> StageTerm:
    compiled = rollout.compiled(formula)
    columns = np.unique(np.array(compiled.jac_sparsity(0, 0).get_triplet()[1], np.int64))
    size = int(compiled.size1_out(0))
    return StageTerm(name, kind, weight, states, inputs, columns, size, compiled, statics, rollout.dt)


def require_local(problem: Problem, name: str, formula: Formula) -> None:
    """Refuse formulas that look at all of a motion at once.

    Raises:
        SymphysError: the formula takes parts of the whole motion, or names a variable that acts over time, or an input
            that a controller or a force law drives.
    """
    if formula.parts:
        text = f"takes {', '.join(part.name for part in formula.parts)} of the whole motion"
        raise SymphysError(f"{name}: {text}: no solver that goes step by step can take that")
    for variable in problem.variables:
        if variable.kind == "control" and variable.name in formula.names:
            inputs = ", ".join(dict.fromkeys(slot.name for slot in variable.slots))
            text = f"looks at the variable {quote(variable.name)}, which acts over time; name what it sets, {inputs}"
            raise SymphysError(f"{name}: {text}, or take a solver that sees the motion as a whole")
    driven = {law.on for law in problem.forces}
    driven |= {driven for controller in problem.controllers for driven, _ in controller.drives}
    found = sorted(driven & formula.names)
    if found:
        text = f"looks at {', '.join(found)}, which a controller or a force law drives"
        raise SymphysError(f"{name}: {text}: no solver that goes step by step can take that")
