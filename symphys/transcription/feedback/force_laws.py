"""Forces that follow from the state: what they add to the inputs of a step.

Inputs are constant over a step. A force of the state at t_k would therefore be of first order. The laws are evaluated
at t_k + dt/2 instead, see ``half_step_function``, which makes them of second order. Velocities there depend on the laws
themselves, f = law(state at t_k + dt/2 under f), so that drag is the implicit midpoint rule: a body that drag stops
goes m v / c at any step. Two steps of Newton's method from f = 0, with one slope, solve this: exactly for what is
linear in velocities, and drag that grows with them takes speed in every step.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.observation import half_step_function
from symphys.model.state_layout import Layout, input_columns
from symphys.model.world import World
from symphys.problem import ForceLaw, Problem
from symphys.transcription.feedback.sensor_memory import SensorMemory
from symphys.transcription.formula_names import Instant, Parameters, instant, namespace
from symphys.types import Expr

LEAST_PIVOT = 0.5
"""Laws that push the stronger the faster a body goes grow by at most its inverse within a step."""
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
    """(nu,): f of f = first + slope f, by elimination among the entries that the slope (nu, nu) depends on."""
    slope = ca.sparsify(slope)
    own = sorted(set(slope.sparsity().get_triplet()[1]))
    rows = [{j: float(i == j) - slope[i, j] for j in own if i == j or slope.has_nz(i, j)} for i in own]
    right = {i: first[i] for i in own}
    for k, i in enumerate(own):
        pivot = ca.fmax(rows[k][i], LEAST_PIVOT)
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
        found[i] = (right[i] - known) / ca.fmax(rows[k][i], LEAST_PIVOT)
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
