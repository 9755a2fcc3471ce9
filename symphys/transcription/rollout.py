"""A rollout as symbols: force laws and controllers, the step with them, and formulas evaluated along it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from symphys.codegen.toolchain.identity import identity_of
from symphys.codegen.toolchain.warm_start import kept_function
from symphys.dynamics.applied import applied_function
from symphys.dynamics.kept import kept, structure
from symphys.dynamics.observation import half_step_function
from symphys.expression import Formula
from symphys.maths.verbatim import verbatim
from symphys.model.state_layout import Layout, input_columns, input_sizes, inputs_size
from symphys.model.world import World
from symphys.problem import ALIVE, FeedbackController, ForceLaw, Problem, Sensor, Termination
from symphys.records import dataclass
from symphys.transcription.decision_variables import start_of
from symphys.transcription.formula_names import (
    STEP_MARGIN,
    Instant,
    Parameters,
    compile_formula,
    input_names,
    instant,
    moving_names,
    namespace,
    varied_parameters,
)
from symphys.transcription.sensor_memory import SensorMemory, memory_of
from symphys.types import Expr

MIN_PIVOT = 0.5
"""Least pivot: force laws that grow with speed grow by at most its inverse within a step."""


def force_function(
    problem: Problem, world: World, inputs: Sequence[str], parameters: Parameters, memory: SensorMemory
) -> ca.Function:
    """Return (x, u, p, time) -> the inputs: u plus all force laws of the state; x with its memory.

    Inputs are constant over a step, so a force of the state at t_k would be of first order. The laws are evaluated at
    t_k + dt/2 instead, see ``half_step_function``, which makes them of second order. Velocities there depend on the
    laws themselves, f = law(state at t_k + dt/2 under f), so that drag is the implicit midpoint rule: a body that drag
    stops goes m v / c at any step. Two steps of Newton's method from f = 0, with one slope, solve this: exactly for
    laws that are linear in velocities; drag that grows with them takes speed in every step.
    """
    at = instant(world, inputs, parameters, memory, 0)
    scheme = parameters.scheme(problem.simulation)
    ahead = half_step_function(world, scheme, inputs, parameters.symbols)
    plain = Layout(world).size

    # Law at the half step as a function of the forces that it adds.
    given = ca.SX.sym("given", at.u.size1())
    half = ca.vertcat(ahead(at.x[:plain], at.u + given, at.p), at.x[plain:])
    moment = Instant(half, at.u, at.p, at.time + scheme.dt / 2, at.z)
    law = _added(problem, world, inputs, parameters, memory, problem.forces, moment)
    # Two Newton steps from zero with one slope.
    first, slope = ca.substitute([law, ca.jacobian(law, given)], [given], [ca.SX.zeros(given.size1())])
    found = _with_slope(first, slope)
    again = ca.substitute(law, given, found)
    total = at.u + found + _with_slope(again - found, slope)
    return ca.Function("forces", [at.x, at.u, at.p, at.time], [ca.densify(total)])


def _with_slope(first: Expr, slope: Expr) -> Expr:
    """Solve f = first + slope f for f (nu,), by elimination among the entries that the slope (nu, nu) has."""
    slope = ca.sparsify(slope)
    own = sorted(set(slope.sparsity().get_triplet()[1]))
    # Sparse Gaussian elimination of (I - slope) f = first, with pivots bounded from below.
    rows = [{j: float(i == j) - slope[i, j] for j in own if i == j or slope.has_nz(i, j)} for i in own]
    right = {i: first[i] for i in own}
    for k, i in enumerate(own):
        pivot = ca.fmax(rows[k][i], MIN_PIVOT)
        for below in range(k + 1, len(own)):
            share = rows[below].get(i)
            if share is None:
                continue
            for j in own[k + 1 :]:
                if j in rows[k]:
                    rows[below][j] = rows[below].get(j, 0) - share / pivot * rows[k][j]
            right[own[below]] -= share / pivot * right[i]
    # Back substitution.
    found: dict[int, Expr] = {}
    for k, i in reversed(list(enumerate(own))):
        known = sum((rows[k][j] * found[j] for j in own[k + 1 :] if j in rows[k]), ca.SX(0))
        found[i] = (right[i] - known) / ca.fmax(rows[k][i], MIN_PIVOT)
    solved = ca.SX.zeros(first.size1())
    for i, value in found.items():
        solved[i] = value
    return first + ca.mtimes(slope, solved)


def _added(
    problem: Problem,
    world: World,
    inputs: Sequence[str],
    parameters: Parameters,
    memory: SensorMemory,
    laws: Sequence[ForceLaw],
    at: Instant,
) -> Expr:
    """Return (nu,) the inputs that laws add at an instant."""
    total, columns = ca.SX.zeros(at.u.shape[0]), input_columns(world, inputs)
    wanted = frozenset[str]().union(*(law.formula.names for law in laws))
    names = namespace(problem, world, inputs, parameters, memory, at, wanted)
    for variable in problem.variables:
        if variable.name in wanted:
            slot = variable.slots[0]
            names[variable.name] = ca.vertcat(*(names[slot.name][k] for k in slot.components))
    tick = at.time / parameters.step_length(problem.simulation, at.p)
    for law in laws:
        value = law.formula.evaluate({name: names[name] for name in law.formula.names})
        if law.during is not None:
            value = value * _within(tick, law.during, problem.simulation.steps)
        for name, components, sign in law.acts_on:
            for k, component in enumerate(components):
                total[columns[name].start + component] += sign * value[k]
    return total


def _within(tick: Expr, shares: tuple[float, float], steps: int) -> Expr:
    """Return 1 in the steps of a phase, else 0: at the start of a step number ``tick``, or half a step later."""
    first, last = (round(share * steps) - STEP_MARGIN for share in shares)
    return ca.logic_and(tick > first, tick < last)


class Control:
    """The sensors and controllers of a problem, as functions that a rollout calls in every step."""

    def __init__(
        self, problem: Problem, world: World, inputs: Sequence[str], parameters: Parameters, memory: SensorMemory
    ) -> None:
        """Prepare the functions, which are built on demand."""
        self.problem, self.world, self.inputs, self.parameters, self.memory = problem, world, inputs, parameters, memory

    def sensor(self, sensor: Sensor) -> ca.Function:
        """Return (x, p, time) -> the reading of a sensor; x with its memory."""
        at = instant(self.world, self.inputs, self.parameters, self.memory, 0)
        wanted = frozenset[str]().union(*(formula.names for formula in sensor.formulas))
        names = namespace(self.problem, self.world, self.inputs, self.parameters, self.memory, at, wanted)
        zeros = {name: ca.SX.zeros(size) for name, size in input_sizes(self.world).items()}
        names |= {**zeros, **self.memory.commands(at.x)}
        parts = [ca.SX(formula.evaluate({name: names[name] for name in formula.names})) for formula in sensor.formulas]
        return ca.Function("sense", [at.x, at.p, at.time], [ca.densify(ca.vertcat(*parts))])

    def numbers(self, controller: FeedbackController, p: Expr) -> dict[str, Expr]:
        """Return the controller's numbers among the parameters."""
        return {key: p[self.parameters.columns[f"{controller.name}.{key}"]] for key in controller.law.sizes}

    def place(self, controller: FeedbackController) -> ca.DM:
        """Return (nu, m) sparse: the input that each output is added to, scaled."""
        columns = input_columns(self.world, self.inputs)
        rows = [columns[name].start + component for name, component in controller.drives]
        count = len(rows)
        return ca.DM.triplet(
            rows, list(range(count)), ca.DM(controller.scale), inputs_size(self.world, self.inputs), count
        )

    def function(self) -> ca.Function:
        """(x, u, p, time) -> the inputs: u of the variables, plus all controllers and force laws."""
        at = instant(self.world, self.inputs, self.parameters, self.memory, 0)
        read = {s.name: self.sensor(s)(at.x, at.p, at.time) for s in self.problem.sensors}
        u = at.u
        for controller in self.problem.controllers:
            sensed = ca.vertcat(ca.SX(0, 1), *(read[name] for name in controller.senses))
            outputs = controller.law.act(sensed, at.time, self.numbers(controller, at.p))
            u = u + ca.mtimes(self.place(controller), outputs)
        if self.laws is not None:
            u = self.laws(at.x, u, at.p, at.time)
        return ca.Function("control", [at.x, at.u, at.p, at.time], [ca.densify(u)])

    @cached_property
    def laws(self) -> ca.Function | None:
        """Return ``force_function``; None without force laws."""
        if not self.problem.forces:
            return None
        return force_function(self.problem, self.world, self.inputs, self.parameters, self.memory)


