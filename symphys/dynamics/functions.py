"""The step as casadi functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import casadi as ca

from symphys.dynamics.arguments import arguments_of, context_of, inline, parts_of
from symphys.dynamics.context import State
from symphys.dynamics.step import take_step
from symphys.dynamics.step_report import report
from symphys.dynamics.tracing.dead_code import without_dead_code
from symphys.dynamics.tracing.decorator import tracing
from symphys.dynamics.tracing.guards import with_guards
from symphys.dynamics.tracing.recording import Recorder, TracedCall, TracedVector
from symphys.dynamics.tracing.trace import InlineTracer
from symphys.maths.verbatim import verbatim
from symphys.model.state_layout import Layout
from symphys.model.world import Scheme, World
from symphys.types import Expr

MOST_INSTRUCTIONS = 105_000
"""Of a step in which what several parts compute alike is looked for: that saves a tenth, but takes its time."""


PAIRS_TOGETHER = 32
"""Pairs whose forces one call hands on to the next state, in worlds of many pairs: most are 0."""


def step_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """One time step as a casadi function (x, u, p, smoothing) -> x_next; no branches, all derivatives finite.

    Args:
        world: bodies, planes, pairs; its numbers may be SX symbols listed in ``parameters``.
        scheme: time step, sweeps and switches.
        inputs: names such as ``ball.force`` [N] or ``ball.torque`` [N m] (world frame, at the centre of mass),
            or ``knee.command`` of a motor, constant over the step; u stacks them.
        parameters: the SX symbols that p stacks.

    Returns:
        A function of x (see ``Layout``), u, p and smoothing [m/s] >= 0, where 0 is the exact step.

    Example:
        >>> from symphys import Body, Layout, Plane, Scheme, initial_state, make_world, step_function
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
    step = ca.Function("step", arguments, [packed], ["x", "u", "p", "smoothing"], ["x_next"])
    if step.n_instructions() > MOST_INSTRUCTIONS:
        return step
    with verbatim():
        packed = ca.cse(packed)
    return ca.Function("step", arguments, [packed], ["x", "u", "p", "smoothing"], ["x_next"])


def report_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """The same step with all of its ``StepReport``: (x, u, p, smoothing) -> (x_next, forces, gaps, .. paradox)."""
    arguments, layout = arguments_of(world, inputs, parameters), Layout(world)
    tracer = inline(world, arguments, reduces=False)
    with tracing(tracer):
        context = context_of(world, scheme, inputs, arguments)
        after, substeps = take_step(context, parts_of(layout, arguments[0]))
        found = report(context, substeps)
    reported = {field.name: tracer.value(getattr(found, field.name)) for field in fields(found)}
    outputs, names = [_packed(layout, tracer, after), *reported.values()], ["x_next", *reported]
    return ca.Function("report", arguments, outputs, ["x", "u", "p", "smoothing"], names)


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
    """The step of ``step_function`` in calls; their named slots are the parts of x, and "u", "p" and "smoothing".

    ``exact`` is the step at smoothing 0 only: what the smoothing would add is left out.
    """
    x, u, p, smoothing = arguments_of(world, inputs, parameters)
    layout, recorder = Layout(world), Recorder()
    for name, symbols in (("u", u), ("p", p), ("smoothing", smoothing), *parts_of(layout, x).items()):
        recorder.argument(name, symbols)
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
    return TracedStep(with_guards(without_dead_code(recorder.calls), recorder.guards, recorder.sections), results)


def _together(world: World, owners: Mapping[str, list[str]], many: bool) -> list[list[str]]:
    """The names of parts of the next state that one call writes: of each owner, or of several of ``many`` pairs."""
    pairs = {pair.name for pair in world.pairs} if many else set()
    found: list[list[str]] = []
    room = 0
    for owner, names in owners.items():
        if owner in pairs and room:
            found[-1] += names
        else:
            found.append(list(names))
            room = PAIRS_TOGETHER if owner in pairs else 0
        room = max(room - 1, 0)
    return found


def _packed(layout: Layout, tracer: InlineTracer, x: State) -> Expr:
    return layout.pack({name: tracer.value(part) for name, part in x.items()})
