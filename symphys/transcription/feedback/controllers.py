"""Sensors and controllers along a rollout: from the state at t_k to the inputs of the step from there.

Force laws add forces that follow from the state. Inputs are constant over a step, so that a force of the state at t_k
would be of first order. The laws are evaluated at t_k + dt/2 instead, see ``half_step_function``, which makes them of
second order. Velocities there depend on the laws themselves, f = law(state at t_k + dt/2 under f), so that drag is the
implicit midpoint rule: a body that drag stops goes m v / c at any step. Two steps of Newton's method from f = 0, with
one slope, solve this: exactly for what is linear in velocities; drag that grows with them takes speed in every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca

from symphys.dynamics.observation import half_step_function
from symphys.model.state_layout import Layout, input_columns, input_sizes, inputs_size
from symphys.model.world import World
from symphys.problem import FeedbackController, ForceLaw, Problem, Sensor
from symphys.transcription.feedback.sensor_memory import SensorMemory
from symphys.transcription.formula_names import Instant, Parameters, instant, namespace
from symphys.types import Expr

MIN_PIVOT = 0.5
"""Least pivot: force laws that grow with speed grow by at most its inverse within a step."""
STEP_MARGIN = 0.25
"""Share of a step by which times are shifted from its ends, so that rounding does not select another step."""


def force_function(
    problem: Problem, world: World, inputs: Sequence[str], parameters: Parameters, memory: SensorMemory
) -> ca.Function:
    """Return (x, u, p, time) -> the inputs: u plus all force laws of the state; x with its memory."""
    at = instant(world, inputs, parameters, memory, 0)
    scheme = parameters.scheme(problem.simulation)
    ahead = half_step_function(world, scheme, inputs, parameters.symbols)
    plain = Layout(world).size

    given = ca.SX.sym("given", at.u.size1())
    half = ca.vertcat(ahead(at.x[:plain], at.u + given, at.p), at.x[plain:])
    moment = Instant(half, at.u, at.p, at.time + scheme.dt / 2, at.z)
    law = _added(problem, world, inputs, parameters, memory, problem.forces, moment)
    first, slope = ca.substitute([law, ca.jacobian(law, given)], [given], [ca.SX.zeros(given.size1())])
    found = _with_slope(first, slope)
    again = ca.substitute(law, given, found)
    total = at.u + found + _with_slope(again - found, slope)
    return ca.Function("forces", [at.x, at.u, at.p, at.time], [ca.densify(total)])


def _with_slope(first: Expr, slope: Expr) -> Expr:
    """Solve f = first + slope f for f (nu,), by elimination among the entries that the slope (nu, nu) has."""
    slope = ca.sparsify(slope)
    own = sorted(set(slope.sparsity().get_triplet()[1]))
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
