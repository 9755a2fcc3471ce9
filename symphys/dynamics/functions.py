"""The step as casadi functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import casadi as ca

from symphys.dynamics.context import Scene, State, make_scene
from symphys.dynamics.step import report, take_step
from symphys.dynamics.tracing.dead_code import trimmed
from symphys.dynamics.tracing.recording import Piece, Recorder, Slot
from symphys.dynamics.tracing.trace import Inline
from symphys.model.state_layout import Layout, inputs_size
from symphys.model.world import Scheme, World

Expr = Any
"""casadi SX, MX or DM"""

MOST_INSTRUCTIONS = 100_000
"""Of a step in which what several parts compute alike is looked for: that saves a tenth, but takes its time."""


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
    """
    arguments, scene, x = _flat(world, scheme, inputs, parameters)
    after = _packed(scene, take_step(scene, x)[0])
    step = ca.Function("step", arguments, [after], ["x", "u", "p", "smoothing"], ["x_next"])
    if step.n_instructions() > MOST_INSTRUCTIONS:
        return step
    return ca.Function("step", arguments, [ca.cse(after)], ["x", "u", "p", "smoothing"], ["x_next"])


def report_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """The same step with all of its ``Report``: (x, u, p, smoothing) -> (x_next, forces, gaps, .. paradox)."""
    arguments, scene, x = _flat(world, scheme, inputs, parameters)
    after, phases = take_step(scene, x)
    r = report(scene, phases)
    told = {field.name: scene.pieces.value(getattr(r, field.name)) for field in fields(r)}
    outputs, names = [_packed(scene, after), *told.values()], ["x_next", *told]
    return ca.Function("report", arguments, outputs, ["x", "u", "p", "smoothing"], names)


@dataclass(frozen=True)
class Recording:
    """One time step as pieces.

    Attributes:
        pieces: in the order in which they are computed.
        results: which columns of the next state each slot named "next" holds.
    """

    pieces: tuple[Piece, ...]
    results: Mapping[Slot, slice]


def record_step(
    world: World,
    scheme: Scheme | None = None,
    inputs: Sequence[str] = (),
    parameters: Sequence[Any] = (),
    exact: bool = False,
) -> Recording:
    """The step of ``step_function`` in pieces; their named slots are the parts of x, and "u", "p" and "smoothing".

    ``exact`` is the step at smoothing 0 only: what the knob would add is left out.
    """
    (x, u, p, knob), layout, recorder = arguments_of(world, inputs, parameters), Layout(world), Recorder()
    for name, symbols in (("u", u), ("p", p), ("smoothing", knob), *parts_of(layout, x).items()):
        recorder.argument(name, symbols)
    scene = make_scene(world, scheme, tuple(inputs), u, ca.SX(0) if exact else knob, recorder)
    after, _ = take_step(scene, parts_of(layout, x))
    owners: dict[str, list[str]] = {}
    for name in layout.names():
        owners.setdefault(name.rpartition(".")[0], []).append(name)
    results = {}
    for names in owners.values():
        slot = recorder.give("next", [after[name] for name in names])
        results[slot] = slice(layout[names[0]].start, layout[names[-1]].stop)
    return Recording(trimmed(recorder.pieces), results)


def _flat(
    world: World, scheme: Scheme | None, inputs: Sequence[str], parameters: Sequence[Any]
) -> tuple[list[Expr], Scene, State]:
    """The step's arguments, the scene of a step as one expression, and x in parts."""
    arguments = arguments_of(world, inputs, parameters)
    x, u, _, knob = arguments
    scene = make_scene(world, scheme, tuple(inputs), u, knob, inline(world, arguments))
    return arguments, scene, parts_of(Layout(world), x)


def inline(world: World, arguments: Sequence[Expr]) -> Inline:
    """Pieces that know x, u, p and smoothing; x by its parts, so that bodies alike share what they compute."""
    (x, *others), pieces = arguments, Inline()
    for column in (*parts_of(Layout(world), x).values(), *others):
        pieces.take(column)
    return pieces


def _packed(scene: Scene, x: State) -> Expr:
    return Layout(scene.world).pack({name: scene.pieces.value(part) for name, part in x.items()})


def parts_of(layout: Layout, x: Expr) -> State:
    """The state's parts by name."""
    return {name: x[layout[name]] for name in layout.names()}


def arguments_of(world: World, inputs: Sequence[str], parameters: Sequence[Any]) -> list[Expr]:
    """Symbols for x, u, p and smoothing."""
    x = ca.SX.sym("x", Layout(world).size)
    u = ca.SX.sym("u", inputs_size(world, inputs))
    return [x, u, ca.vertcat(ca.SX(0, 1), *parameters), ca.SX.sym("smoothing")]
