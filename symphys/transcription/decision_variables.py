"""From the decision vector z to the start of a rollout: initial state, inputs of every step, parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from symphys.model.joints.joint import UNWRAPPED
from symphys.model.state_layout import initial_state, input_columns, inputs_size
from symphys.model.world import World
from symphys.problem import STEP_LENGTH, Problem, Variable, begin, carried, placing, reposition
from symphys.records import dataclass
from symphys.shooting import VariableBlock
from symphys.transcription.formula_names import Parameters, spans
from symphys.types import Array, Expr, Ints

MIN_KNOT_SHARE = 1e-9
"""Share of a step below which a knot has no part in it: its end lies on the step's, but for rounding."""


@dataclass(frozen=True)
class RolloutStart:
    """x0 (nx,) without memory, u (nu, N) as variables set it and p (np,), as expressions of z."""

    x0: Expr
    u: Expr
    p: Expr


def blocks(problem: Problem) -> tuple[VariableBlock, ...]:
    """Return the blocks of z, one for each variable."""
    return tuple(
        VariableBlock(v.name, start, (v.guess.size // v.knots, v.knots), v.guess, v.lower, v.upper, v.scale, v.spread)
        for v, (start, _) in zip(problem.variables, spans(problem.variables), strict=True)
    )


def start_of(
    problem: Problem, world: World, inputs: Sequence[str], parameters: Parameters, z: Expr, excluded: Sequence[str] = ()
) -> RolloutStart:
    """Return the start of a rollout of z, without the inputs of the variables ``excluded``, added elsewhere."""
    # Nominal initial state, parameters and inputs.
    starts = problem.parametric.starts()
    winding = [joint.name for joint in problem.parametric.joints if joint.kind.winds]
    near = {f"{name}.{UNWRAPPED}": starts[f"{name}.start"] for name in winding}
    initial = {name: ca.MX(ca.DM(value)) for name, value in (problem.initial | starts | near).items()}
    physical = {name: ca.MX(value) for name, value in zip(parameters.names, parameters.nominal, strict=True)}
    steps, scheduled = problem.simulation.steps, parameters.phases.at(ca.DM(np.arange(problem.simulation.steps)).T)
    u = ca.vertcat(ca.MX.zeros(inputs_size(world, inputs) - scheduled.shape[0], steps), scheduled)
    # Values of z take their places; those of single recordings come last.
    places = zip(problem.variables, spans(problem.variables), strict=True)
    parts = [(variable, z[first:last]) for variable, (first, last) in places]
    measured = initial
    for variable, part in sorted(parts, key=lambda each: each[0].each):
        if variable.each and measured is initial:
            initial = dict(measured)
        if variable.kind == "recording" or variable.name in excluded:  # the first is how a motion was measured
            continue
        if variable.kind == "control":
            u = u + _spread_inputs(problem, variable, input_columns(world, inputs), part)
            continue
        if variable.kind == "duration":
            physical[STEP_LENGTH] = part / steps
            continue
        values = initial if variable.kind == "initial" else physical
        for slot in variable.slots:
            values[slot.name] = _replace(values[slot.name], slot.components, part)
    # Unit quaternions, then bodies carried along by joints and moved parameters.
    varied = {slot.name for variable in problem.variables for slot in variable.slots}
    initial |= {name: _unit(initial[name]) for name in varied if name.endswith(".orientation")}
    if measured is not initial:
        initial = carried(problem.parametric, own_bodies(problem), measured, initial)
    begun = {name: initial.pop(name) for name in starts}
    initial = begin(problem.parametric, {name: begun[name] for name in starts if name in varied}, initial)
    for name in winding:
        if (start := f"{name}.start") in varied:
            initial[f"{name}.{UNWRAPPED}"] += begun[start] - ca.DM(starts[start])
    placed = {name: physical[name] for name in placing(sorted(varied & physical.keys()))}
    initial = reposition(problem.parametric, placed, initial)
    return RolloutStart(initial_state(world, initial), u, ca.vertcat(ca.MX(0, 1), *physical.values()))


def own_bodies(problem: Problem) -> list[str]:
    """Return the bodies whose initial states are variables of each recording."""
    slots = [slot.name for variable in problem.variables if variable.each for slot in variable.slots]
    return list(dict.fromkeys(name.rpartition(".")[0] for name in slots if name in problem.initial))


def _replace(value: Expr, components: Sequence[int], part: Expr) -> Expr:
    """Return ``value`` with the named components taken from ``part``."""
    if list(components) == list(range(value.shape[0])):
        return part
    rows = [value[i] for i in range(value.shape[0])]
    for k, component in enumerate(components):
        rows[component] = part[k]
    return ca.vertcat(*rows)


def _unit(q: Expr) -> Expr:
    """Normalise a quaternion: solvers vary its four numbers freely."""
    return q / ca.norm_2(q)


def _spread_inputs(problem: Problem, variable: Variable, columns: Mapping[str, slice], part: Expr) -> Expr:
    """Return (nu, N) a control's knots as inputs of every step, in the rows that its slots name."""
    count = variable.guess.size // variable.knots
    place = ca.DM(max(column.stop for column in columns.values()), count)
    for slot in variable.slots:
        for k, component in enumerate(slot.components):
            place[columns[slot.name].start + component, k] = 1
    knots = ca.reshape(part, count, variable.knots)
    weights = knot_weights(variable.knots, problem.simulation.steps, variable.interpolation)
    return ca.mtimes(ca.mtimes(place, knots), weights)


def knot_weights(knots: int, steps: int, interpolation: str) -> Expr:
    """Return (knots, steps) sparse: the weight of each knot in each step: its mean over the step.

    "constant": the horizon is cut into equal parts, one a knot. "linear": knots lie at equal distances from the
    start to the end of the horizon, values between them are interpolated. So an input gives the impulse that its
    knots say, wherever these lie within steps.
    """
    if interpolation == "constant" or knots == 1:
        width, integral = knots, _of_step
    else:
        width, integral = knots - 1, _of_hat
    edges = np.arange(steps + 1) * width / steps
    start, end = edges[:-1], edges[1:]
    first, rows, columns, values = np.floor(start).astype(int), list[Ints](), list[Ints](), list[Array]()
    for k in range(int(np.ceil(width / steps)) + 2):
        row = first + k
        share = (integral(end - row) - integral(start - row)) / (end - start)
        some = np.flatnonzero((row < knots) & (share > MIN_KNOT_SHARE))
        rows.append(row[some])
        columns.append(some)
        values.append(share[some])
    acting, at = (np.concatenate(each).tolist() for each in (rows, columns))
    return ca.DM.triplet(acting, at, ca.DM(np.concatenate(values)), knots, steps)


def _of_step(place: Array) -> Array:
    """Return the integral up to a place of what is 1 from 0 to 1."""
    return np.clip(place, 0.0, 1.0)


def _of_hat(place: Array) -> Array:
    """Return the integral up to a place of what rises from -1 to 0 and falls from 0 to 1."""
    left, right = np.clip(place, -1.0, 0.0) + 1, np.clip(place, 0.0, 1.0)
    return left * left / 2 + right - right * right / 2
