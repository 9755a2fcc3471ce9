"""Costs, targets, constraints and sums of a problem as functions of one step: its state, its input, the state after.

Every term is evaluated at some steps. There it looks at the state before the step or at the state after it, with the
input of the step. Inputs that controllers or force laws drive follow from the state before the step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import casadi as ca
import numpy as np

from symphys.expression import Formula, parse
from symphys.problem import Constraint, Cost, Problem, Target
from symphys.transcription.formula_names import spans
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.motion_sums import MotionSums
from symphys.transcription.staged.tangent import Tangent
from symphys.types import Expr, Ints

Kind = Literal["cost", "squares", "limit", "sum"]


@dataclass(frozen=True, eq=False)
class StageTerm:
    """A formula at some steps.

    Attributes:
        name: of the table that it is from.
        kind: ``cost``: its values are summed; ``squares``: its squares are; ``limit``: it lies within bounds; ``sum``:
            one of the sums beside the state.
        weight: factor of the sum; of a limit, of its squared violations in the merit.
        steps: (T,) at which it is evaluated.
        after: whether it looks at the state after the step; else at that before.
        value: (r,) an expression of ``StageSymbols``.
        key: terms with equal ones have equal values and slopes, whichever state they look at.
        number: of a sum.
    """

    name: str
    kind: Kind
    weight: float
    steps: Ints
    after: bool
    value: Expr
    key: tuple[object, ...]
    number: int = -1

    @property
    def size(self) -> int:
        """R."""
        return int(self.value.shape[0])

    @property
    def states(self) -> Ints:
        """(T,) numbers of the states that it looks at."""
        return self.steps + 1 if self.after else self.steps


class StageSymbols:
    """The symbols (SX) that terms are expressions of, and what formulas are in them.

    Attributes:
        x: the state that is looked at, with its sums.
        first: the state before the step, without sums: where it is another one.
        u: inputs as variables give them.
        constants: what is the same all along a motion: p, the entries ``named`` of z, the starts of ``MotionSums``.
        tick: the number of the state that is looked at.
        named: entries of z that some formula names by their variable.
    """

    def __init__(self, rollout: Rollout, tangent: Tangent, sums: MotionSums) -> None:
        """Symbols for the formulas of a problem; ``sums`` knows already what they need."""
        self.rollout, self.tangent, self.sums = rollout, tangent, sums
        self.named = named_entries(rollout.problem)
        self.state_size, self.parameter_size = rollout.memory.size, int(rollout.p.shape[0])
        starts = int(sums.started.size1_out(0))
        self.x = ca.SX.sym("x", self.state_size + len(sums.sums))
        self.first = ca.SX.sym("first", self.state_size)
        self.u = ca.SX.sym("u", rollout.controls)
        self.constants = ca.SX.sym("constants", self.parameter_size + len(self.named) + starts)
        self.tick = ca.SX.sym("tick")
        self.p = self.constants[: self.parameter_size]
        self.starts = self.constants[self.parameter_size + len(self.named) :]
        self.z = ca.SX.zeros(int(rollout.z.shape[0]))
        if len(self.named):
            named = self.constants[self.parameter_size : self.parameter_size + len(self.named)]
            self.z[self.named.tolist()] = named
        self.interval = rollout.parameters.step_length(rollout.problem.simulation, self.p)
        driven = {law_on for law in rollout.problem.forces for law_on, _, _ in law.acts_on}
        self.driven = driven | {name for c in rollout.problem.controllers for name, _ in c.drives}
        self.of_step = self.driven | rollout.parameters.phases.sets.keys()

    @property
    def arguments(self) -> tuple[Expr, ...]:
        """Of functions of them, in the order of ``SOURCES`` in ``stage_functions``."""
        return self.x, self.first, self.u, self.constants, self.tick

    def value(self, formula: Formula, after: bool) -> Expr:
        """(r,): a formula of an instant at the state that is looked at."""
        return self._call(formula, after, [])

    def at_end(self, formula: Formula, tick: int) -> Expr:
        """(r,): a formula with parts, at the last state or, where these follow from z, at its own ``tick``."""
        after, sums = tick == self.rollout.steps, self.x[self.state_size :]
        if self.sums.local(formula, tick):
            return self._call(formula, after, [self._part(part, after) for part in formula.parts])
        names = {part.name: self._part(part, True) for part in formula.parts}
        for name in self.sums.own_names(formula):
            names[name] = sums[self.sums.sum_of(parse(name), "held", tick)]
        variables = self.rollout.problem.variables
        names |= {v.name: self.z[a:b] for v, (a, b) in zip(variables, spans(variables), strict=True)}
        return ca.SX(formula.evaluate({name: names[name] for name in formula.names}))

    def _part(self, part: Any, after: bool) -> Expr:
        duration = self.interval * self.rollout.steps
        return self.sums.value(part, self.x[self.state_size :], self.starts, duration, self.value(part.formula, after))

    def _call(self, formula: Formula, after: bool, parts: list[Expr]) -> Expr:
        x, time = self.x[: self.state_size], self.tick * self.interval
        tick = self.tick - 1 if after else self.tick
        u = self._inputs(after) if self.driven & formula.names else self.rollout.with_shares(self.u, tick)
        more = [ca.vertcat(*parts)] if parts else []
        return self.rollout.compiled(formula)(x, u, self.p, time, self.z, *more)

    def _inputs(self, after: bool) -> Expr:
        """The inputs of the step, with what controllers and force laws add."""
        if after not in self._driven_inputs:
            feedback = self.rollout.feedback
            assert feedback is not None, "nothing else drives inputs"
            x, tick = (self.first, self.tick - 1) if after else (self.x[: self.state_size], self.tick)
            u = self.rollout.with_shares(self.u, tick)
            self._driven_inputs[after] = feedback(x, u, self.p, tick * self.interval)
        return self._driven_inputs[after]

    @cached_property
    def _driven_inputs(self) -> dict[bool, Expr]:
        return {}

    @cached_property
    def bases(self) -> tuple[Expr, Expr]:
        """The states ``x`` and ``first`` by their tangents; sums are tangents of their own."""
        x, first = (self.tangent.basis(state[: self.state_size], self.p) for state in (self.x, self.first))
        return ca.diagcat(x, ca.SX.eye(len(self.sums.sums))), first

    @cached_property
    def shifts(self) -> tuple[Expr, Expr] | None:
        """How both move with p while their tangents do not; None where p moves no joints."""
        if not self.tangent.shifts:
            return None
        x, first = (self.tangent.shift(state[: self.state_size], self.p) for state in (self.x, self.first))
        return ca.vertcat(x, ca.SX(len(self.sums.sums), self.parameter_size)), first


def named_entries(problem: Problem) -> Ints:
    """The entries of z whose variables some formula names."""
    names = frozenset[str]().union(*(each.formula.needed for each in _tables(problem)))
    found = [
        range(*span) for v, span in zip(problem.variables, spans(problem.variables), strict=True) if v.name in names
    ]
    return np.array([i for each in found for i in each], np.int64)


def _tables(problem: Problem) -> list[Cost | Target | Constraint]:
    return [*problem.costs, *problem.targets, *problem.constraints]


def motion_sums(rollout: Rollout) -> MotionSums:
    """The sums and starts that the formulas of a problem need."""
    problem, found = rollout.problem, MotionSums(rollout)
    for each in _tables(problem):
        if each.formula.parts:
            found.note(each.name, each.formula, rollout.tick(each.at))
    return found


def stage_terms(symbols: StageSymbols) -> list[StageTerm]:
    """Everything that a problem asks of its motion, and the sums that this takes, term by term.

    The weighted sum of costs and squares is the objective. Limits are in the order of the problem's constraints.
    """
    return [*_Terms(symbols).all(), *_sums(symbols)]


class _Terms:
    """Makes the terms of a problem's tables."""

    def __init__(self, symbols: StageSymbols) -> None:
        self.symbols, self.rollout = symbols, symbols.rollout
        self.free = self.rollout.problem.free_duration

    def all(self) -> Iterator[StageTerm]:
        problem = self.rollout.problem
        for cost in problem.costs:
            kind: Kind = "squares" if cost.squares else "cost"
            if cost.at == "always":
                sides = (False, True) if self.rollout.moves(cost.formula) else (False,)
                for after in sides:
                    yield self._running(cost.name, kind, cost.weight / len(sides), cost.formula, cost.during, after)
            else:
                yield self._instant(cost.name, kind, cost.weight, cost.formula, cost.at)
        for target in problem.targets:
            yield self._instant(target.name, "squares", target.weight, target.formula, target.at)
        for limit in problem.constraints:
            if limit.at == "always":
                yield self._running(limit.name, "limit", limit.penalty, limit.formula, limit.during, True)
            else:
                yield self._instant(limit.name, "limit", limit.penalty, limit.formula, limit.at)

    def _running(self, name: str, kind: Kind, weight: float, formula: Formula, phase: Any, after: bool) -> StageTerm:
        """At all steps, or at those of a phase; a time step that varies is part of the value."""
        steps = np.arange(*(phase.ticks(self.rollout.steps) if phase else (0, self.rollout.steps)))
        value, dt = self.symbols.value(formula, after), self.symbols.interval
        if not self.free or kind == "limit":
            return StageTerm(name, kind, weight * self.rollout.dt, steps, after, value, self._key(formula, kind, after))
        value = value * (ca.sqrt(dt) if kind == "squares" else dt)
        return StageTerm(name, kind, weight, steps, after, value, (*self._key(formula, kind, after), "running"))

    def _instant(self, name: str, kind: Kind, weight: float, formula: Formula, when: str | float) -> StageTerm:
        tick, last = self.rollout.tick(when), self.rollout.steps
        if not formula.parts:
            value, key = self.symbols.value(formula, tick == last), self._key(formula, kind, tick == last)
        else:
            value, key = self.symbols.at_end(formula, tick), (formula.text, kind, tick)
            tick = tick if self.symbols.sums.local(formula, tick) else last
        return StageTerm(name, kind, weight, np.array([min(tick, last - 1)]), tick == last, value, key)

    def _key(self, formula: Formula, kind: Kind, after: bool) -> tuple[object, ...]:
        return formula.text, kind, after and not self.symbols.of_step.isdisjoint(formula.names)


def _sums(symbols: StageSymbols) -> Iterator[StageTerm]:
    for number, each in enumerate(symbols.sums.sums):
        for after, weights in ((False, each.before), (True, each.after)):
            if weights.any():
                value = symbols.value(each.formula, after)[each.component]
                steps = np.flatnonzero(weights)
                key = number, after and not symbols.of_step.isdisjoint(each.formula.names)
                yield StageTerm("sum", "sum", float(weights[steps[0]]), steps, after, value, key, number)
