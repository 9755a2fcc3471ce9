"""Costs, targets, constraints and sums of a problem as functions of one step: state, input, state after.

They are those of ``symphys.transcription.terms``. Every term is evaluated at some steps. There it looks at the state
before the step or at the state after it, with the input of the step. Inputs that controllers or force laws drive
follow from the state before the step.

What formulas take of a whole motion is carried beside its state. A part ``integral(f)`` or ``average(f)`` is a sum
along the motion, by the rule of running costs. An input of the first step, and whatever a formula reads at an instant
before the end together with such parts, is a sum as well: of one tick. A part ``start.NAME`` of the state is a function
of the static entries of z. A part ``end.NAME`` is read in the last state, so that every formula with parts becomes one
of the last step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property, partial
from typing import Any, Literal

import casadi as ca
import numpy as np

from symphys.codegen.toolchain.warm_start import from_cache
from symphys.errors import SymphysError
from symphys.expression import Formula, MotionPart, parse
from symphys.problem import Constraint, Cost, Problem, Target
from symphys.records import dataclass
from symphys.suggest import quote
from symphys.transcription.formula_names import spans
from symphys.transcription.identities import terms_identity
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.tangent import Tangent
from symphys.transcription.terms import Term, over_time, problem_terms
from symphys.types import Array, Expr, Ints


@dataclass(frozen=True)
class MotionSum:
    """One number that is summed along a motion.

    Attributes:
        formula, component: the summed number.
        before, after: (N,) its weights at the start and at the end of each step.
    """

    formula: Formula
    component: int
    before: Array
    after: Array


@dataclass(eq=False)
class MotionSums:
    """The sums and initial values that a problem's formulas need, collected on demand.

    Attributes:
        rollout: of the problem.
        sums: beside the state, in this order.
        starts: formulas of the first state, (a,) components in all.
    """

    rollout: Rollout
    sums: list[MotionSum] = field(default_factory=list)
    starts: list[Formula] = field(default_factory=list)
    _known: dict[tuple[str, str, int], slice] = field(default_factory=dict)
    _ends: int = 0

    def sum_of(self, formula: Formula, kind: str, tick: int = -1) -> slice:
        """Return the columns of a sum: ``mean`` over the motion, or ``held`` from the start of step ``tick``."""
        key = kind, formula.text, tick
        if key not in self._known:
            steps, first = self.rollout.steps, len(self.sums)
            weights = np.zeros((2, steps))
            if kind == "held":
                weights[0, tick] = 1.0
            else:
                sides = over_time(self.rollout, formula).sides
                weights[list(sides)] = 1.0 / len(sides) / steps
            size = int(self.rollout.compiled(formula).size1_out(0))
            self.sums += [MotionSum(formula, i, *weights) for i in range(size)]
            self._known[key] = slice(first, first + size)
        return self._known[key]

    def start_of(self, formula: Formula) -> slice:
        """Return the columns of a formula of the first state among the initial values."""
        key = "start", formula.text, 0
        if key not in self._known:
            size = int(self.rollout.compiled(formula).size1_out(0))
            self._known[key] = slice(self._ends, self._ends + size)
            self.starts.append(formula)
            self._ends += size
        return self._known[key]

    def note(self, name: str, formula: Formula, tick: int) -> None:
        """Register the sums and starts that a formula with parts, of the table ``name``, needs at a tick.

        Raises:
            SymphysError: for an integral of a variable over time, whose knots are not all decided while it adds up.
        """
        for part in formula.parts:
            if part.kind in ("integral", "average"):
                require_inputs(self.rollout.problem, name, part)
        for part in formula.parts:
            if part.kind in ("integral", "average"):
                self.sum_of(part.formula, "mean")
            elif part.kind == "start" and self.of_input(part.formula):
                self.sum_of(part.formula, "held", 0)
            elif part.kind == "start" and not self.constant(part.formula):
                self.start_of(part.formula)
        if not self.local(formula, tick):
            for name in self.own_names(formula):
                self.sum_of(parse(name), "held", tick)

    def local(self, formula: Formula, tick: int) -> bool:
        """Whether the formula can be evaluated at its tick: at the end, or if its parts are functions of z."""
        of_start = all(part.kind == "start" and not self.of_input(part.formula) for part in formula.parts)
        return tick == self.rollout.steps or of_start

    def own_names(self, formula: Formula) -> list[str]:
        """Return the names that a formula reads at its own instant, except variables."""
        parts = {part.name for part in formula.parts}
        return sorted(formula.names - parts - {variable.name for variable in self.rollout.problem.variables})

    def constant(self, formula: Formula) -> bool:
        """Whether a formula reads only variables."""
        return not self.own_names(formula)

    def of_input(self, formula: Formula) -> bool:
        """Whether a formula reads an input."""
        return bool(self.rollout.compiled(formula).jac_sparsity(0, 1).nnz())

    def value(self, part: MotionPart, sums: Expr, starts: Expr, duration: Expr, at_end: Expr) -> Expr:
        """Return a part from the sums of the last state, starts, duration, and its formula at the end."""
        if part.kind == "end" or (part.kind == "start" and self.constant(part.formula)):
            return at_end
        if part.kind == "start" and not self.of_input(part.formula):
            return starts[self.start_of(part.formula)]
        if part.kind == "start":
            return sums[self.sum_of(part.formula, "held", 0)]
        mean = sums[self.sum_of(part.formula, "mean")]
        return mean * duration if part.kind == "integral" else mean

    @cached_property
    def started(self) -> ca.Function:
        """Return z -> the starts (a,)."""
        rollout = self.rollout
        found = [
            rollout.compiled(formula)(rollout.x0, rollout.given[:, 0], rollout.p, 0, rollout.z)
            for formula in self.starts
        ]
        return ca.Function("starts", [rollout.z], [ca.densify(ca.vertcat(ca.MX(0, 1), *found))])

    def started_slopes(self, z: Array, statics: Sequence[int]) -> Array:
        """Return (a, s) derivatives of the starts by the static entries of z."""
        if self._slopes is None:
            slope = ca.jacobian(self.started(self.rollout.z), self.rollout.z)[:, list(statics)]
            self._slopes = ca.Function("slopes", [self.rollout.z], [ca.densify(slope)])
        return np.array(self._slopes(z)).reshape(-1, len(statics))

    _slopes: ca.Function | None = None


def require_inputs(problem: Problem, name: str, part: MotionPart) -> None:
    """Refuse integrals of knots: SymphysError names what to integrate instead."""
    for variable in problem.variables:
        if variable.kind == "control" and variable.name in part.formula.names:
            inputs = ", ".join(dict.fromkeys(slot.name for slot in variable.slots))
            text = f"{part.name} is of all knots of {quote(variable.name)} at every instant; integrate {inputs}"
            raise SymphysError(f"{name}: {text}, or take a solver that sees the motion as a whole")


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
        make: makes its value (r,), an expression of ``StageSymbols``.
        key: terms with equal ones have equal values and slopes, whichever state they look at.
        number: of a sum.
        size: its number of components ``r``.
    """

    name: str
    kind: Kind
    weight: float
    steps: Ints
    after: bool
    make: Callable[[], Expr]
    key: tuple[object, ...]
    number: int = -1
    size: int = 1

    @cached_property
    def value(self) -> Expr:
        """Return the value (r,)."""
        return self.make()

    @property
    def states(self) -> Ints:
        """Return (T,) the numbers of the states that the term reads."""
        return self.steps + 1 if self.after else self.steps


