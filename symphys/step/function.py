"""The step as casadi functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.state import Layout
from symphys.step.record import Piece, Recorder, Slot
from symphys.step.scene import Scene
from symphys.step.whole import take_step
from symphys.world import Scheme, World

Expr = Any
"""casadi SX, MX or DM"""

INPUT_FIELDS = ("force", "torque")


def step_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """One time step as a casadi function (x, u, p, smoothing) -> x_next; no branches, all derivatives finite.

    Args:
        world: bodies, planes, pairs; its numbers may be SX symbols listed in ``parameters``.
        scheme: time step, sweeps and switches.
        inputs: names such as ``ball.force`` [N] or ``ball.torque`` [N m] (world frame, at the centre of mass),
            constant over the step; u stacks them, 3 each.
        parameters: the SX symbols that p stacks.

    Returns:
        A function of x (see ``Layout``), u, p and smoothing [m/s] >= 0, where 0 is the exact step.
    """
    x, u, p, knob = _arguments(world, inputs, parameters)
    result = take_step(Scene(world, scheme or Scheme(), Layout(world), tuple(inputs), u, knob), x)
    return ca.Function("step", [x, u, p, knob], [ca.cse(result.x)], ["x", "u", "p", "smoothing"], ["x_next"])


def report_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """The same step with all of ``StepResult``: (x, u, p, smoothing) -> (x_next, forces, gaps, residual, crowded)."""
    x, u, p, knob = _arguments(world, inputs, parameters)
    r = take_step(Scene(world, scheme or Scheme(), Layout(world), tuple(inputs), u, knob), x)
    names = ["x_next", "forces", "gaps", "residual", "crowded"]
    outputs = [r.x, r.forces, r.gaps, r.residual, r.crowded]
    return ca.Function("report", [x, u, p, knob], outputs, ["x", "u", "p", "smoothing"], names)


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
    _, u, p, knob = _arguments(world, inputs, parameters)
    layout, recorder = Layout(world), Recorder()
    for name, symbols in (("u", u), ("p", p), ("smoothing", knob)):
        recorder.take(name, symbols)
    x = layout.pack({name: recorder.argument(name, layout[name].stop - layout[name].start) for name in layout.names()})
    smoothing = ca.SX(0) if exact else knob
    scene = Scene(world, scheme or Scheme(), layout, tuple(inputs), u, smoothing, recorder.keep, recorder.repeat)
    after = take_step(scene, x).x
    owners: dict[str, list[slice]] = {}
    for name in layout.names():
        owners.setdefault(name.rpartition(".")[0], []).append(layout[name])
    columns = [slice(slices[0].start, slices[-1].stop) for slices in owners.values()]
    results = {recorder.give("next", after[part]): part for part in columns}
    return Recording(tuple(recorder.pieces), results)


def _arguments(world: World, inputs: Sequence[str], parameters: Sequence[Any]) -> tuple[Expr, Expr, Expr, Expr]:
    known = {f"{body.name}.{field}" for body in world.bodies for field in INPUT_FIELDS}
    for name in inputs:
        if name not in known:
            raise KeyError(f"no input is called {name!r}; there are {', '.join(sorted(known))}")
    x = ca.SX.sym("x", Layout(world).size)
    u = ca.SX.sym("u", 3 * len(inputs))
    return x, u, ca.vertcat(ca.SX(0, 1), *parameters), ca.SX.sym("smoothing")
