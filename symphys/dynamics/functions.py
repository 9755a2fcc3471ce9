"""The step as casadi functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from itertools import combinations
from typing import Any

import casadi as ca

from symphys.dynamics.arguments import arguments_of, context_of, inline, parts_of
from symphys.dynamics.contact.constraint import ContactConstraint, ContactImpulse
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.joints.joint_impulse import JointImpulse
from symphys.dynamics.step import take_step
from symphys.dynamics.substep import Substep
from symphys.dynamics.tracing.decorator import traced, tracing
from symphys.dynamics.tracing.guards import with_guards
from symphys.dynamics.tracing.numbers import with_known_numbers
from symphys.dynamics.tracing.recording import Recorder, TracedCall, TracedVector, without_dead_code
from symphys.dynamics.tracing.trace import InlineTracer
from symphys.dynamics.unknowns import AnyImpulse
from symphys.maths.verbatim import verbatim
from symphys.model.scalar import is_zero
from symphys.model.state_layout import Layout, force_names
from symphys.model.world import Pair, Scheme, World
from symphys.records import dataclass
from symphys.types import Expr

ARGUMENTS = "x", "u", "p", "smoothing"
"""What the arguments of a step are called."""
MAX_REDUCED_INSTRUCTIONS = 105_000
"""Instructions of a step up to which common subexpressions are eliminated: that saves a tenth, but takes its time."""
PAIRS_PER_CALL = 32
"""Pairs whose forces one call hands on to the next state, in worlds of many pairs: most are 0."""
MAX_ORTHOGONAL_COSINE = 1e-3
"""Cosine of normals up to which two impacts of a body do not act on each other."""


@dataclass(frozen=True)
class StepReport:
    """Report of a step; forces and gaps in the order of the world's pairs.

    Attributes:
        forces: (3 * pairs,) impulse / dt on each pair's first body [N], world frame.
        gaps: (pairs,) at the start of the step [m].
        residual: largest change of a normal or friction impulse in a last sweep [N s].
        crowded: 1 if some body has two or more impacts at once (in one substep), or impacts of a chain come late.
        ambiguous: 1 if several bodies meet at one instant and rebound: rigid bodies have no one answer then.
        paradox: 1 if friction pulls a sliding contact together, for which no sliding force may exist (Painleve).
        along: (k,) impulses of motors, springs and dry friction along coordinates [N m s], [N s]; see ``force_names``.
        motors: (m,) those of motors, as if a command acted from half a substep before its step to half a substep before
            the next.
    """

    forces: Expr
    gaps: Expr
    residual: Expr
    crowded: Expr
    ambiguous: Expr
    paradox: Expr
    along: Expr
    motors: Expr


def report(context: StepContext, substeps: list[Substep]) -> StepReport:
    """Collect what happened in a step from its substeps."""
    dt, forces = context.settings.scheme.dt, tuple(ca.SX.zeros(3) for _ in context.world.pairs)
    residual, crowded, ambiguous, paradox = ca.SX(0), ca.SX(0), ca.SX(0), ca.SX(0)
    for substep in substeps:
        given = zip(forces, substep.constraints, substep.impulses, strict=True)
        forces = tuple(_subtract_force(force, each.constraint, impulse, dt) for force, each, impulse in given)
        if substep.ahead:
            forces = tuple(force + ahead / dt for force, ahead in zip(forces, substep.ahead, strict=True))
        for new, old in substep.changes:
            residual = _larger_change(residual, new, old)
        impacts = tuple((each.bodies, each.constraint.struck, each.constraint.leaving) for each in substep.constraints)
        crowded = _crowded(_larger(crowded, substep.chained), impacts)
        for contacts in _simultaneous(context.world, substep):
            ambiguous = _ambiguous(ambiguous, contacts)
        for each, impulse in zip(substep.constraints, substep.impulses, strict=True):
            paradox = _any_paradox(paradox, each.constraint.paradox, impulse.normal)
    gaps = tuple(contact.gap for contact in substeps[0].contacts)
    along = tuple(_sum(tuple(each.by_joints[name] for each in substeps)) for name, _ in force_names(context.world))
    driven = (f"{joint.name}.motor" for joint in context.world.joints if joint.driven)
    motors = tuple(_sum(tuple(each.of_motors[name] for each in substeps)) for name in driven)
    counted = _stack(along), _stack(motors)
    return StepReport(_stack(forces), _stack(gaps), residual, crowded, ambiguous, paradox, *counted)


@traced
def _sum(columns: tuple[Expr, ...]) -> Expr:
    return sum(columns[1:], start=columns[0])


Met = tuple[Expr, Expr, Expr]
"""Normal (3,), normal impulse, whether the surfaces meet at speed."""


def _simultaneous(world: World, substep: Substep) -> list[tuple[Met, Met]]:
    """Return the contacts of one body with two others, two by two, of which one rebounds."""
    of: dict[int, list[int]] = {}
    for k, each in enumerate(substep.constraints):
        for body in each.bodies:
            of.setdefault(body, []).append(k)
    found = []
    for body, constraints in of.items():
        for i, j in combinations(constraints, 2):
            one, other = world.pairs[i], world.pairs[j]
            apart = _partner(one, body) != _partner(other, body)
            if apart and not (is_zero(one.law.restitution) and is_zero(other.law.restitution)):
                a, b = ((substep.constraints[k].constraint, substep.impulses[k].normal) for k in (i, j))
                found.append(((a[0].normal, a[1], a[0].struck), (b[0].normal, b[1], b[0].struck)))
    return found


def _partner(pair: Pair, body: int) -> tuple[int | None, int]:
    other = pair.second if pair.first.body == body else pair.first
    return (other.body, 0) if other.body is not None else (None, other.shape)


@traced
def _ambiguous(before: Expr, met: tuple[Met, Met]) -> Expr:
    """Return 1 if both give an impulse at one instant, one of them as an impact, and each changes the other."""
    (n, press, struck), (other, also, hit) = met
    both = ca.logic_and(ca.logic_and(press > 0, also > 0), ca.logic_or(struck, hit))
    return ca.fmax(before, ca.logic_and(both, ca.fabs(ca.dot(n, other)) > MAX_ORTHOGONAL_COSINE))


@traced
def _any_paradox(before: Expr, paradox: Expr, press: Expr) -> Expr:
    return ca.fmax(before, ca.logic_and(paradox, press > 0))


@traced
def _subtract_force(force: Expr, constraint: ContactConstraint, impulse: ContactImpulse, dt: Expr) -> Expr:
    return force + impulse.linear(constraint.impulse_normal) / dt


@traced
def _stack(columns: tuple[Expr, ...]) -> Expr:
    return ca.densify(ca.vertcat(ca.SX(0, 1), *columns))


@traced
def _larger_change(residual: Expr, new: AnyImpulse, old: AnyImpulse) -> Expr:
    change = new.minus(old)
    if isinstance(change, JointImpulse):
        return ca.fmax(residual, ca.norm_inf(change.numbers))
    return ca.fmax(residual, ca.fmax(ca.fabs(change.normal), ca.norm_inf(change.tangent)))


@traced
def _larger(one: Expr, other: Expr) -> Expr:
    return ca.fmax(one, other)


@traced
def _crowded(before: Expr, constraints: tuple[tuple[tuple[int, ...], Expr, Expr], ...]) -> Expr:
    """Return 1 if some body has two or more impacts in this substep, or had before."""
    counts: dict[int, Expr] = {}
    for bodies, struck, leaving in constraints:
        for body in bodies:
            counts[body] = counts.get(body, 0) + ca.fmax(struck, leaving > 0)
    result = before
    for count in counts.values():
        result = ca.fmax(result, count >= 2)
    return result


def step_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """Return one time step as a casadi function (x, u, p, smoothing) -> x_next; no branches, all derivatives finite.

    Args:
        world: bodies, planes, pairs; its numbers may be SX symbols listed in ``parameters``.
        scheme: time step, sweeps and switches.
        inputs: names such as ``ball.force`` [N] or ``ball.torque`` [N m] (world frame, at the centre of mass),
            or ``knee.command`` of a motor, constant over the step; u stacks them.
        parameters: the SX symbols that p stacks.

    Returns:
        A function of x (see ``Layout``), u, p and smoothing [m/s] >= 0, where 0 is the exact step.

    Example:
        >>> from symphys import step_function
        >>> from symphys.model import Body, Layout, Plane, Scheme, initial_state, make_world
        >>> world = make_world([Body.ball("ball", radius=0.1, mass=0.5, position=(0, 0, 1))], [Plane.ground()])
        >>> step = step_function(world, Scheme(dt=0.01), ["ball.force"])
        >>> x = step(initial_state(world), [0.5, 0, 0], [], 0)
        >>> round(float(x[Layout(world)["ball.velocity"]][0]), 12)
        0.01
    """
    arguments, layout = arguments_of(world, inputs, parameters), Layout(world)
    tracer = inline(world, arguments)
    with tracing(tracer):
        after, _ = take_step(context_of(world, scheme, inputs, arguments), parts_of(layout, arguments[0]))
    packed = _packed(layout, tracer, after)
    step = ca.Function("step", arguments, [packed], list(ARGUMENTS), ["x_next"])
    if step.n_instructions() > MAX_REDUCED_INSTRUCTIONS:
        return step
    with verbatim():
        packed = ca.cse(packed)
    return ca.Function("step", arguments, [packed], list(ARGUMENTS), ["x_next"])


def report_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """Return the step with its ``StepReport``: (x, u, p, smoothing) -> (x_next, forces, gaps, .. motors).

    It is a graph of the calls of ``trace_step``: one expression would take twice as long to build and ten times as much
    space where it is kept, for 0.6 of the time of an evaluation.
    """
    arguments, layout = arguments_of(world, inputs, parameters), Layout(world)
    recorder = _recorder(layout, arguments)
    with tracing(recorder):
        context = context_of(world, scheme, inputs, arguments)
        after, substeps = take_step(context, parts_of(layout, arguments[0]))
        found = report(context, substeps)
    reported = {field.name: [getattr(found, field.name)] for field in fields(found)}
    reported = {"x_next": [after[name] for name in layout.names()], **reported}
    results = [recorder.give(name, values) for name, values in reported.items()]
    columns = {name: ca.MX.sym(name, each.numel()) for name, each in zip(ARGUMENTS, arguments, strict=True)}
    known = {name: column for name, column in columns.items() if name != "x"} | parts_of(layout, columns["x"])
    values = {number: known[name] for name, number in recorder.named.items()}
    for call in recorder.calls:
        given = call.function.call([values[slot.number] for slot in call.inputs])
        values |= zip((slot.number for slot in call.outputs), given, strict=True)
    outputs = [values[slot.number] for slot in results]
    return ca.Function("report", [*columns.values()], outputs, list(ARGUMENTS), list(reported))


@dataclass(frozen=True)
class TracedStep:
    """One time step as calls.

    Attributes:
        calls: in the order in which they are computed.
        results: which columns of the next state each slot named "next" holds.
    """

    calls: tuple[TracedCall, ...]
    results: Mapping[TracedVector, slice]


def trace_step(
    world: World,
    scheme: Scheme | None = None,
    inputs: Sequence[str] = (),
    parameters: Sequence[Any] = (),
    exact: bool = False,
) -> TracedStep:
    """Return the step of ``step_function`` in calls; named slots are the parts of x, "u", "p" and "smoothing".

    ``exact`` is the step at smoothing 0 only: what the smoothing would add is left out.
    """
    arguments, layout = arguments_of(world, inputs, parameters), Layout(world)
    x, u, p, smoothing = arguments
    recorder = _recorder(layout, arguments)
    with tracing(recorder):
        context = context_of(world, scheme, inputs, [x, u, p, ca.SX(0) if exact else smoothing])
        after, _ = take_step(context, parts_of(layout, x))
    owners: dict[str, list[str]] = {}
    for name in layout.names():
        owners.setdefault(name.rpartition(".")[0], []).append(name)
    results = {}
    for names in _together(world, owners, bool(recorder.guards)):
        slot = recorder.give("next", [after[name] for name in names])
        results[slot] = slice(layout[names[0]].start, layout[names[-1]].stop)
    calls = without_dead_code(with_known_numbers(recorder.calls))
    return TracedStep(with_guards(calls, recorder.guards, recorder.sections), results)


def _recorder(layout: Layout, arguments: Sequence[Expr]) -> Recorder:
    """Return a recorder that knows the ``ARGUMENTS`` of a step, and the parts of x by name."""
    (x, *others), recorder = arguments, Recorder()
    for name, symbols in (*zip(ARGUMENTS[1:], others, strict=True), *parts_of(layout, x).items()):
        recorder.argument(name, symbols)
    return recorder


def _together(world: World, owners: Mapping[str, list[str]], many: bool) -> list[list[str]]:
    """Return the names of parts of the next state that one call writes: of an owner, or of ``many`` pairs."""
    pairs = {pair.name for pair in world.pairs} if many else set()
    found: list[list[str]] = []
    room = 0
    for owner, names in owners.items():
        if owner in pairs and room:
            found[-1] += names
        else:
            found.append(list(names))
            room = PAIRS_PER_CALL if owner in pairs else 0
        room = max(room - 1, 0)
    return found


def _packed(layout: Layout, tracer: InlineTracer, x: State) -> Expr:
    return layout.pack({name: tracer.value(part) for name, part in x.items()})


def roll_out(step: ca.Function, steps: int, x0: Expr, u: Expr, p: Expr, smoothing: Expr) -> tuple[Expr, ...]:
    """Take ``steps`` steps from x0; the inputs change with each, parameters and smoothing do not.

    Args:
        step: a function (x, u, p, smoothing) -> (x_next, ...).
        steps: how many, N.
        x0: (nx,) the state at t = 0.
        u: (nu, N) inputs of each step.
        p: (np,) parameters.
        smoothing: scalar [m/s].

    Returns:
        The states (nx, N + 1) that include x0, then each further output of ``step``, N columns of them.

    Example:
        >>> from symphys import step_function
        >>> from symphys.dynamics.functions import roll_out
        >>> from symphys.model import Body, Layout, Plane, initial_state, make_world
        >>> world = make_world([Body.ball("ball", radius=0.1, mass=0.5, position=(0, 0, 1))], [Plane.ground()])
        >>> (x,) = roll_out(step_function(world), 100, initial_state(world), [], [], 0)
        >>> x[Layout(world)["ball.position"], :].shape  # expressions, in any casadi problem
        (3, 101)
    """
    whole = {"base": -1}  # all steps side by side: nested groups of steps take longer to build and to differentiate
    horizon = step.mapaccum(f"{step.name()}_{steps}", steps, whole)
    outputs: Any = horizon(x0, u, ca.repmat(p, 1, steps), ca.repmat(ca.MX(smoothing), 1, steps))
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    return (ca.horzcat(x0, outputs[0]), *outputs[1:])
