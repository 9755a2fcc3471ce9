"""The step as a table of contents, and as casadi functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys import rotation
from symphys.collide import collide
from symphys.motion import BodyState, Motion, angular_velocity, free_motion, momentum
from symphys.smooth import TINY_SQUARE
from symphys.state import Layout
from symphys.step.pgs import ZERO, Impulse, Momenta, give, sweep
from symphys.step.position import displacements, push_apart
from symphys.step.rows import ContactRow, prepare
from symphys.world import Scheme, World

Expr = Any
"""casadi SX, MX or DM"""

INPUT_FIELDS = ("force", "torque")
SLOWEST = 1.0
"""[m/s^2] least reference acceleration: what counts as fast when there is no gravity."""


@dataclass(frozen=True)
class StepResult:
    """One step's new state and what happened in it; impulses in the order of the world's pairs.

    Attributes:
        x: the next state.
        forces: (3 * pairs,) impulse / dt on each pair's first body [N], world frame.
        gaps: (pairs,) at the start of the step [m].
        residual: largest change of a normal or friction impulse in the last sweep [N s].
        crowded: 1 if some body has two or more impacts in this step, else 0.
    """

    x: Expr
    forces: Expr
    gaps: Expr
    residual: Expr
    crowded: Expr


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
    result = take_step(world, scheme or Scheme(), inputs, x, u, knob)
    return ca.Function("step", [x, u, p, knob], [ca.cse(result.x)], ["x", "u", "p", "smoothing"], ["x_next"])


def report_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """The same step with all of ``StepResult``: (x, u, p, smoothing) -> (x_next, forces, gaps, residual, crowded)."""
    x, u, p, knob = _arguments(world, inputs, parameters)
    r = take_step(world, scheme or Scheme(), inputs, x, u, knob)
    names = ["x_next", "forces", "gaps", "residual", "crowded"]
    outputs = [r.x, r.forces, r.gaps, r.residual, r.crowded]
    return ca.Function("report", [x, u, p, knob], outputs, ["x", "u", "p", "smoothing"], names)


def take_step(world: World, scheme: Scheme, inputs: Sequence[str], x: Expr, u: Expr, knob: Expr) -> StepResult:
    """The expression of one step."""
    layout = Layout(world)
    kick = scheme.dt / 2 + x[layout["lag"]]

    # free motion, in which impacts find their instant
    gravity = ca.vertcat(*world.gravity)
    motions = _motions(world, scheme, layout, inputs, x, u)

    # rows: where, when and how the surfaces meet
    reference = ca.fmax(ca.sqrt(ca.dot(gravity, gravity) + TINY_SQUARE), SLOWEST)
    rows = [prepare(collide(world, pair, motions), motions, scheme, reference, knob) for pair in world.pairs]

    # velocities: warm start, then sweeps
    momenta = Momenta([m.mid_velocity for m in motions], [m.mid_momentum for m in motions])
    impulses = last = _warm_start(world, scheme, layout, rows, x, kick)
    for row, impulse in zip(rows, impulses, strict=True):
        give(row, momenta, impulse)
    for _ in range(scheme.sweeps):
        last, impulses = impulses, sweep(rows, momenta, impulses)

    # positions
    shifts = push_apart(rows, displacements(rows, impulses, momenta, motions, scheme), scheme)

    # the next state
    values: dict[str, Any] = {"lag": ca.SX(scheme.dt / 2)}
    resting = _store_forces(world, scheme, rows, impulses, kick, values)
    for i, motion in enumerate(motions):
        _store_body(motion, momenta.velocity[i], momenta.angular[i], shifts[i], resting[i], values)
    return StepResult(layout.pack(values), *_report(scheme, rows, impulses, last))


def _arguments(world: World, inputs: Sequence[str], parameters: Sequence[Any]) -> tuple[Expr, Expr, Expr, Expr]:
    known = {f"{body.name}.{field}" for body in world.bodies for field in INPUT_FIELDS}
    for name in inputs:
        if name not in known:
            raise KeyError(f"no input is called {name!r}; there are {', '.join(sorted(known))}")
    x = ca.SX.sym("x", Layout(world).size)
    u = ca.SX.sym("u", 3 * len(inputs))
    return x, u, ca.vertcat(ca.SX(0, 1), *parameters), ca.SX.sym("smoothing")


def _motions(world: World, scheme: Scheme, layout: Layout, inputs: Sequence[str], x: Expr, u: Expr) -> list[Motion]:
    """Each body's free motion; the stored velocities are freed from the last half step's persistent forces."""
    applied = {name: u[3 * i : 3 * i + 3] for i, name in enumerate(inputs)}
    zero, lag = ca.SX.zeros(3), x[layout["lag"]]
    motions = []
    for body in world.bodies:
        part = {name: x[layout[f"{body.name}.{name}"]] for name in _BODY_PARTS}
        turning = momentum(body, part["orientation"], part["angular_velocity"])
        state = BodyState(
            position=part["position"],
            orientation=part["orientation"],
            velocity=part["velocity"] - lag * part["reaction_force"] / body.mass,
            angular_momentum=turning - lag * part["reaction_torque"],
            force=applied.get(f"{body.name}.force", zero),
            torque=applied.get(f"{body.name}.torque", zero),
        )
        motions.append(free_motion(body, state, ca.vertcat(*world.gravity), scheme.dt))
    return motions


_BODY_PARTS = ("position", "orientation", "velocity", "angular_velocity", "reaction_force", "reaction_torque")


def _warm_start(
    world: World, scheme: Scheme, layout: Layout, rows: Sequence[ContactRow], x: Expr, kick: Expr
) -> list[Impulse]:
    """The last step's persistent forces, over this step's kick, in this step's frames."""
    if not scheme.warm_start:
        return [ZERO for _ in rows]
    impulses = []
    for pair, row in zip(world.pairs, rows, strict=True):
        n = row.impulse_normal
        normal, tangent = _split(kick * x[layout[f"{pair.name}.force"]], n)
        spin, roll = ZERO.spin, ZERO.roll
        if pair.law.spins:
            torque = kick * x[layout[f"{pair.name}.torque"]]
            spin, roll = ca.dot(n, torque), torque - n * ca.dot(n, torque)
        impulses.append(Impulse(normal, tangent, spin, roll))
    return impulses