class StageSymbols:
    """The symbols (SX) of terms, and formulas as expressions of them.

    Attributes:
        x: the state that is looked at, with its sums.
        first: the state before the step, without sums: where it is another one.
        u: inputs as variables give them.
        constants: constant along a motion: p, the entries ``named`` of z, the starts of ``MotionSums``.
        tick: the number of the state that is looked at.
        named: entries of z that some formula names by their variable.
        plain: whether the constants are p alone.
    """

    def __init__(self, rollout: Rollout, tangent: Tangent, sums: MotionSums) -> None:
        """Make symbols for the formulas of a problem, with complete ``sums``."""
        self.rollout, self.tangent, self.sums = rollout, tangent, sums
        self.named = named_entries(rollout.problem)
        self.state_size, self.parameter_size = rollout.memory.size, int(rollout.p.shape[0])
        starts = int(sums.started.size1_out(0))
        self.x = ca.SX.sym("x", self.state_size + len(sums.sums))
        self.first = ca.SX.sym("first", self.state_size)
        self.u = ca.SX.sym("u", rollout.controls)
        self.constants = ca.SX.sym("constants", self.parameter_size + len(self.named) + starts)
        self.plain = not len(self.named) and not starts
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
        """Return the symbols in the order of the arguments of ``ReadingFunction``."""
        return self.x, self.first, self.u, self.constants, self.tick

    def value(self, formula: Formula, after: bool) -> Expr:
        """Return (r,) a formula of an instant at the evaluated state."""
        return self._call(formula, after, [])

    def at_end(self, formula: Formula, tick: int) -> Expr:
        """Return (r,) a formula with parts, at the last state or, if these follow from z, at its own ``tick``."""
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
        """Return the inputs of the step, with those of controllers and force laws."""
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
        """Return bases of the tangents of ``x`` and ``first``; sums are their own tangents."""
        x, first = (self.tangent.basis(state[: self.state_size], self.p) for state in (self.x, self.first))
        return ca.diagcat(x, ca.SX.eye(len(self.sums.sums))), first

    @cached_property
    def shifts(self) -> tuple[Expr, Expr] | None:
        """Return how both states move with p at fixed tangents; None if p moves no joints."""
        if not self.tangent.shifts:
            return None
        x, first = (self.tangent.shift(state[: self.state_size], self.p) for state in (self.x, self.first))
        return ca.vertcat(x, ca.SX(len(self.sums.sums), self.parameter_size)), first


