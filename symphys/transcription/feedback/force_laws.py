"""Forces that follow from the state: what they add to the inputs of a step.

Inputs are constant over a step. A force of the state at t_k would therefore be of first order. The laws are evaluated
at t_k + dt/2 instead, see ``half_step_function``, which makes them of second order. Velocities there need
accelerations, which depend on the laws. For them the laws are evaluated at t_k first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.observation import half_step_function
from symphys.model.state_layout import Layout, input_columns
from symphys.model.world import World
from symphys.problem import ForceLaw, Problem
from symphys.transcription.feedback.sensor_memory import SensorMemory
from symphys.transcription.formula_names import Instant, Parameters, instant, namespace

Expr = Any
"""casadi SX"""
QUARTER = 0.25
"""Of a step: so far from its ends it is asked which step a time belongs to, so that rounding does not matter."""


def force_function(
    problem: Problem, world: World, inputs: Sequence[str], parameters: Parameters, memory: SensorMemory
) -> ca.Function:
    """(x, u, p, time) -> the inputs: u, and what all laws of the state add; x with its memory."""
    at = instant(world, inputs, parameters, memory, 0)
    scheme = parameters.scheme(problem.simulation)
    ahead = half_step_function(world, scheme, inputs, parameters.symbols)
    plain = Layout(world).size

    def added(laws: Sequence[ForceLaw], x: Expr, time: Expr) -> Expr:
        return _added(problem, world, inputs, parameters, memory, laws, Instant(x, at.u, at.p, time, at.z))

    first = at.u + added(problem.forces, at.x, at.time)
    half = ca.vertcat(ahead(at.x[:plain], first, at.p), at.x[plain:])
    total = at.u + added(problem.forces, half, at.time + scheme.dt / 2)
    return ca.Function("forces", [at.x, at.u, at.p, at.time], [ca.densify(total)])


def _added(
    problem: Problem,
    world: World,
    inputs: Sequence[str],
    parameters: Parameters,
    memory: SensorMemory,
    laws: Sequence[ForceLaw],
    at: Instant,
) -> Expr:
    """(nu,): what laws give at an instant."""
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
    """1 in the steps of a phase, else 0: at the start of a step, whose number ``tick`` is, or half a step later."""
    first, last = (round(share * steps) - QUARTER for share in shares)
    return ca.logic_and(tick > first, tick < last)