def termination_function(
    problem: Problem,
    termination: Termination,
    world: World,
    inputs: Sequence[str],
    parameters: Parameters,
    memory: SensorMemory,
) -> ca.Function:
    """Return (x, after, p) -> the next state; ``after`` is the state after the step from x without ``alive``."""
    margin = compile_formula(problem, world, inputs, parameters, memory, termination.margin)
    x, after = ca.SX.sym("x", memory.size), ca.SX.sym("after", memory.size - 1)
    p = ca.SX.sym("p", margin.size1_in(2))
    blank = [ca.SX.zeros(margin.size1_in(i)) for i in (1, 3, 4)]
    left = margin(ca.vertcat(after, 1), blank[0], p, blank[1], blank[2])
    moved = ca.vertcat(after, left >= 0)
    return ca.Function("termination", [x, after, p], [ca.if_else(x[memory.columns[ALIVE]] > 0, moved, x)])


T = TypeVar("T")


@dataclass(frozen=True)
class Rollout:
    """A problem's rollout as expressions of z and smoothing (MX).

    Attributes:
        problem: the simulated problem.
        world: its numbers, with symbols (SX) for the parameters that variables set.
        inputs: names of the inputs that u stacks.
        parameters: the entries of p.
        memory: the entries of x after the world's state.
        z: (n,) decision vector.
        smoothing: scalar.
        x0: (nx,) initial state.
        given: (nu, N) inputs as variables give them; controllers add to them. Shares of phases are last.
        p: (np,).
        like: a rollout of an equal world under another scheme, whose steps this one's have parts in common with.
    """

    problem: Problem
    world: World
    inputs: tuple[str, ...]
    parameters: Parameters
    memory: SensorMemory
    z: Expr
    smoothing: Expr
    x0: Expr
    given: Expr
    p: Expr
    _built: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def controls(self) -> int:
        """Return the number of inputs that variables, controllers and laws may set, without shares of phases."""
        return int(self.given.shape[0]) - len(self.world.scheduled)

    def with_shares(self, u: Expr, tick: Expr) -> Expr:
        """Return (nu,) the inputs of a step by its number, with the shares of phases appended."""
        return ca.vertcat(u, self.parameters.phases.at(tick)) if self.world.scheduled else u

    @cached_property
    def step(self) -> ca.Function:
        """One step (x, u, p, smoothing) -> x_next, built on demand since one expression takes a while."""

        def make() -> ca.Function:
            from symphys.dynamics.functions import step_function

            return self.built(step_function)

        return self.remembering(self._kept("step", make))

    @cached_property
    def report(self) -> ca.Function:
        """The step with all reported quantities; see ``report_function``."""

        def make() -> ca.Function:
            from symphys.dynamics.functions import report_function

            return self.built(report_function)

        return self.remembering(self._kept("report", make))

    @cached_property
    def applied_wrenches(self) -> ca.Function:
        """Forces and torques of inputs on bodies in a step; see ``applied_function``."""
        return self.built(applied_function)

    @property
    def _shares(self) -> bool:
        """Whether problems of a sweep share the built functions."""
        return bool(self.problem.varied) and not self.problem.free_duration and not self.world.scheduled

    def built(self, make: Callable[..., T], *more: Hashable) -> T:
        """Build a function of the world, once for all programs of this rollout and of sweeps with equal worlds."""

        def new() -> T:
            scheme = self.parameters.scheme(self.problem.simulation)
            arguments = (self.world, scheme, self.inputs, self.parameters.symbols)
            return kept(make, *arguments, *more) if self._shares else make(*arguments, *more)

        return self.once((make, more), new)

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what ``make`` makes for this rollout, the first time; later the same."""
        if key not in self._built:
            self._built[key] = make()
        found: T = self._built[key]
        return found

    def _kept(self, name: str, make: Callable[[], ca.Function]) -> ca.Function:
        """Return a function of the world alone, from the cache of kernels where an equal world has been there."""
        scheme = self.parameters.scheme(self.problem.simulation)
        same = structure(self.world, self.parameters.symbols, scheme)
        return kept_function(make, identity_of(name, same, self.inputs))

    def remembering(self, step: ca.Function) -> ca.Function:
        """Extend a function (x, u, p, smoothing) -> (x_next, ...) to states with memory."""
        if self.memory.size == step.size1_in(0):
            return step
        x, u = ca.MX.sym("x", self.memory.size), ca.MX.sym("u", step.size1_in(1))
        p, smoothing = ca.MX.sym("p", step.size1_in(2)), ca.MX.sym("smoothing")
        after, *others = call(step, x[: step.size1_in(0)], u, p, smoothing)
        whole: Expr = ca.vertcat(after, self.memory.after(x, u, self.inputs))
        if self.termination is not None:
            whole = self.termination(x, whole, p)
        with verbatim():
            return ca.Function(step.name(), [x, u, p, smoothing], [whole, *others]).expand()

    @cached_property
    def termination(self) -> ca.Function | None:
        """Return ``termination_function``; None for a problem without termination."""
        problem = self.problem
        if problem.termination is None:
            return None
        return termination_function(problem, problem.termination, self.world, self.inputs, self.parameters, self.memory)

    @cached_property
    def control(self) -> Control:
        """Sensors and controllers."""
        return Control(self.problem, self.world, self.inputs, self.parameters, self.memory)

    @cached_property
    def feedback(self) -> ca.Function | None:
        """(x, u, p, time) -> the inputs of the step from x; None without controllers and force laws."""
        return self.control.function() if self.problem.controllers or self.problem.forces else None

    @cached_property
    def closed(self) -> ca.Function:
        """``step`` with the controllers in it; see ``close``."""
        return self.close(self.step)

    def close(self, step: ca.Function) -> ca.Function:
        """Add the controllers to a step (x, u, p, smoothing) -> (x_next, ...), which then takes [u; time] and adds u.

        Without controllers the second argument is u alone, and u is not among the results.
        """
        if self.feedback is None:
            return step
        x, given = ca.MX.sym("x", self.memory.size), ca.MX.sym("given", step.size1_in(1) + 1)
        p, smoothing = ca.MX.sym("p", step.size1_in(2)), ca.MX.sym("smoothing")
        u = self.feedback(x, given[:-1], p, given[-1])
        results = call(step, x, u, p, smoothing)
        return ca.Function(f"closed_{step.name()}", [x, given, p, smoothing], [*results, u])

    def rolled(self, step: ca.Function) -> tuple[Expr, Expr, list[Expr]]:
        """Return states (nx, N + 1), inputs (nu, N) and the other results of ``step``, which is not closed."""
        from symphys.dynamics.functions import roll_out

        given = self.given
        if self.feedback is not None:
            given = ca.vertcat(given, ca.DM(np.arange(self.steps)).T * self.interval)
        x, *others = roll_out(self.close(step), self.steps, self.x0, given, self.p, self.smoothing)
        return (x, self.given, others) if self.feedback is None else (x, others[-1], others[:-1])

    @cached_property
    def _motion(self) -> tuple[Expr, Expr]:
        x, u, _ = self.rolled(self.step)
        return x, u

    @property
    def x(self) -> Expr:
        """The states (nx, N + 1)."""
        return self._motion[0]

    @property
    def u(self) -> Expr:
        """The inputs (nu, N)."""
        return self.given if self.feedback is None else self._motion[1]

    def applied(self, x: Expr) -> Expr:
        """Return the inputs (nu, N) of steps from states (nx, N + 1): those of variables, controllers and laws."""
        if self.feedback is None:
            return self.given
        times = ca.DM(np.arange(self.steps)).T * self.interval
        return self.feedback.map(self.steps)(x[:, :-1], self.given, ca.repmat(self.p, 1, self.steps), times)

    @property
    def steps(self) -> int:
        """The number of steps ``N``."""
        return self.problem.simulation.steps

    @property
    def dt(self) -> float:
        """The time step [s] of the file."""
        return self.problem.simulation.dt

    @property
    def interval(self) -> Expr:
        """The time step [s]: ``dt``, or an expression of z with a free duration."""
        return self.parameters.step_length(self.problem.simulation, self.p)

    def compiled(self, formula: Formula) -> ca.Function:
        """Return the formula as a casadi function of (x, u, p, time, z), and of its parts in order."""
        parts = self.problem, self.world, self.inputs, self.parameters, self.memory, formula
        made: ca.Function = self.once(formula, lambda: compile_formula(*parts))
        return made

    def tick(self, when: str | float) -> int:
        """Return the number of the state at the end, or nearest to a time [s]."""
        return self.steps if isinstance(when, str) else round(when / self.dt)

    def sampled_along(self, formula: Formula, shift: int, x: Expr, u: Expr, p: Expr, z: Expr) -> Expr:
        """Return the values (m, N) of a formula at the starts (0) or ends (1) of all steps, with each step's inputs.

        Of states (nx, N + 1), inputs (nu, N), parameters (np,) and a decision vector (n,).
        """
        ticks, interval = np.arange(shift, self.steps + shift), self.parameters.step_length(self.problem.simulation, p)
        named = any(variable.name in formula.names for variable in self.problem.variables)
        shared = ca.repmat(z, 1, self.steps) if named else ca.DM(z.shape[0], self.steps)
        given = (x[:, shift : self.steps + shift], u, ca.repmat(p, 1, self.steps), ca.DM(ticks).T * interval, shared)
        return self.compiled(formula).map(self.steps)(*given)

    def moves(self, formula: Formula) -> bool:
        """Whether the formula depends on what changes within a step."""
        return not self._moving.isdisjoint(formula.names)

    @cached_property
    def _moving(self) -> frozenset[str]:
        return moving_names(self.world).union(*(each.names for each in self.problem.references))


def symbolic_rollout(
    problem: Problem, inputs: tuple[str, ...] | None = None, asked: Iterable[Formula] = (), timed: bool = False
) -> Rollout:
    """Make the rollout of a problem; ``inputs`` may name more than the problem itself uses.

    ``asked``: formulas that will be evaluated along it beside those of the problem. ``timed``: the time step is a
    parameter, so that finer steps share what is built.
    """
    parameters = varied_parameters(problem, timed)
    scheduled = tuple((share.name, share.symbol) for share in parameters.phases.shares)
    inputs = (*(input_names(problem) if inputs is None else inputs), *(name for name, _ in scheduled))
    world = replace(problem.world(parameters.overrides()), scheduled=scheduled)
    z = ca.MX.sym("z", sum(v.guess.size for v in problem.variables))
    smoothing = ca.MX.sym("smoothing")
    start, memory = start_of(problem, world, inputs, parameters, z), memory_of(problem, world, inputs, asked)
    return Rollout(problem, world, inputs, parameters, memory, z, smoothing, memory.start(start.x0), start.u, start.p)


def call(function: ca.Function, *arguments: Expr) -> list[Expr]:
    """Return all results of a call."""
    results = function(*arguments)
    return list(results) if isinstance(results, tuple) else [results]