def named_entries(problem: Problem) -> Ints:
    """Return the entries of z whose variables some formula names."""
    names = frozenset[str]().union(*(each.formula.needed for each in _tables(problem)))
    found = [
        range(*span) for v, span in zip(problem.variables, spans(problem.variables), strict=True) if v.name in names
    ]
    return np.array([i for each in found for i in each], np.int64)


def _tables(problem: Problem) -> list[Cost | Target | Constraint]:
    return [*problem.costs, *problem.targets, *problem.constraints]


def motion_sums(rollout: Rollout) -> MotionSums:
    """Return the sums and starts that the formulas of a problem need."""
    problem, found = rollout.problem, MotionSums(rollout)
    for each in _tables(problem):
        if each.formula.parts:
            found.note(each.name, each.formula, rollout.tick(each.at))
    return found


def stage_terms(symbols: StageSymbols) -> list[StageTerm]:
    """Return all terms of a problem, and the sums that they need, term by term.

    The weighted sum of costs and squares is the objective. Limits are in the order of the problem's constraints.
    """
    found = [*_Terms(symbols, symbols.rollout).all(), *_sums(symbols)]
    identity = terms_identity(symbols.rollout, "sizes of terms", [term.key for term in found])
    sizes = from_cache(lambda: [int(term.value.shape[0]) for term in found], identity)
    return [_sized(term, size) for term, size in zip(found, sizes, strict=True)]


def reweighted(symbols: StageSymbols, terms: Sequence[StageTerm], rollout: Rollout) -> list[StageTerm]:
    """Return terms of ``stage_terms`` with the weights of another rollout, whose problem differs in weights only."""
    others = [*_Terms(symbols, rollout).all(), *_sums(symbols)]
    return [replace(term, weight=other.weight) for term, other in zip(terms, others, strict=True)]


def _sized(term: StageTerm, size: int) -> StageTerm:
    """Return a term with its size; its value is made once."""
    return replace(term, size=size, make=lambda: term.value)


class _Terms:
    """Makes the terms of a problem's tables."""

    def __init__(self, symbols: StageSymbols, rollout: Rollout) -> None:
        self.symbols, self.rollout = symbols, rollout
        self.free = self.rollout.problem.free_duration

    def all(self) -> Iterator[StageTerm]:
        for term in problem_terms(self.rollout):
            if term.running:
                yield from (self._running(term, bool(side)) for side in term.points.sides)
            else:
                yield self._instant(term)

    def _running(self, term: Term, after: bool) -> StageTerm:
        """Make a term at one side of its steps; a varying time step is part of the value."""
        name, kind, steps = term.table.name, term.kind, np.array(term.points.steps, np.int64)
        weight, key = term.weight / len(term.points.sides), self._key(term.formula, kind, after)
        value, dt = partial(self.symbols.value, term.formula, after), self.symbols.interval
        if not self.free or kind == "limit":
            return StageTerm(name, kind, weight * self.rollout.dt, steps, after, value, key)
        share = ca.sqrt(dt) if kind == "squares" else dt
        return StageTerm(name, kind, weight, steps, after, lambda: value() * share, (*key, "running"))

    def _instant(self, term: Term) -> StageTerm:
        ((tick, step),) = term.points.pairs
        formula, kind, last = term.formula, term.kind, self.rollout.steps
        if not formula.parts:
            value = partial(self.symbols.value, formula, tick == last)
            key: tuple[object, ...] = self._key(formula, kind, tick == last)
        else:
            value, key = partial(self.symbols.at_end, formula, tick), (formula.text, kind, tick)
            tick, step = (tick, step) if self.symbols.sums.local(formula, tick) else (last, last - 1)
        return StageTerm(term.table.name, kind, term.weight, np.array([step]), tick == last, value, key)

    def _key(self, formula: Formula, kind: Kind, after: bool) -> tuple[object, ...]:
        return formula.text, kind, after and not self.symbols.of_step.isdisjoint(formula.names)


def _component(symbols: StageSymbols, each: MotionSum, after: bool) -> Expr:
    return symbols.value(each.formula, after)[each.component]


def _sums(symbols: StageSymbols) -> Iterator[StageTerm]:
    for number, each in enumerate(symbols.sums.sums):
        for after, weights in ((False, each.before), (True, each.after)):
            if weights.any():
                value = partial(_component, symbols, each, after)
                steps = np.flatnonzero(weights)
                key = number, after and not symbols.of_step.isdisjoint(each.formula.names)
                yield StageTerm("sum", "sum", float(weights[steps[0]]), steps, after, value, key, number)