def _split(impulse: Expr, n: Expr) -> tuple[Expr, Expr]:
    along = ca.dot(n, impulse)
    return ca.fmax(along, 0), impulse - n * along


def _store_forces(
    world: World,
    scheme: Scheme,
    rows: Sequence[ContactRow],
    impulses: Sequence[Impulse],
    kick: Expr,
    values: dict[str, Any],
) -> list[tuple[Expr, Expr]]:
    """Persistent contact forces (impacts left out) into ``values``; returns their sum on each body."""
    total = [(ca.SX.zeros(3), ca.SX.zeros(3)) for _ in world.bodies]
    for pair, row, impulse in zip(world.pairs, rows, impulses, strict=True):
        share = (1 - row.leaving) / kick
        force, torque = share * impulse.linear(row.impulse_normal), share * impulse.angular(row.impulse_normal)
        values[f"{pair.name}.force"] = force if scheme.warm_start else ca.SX.zeros(3)
        if pair.law.spins:
            values[f"{pair.name}.torque"] = torque if scheme.warm_start else ca.SX.zeros(3)
        for side in row.sides:
            f, t = total[side.body]
            total[side.body] = (f + side.sign * force, t + side.sign * (ca.cross(side.impulse_arm, force) + torque))
    return total


def _store_body(
    motion: Motion, velocity: Expr, angular: Expr, shift: Any, resting: tuple[Expr, Expr], values: dict[str, Any]
) -> None:
    """The body's pose and true velocities at the end of the step."""
    body, half, (force, torque) = motion.body, motion.dt / 2, resting
    orientation = rotation.turn(motion.orientation, shift.angular)
    end_momentum = angular + half * (motion.torque + torque)
    values[f"{body.name}.position"] = motion.position + shift.linear
    values[f"{body.name}.orientation"] = orientation
    values[f"{body.name}.velocity"] = velocity + half * (motion.acceleration + force / body.mass)
    values[f"{body.name}.angular_velocity"] = angular_velocity(body, orientation, end_momentum)
    values[f"{body.name}.reaction_force"] = force
    values[f"{body.name}.reaction_torque"] = torque


def _report(
    scheme: Scheme, rows: Sequence[ContactRow], impulses: Sequence[Impulse], last: Sequence[Impulse]
) -> tuple[Expr, Expr, Expr, Expr]:
    """(forces, gaps, residual, crowded) of ``StepResult``."""
    forces = [impulse.linear(row.impulse_normal) / scheme.dt for row, impulse in zip(rows, impulses, strict=True)]
    residual: Expr = ca.SX(0)
    counts: dict[int, Expr] = {}
    for row, new, old in zip(rows, impulses, last, strict=True):
        change = new.minus(old)
        residual = ca.fmax(residual, ca.fmax(ca.fabs(change.normal), ca.norm_inf(change.tangent)))
        for side in row.sides:
            counts[side.body] = counts.get(side.body, 0) + (row.leaving > 0)
    crowded = ca.SX(0)
    for count in counts.values():
        crowded = ca.fmax(crowded, count >= 2)
    gaps = ca.vertcat(ca.SX(0, 1), *(row.contact.gap for row in rows))
    return ca.vertcat(ca.SX(0, 1), *forces), gaps, residual, crowded
