"""A stretch of time within a step: free motion, rows, sweeps, positions, and what is stored at its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys import rotation
from symphys.collide import Contact, collide
from symphys.collide.contact import Shift
from symphys.motion import BodyState, Motion, angular_velocity, free_motion, momentum
from symphys.state import BODY_FIELDS
from symphys.step.pgs import ZERO, Impulse, Momenta, begin, relax
from symphys.step.position import displacements, push_apart
from symphys.step.row import ContactRow
from symphys.step.rows import prepare
from symphys.step.scene import Scene

Expr = Any
"""casadi SX, MX or DM"""

SHORTEST_KICK = 1 / 8
"""Of dt: impulses of a shorter stretch are stored as forces over this time; what an impact adds is no force."""


@dataclass(frozen=True)
class Phase:
    """A stretch that has been advanced; ``last`` are the impulses before the final sweep."""

    x: Expr
    rows: tuple[ContactRow, ...]
    impulses: tuple[Impulse, ...]
    last: tuple[Impulse, ...]


def look(scene: Scene, motions: Sequence[Motion]) -> list[Contact]:
    """The contacts on the way."""
    return [scene.keep(collide(scene.world, pair, motions)) for pair in scene.world.pairs]


def advance(scene: Scene, x: Expr, duration: Expr, spared: Sequence[Expr] = ()) -> Phase:
    """The state after ``duration`` [s]; pairs whose ``spared`` is 1 give no impulse: the stretch ends as they meet."""
    scheme, kick = scene.scheme, duration / 2 + x[scene.layout["lag"]]

    # free motion, in which impacts find their instant
    motions = free_motions(scene, x, duration)
    contacts = look(scene, motions)

    # rows: where, when and how the surfaces meet
    rows = tuple(
        scene.keep(prepare(scene, c, motions, duration, off))
        for c, off in zip(contacts, spared or [0] * len(contacts), strict=True)
    )

    # velocities: warm start, then sweeps
    momenta = Momenta([m.mid_velocity for m in motions], [m.mid_momentum for m in motions])
    started = begin(scene.keep, rows, momenta, _warm_start(scene, rows, x, kick))
    momenta, impulses, last = relax(scene, rows, momenta, started)

    # positions
    moved = displacements(scene, rows, impulses, momenta, motions, duration)
    shifts = push_apart(scene, rows, moved)

    # the next state
    values: dict[str, Any] = {"lag": ca.SX(duration / 2)}
    resting = _store_forces(scene, rows, impulses, ca.fmax(kick, SHORTEST_KICK * scheme.dt), values)
    for i, motion in enumerate(motions):
        values |= scene.keep(_store_body(motion, momenta.velocity[i], momenta.angular[i], shifts[i], resting[i]))
    return Phase(scene.layout.pack(values), rows, tuple(impulses), tuple(last))


def free_motions(scene: Scene, x: Expr, duration: Expr) -> list[Motion]:
    """Each body's free motion; the stored velocities are freed from the last half step's persistent forces."""
    return _motions(scene, x, duration, -x[scene.layout["lag"]], 0)


def expected_motions(scene: Scene, x: Expr, duration: Expr) -> list[Motion]:
    """Each body's motion from its true velocity under the persistent forces of the last step."""
    return _motions(scene, x, duration, 0, 1)


def _motions(scene: Scene, x: Expr, duration: Expr, kick: Expr, share: int) -> list[Motion]:
    """Motions with ``kick`` [s] times the persistent forces in the velocities and ``share`` of them acting."""
    applied = {name: scene.u[3 * i : 3 * i + 3] for i, name in enumerate(scene.inputs)}
    zero = ca.SX.zeros(3)
    motions = []
    for body in scene.world.bodies:
        part = {name: x[scene.layout[f"{body.name}.{name}"]] for name, _ in BODY_FIELDS}
        turning = momentum(body, part["orientation"], part["angular_velocity"])
        state = BodyState(
            position=part["position"],
            orientation=part["orientation"],
            velocity=part["velocity"] + kick * part["reaction_force"] / body.mass,
            angular_momentum=turning + kick * part["reaction_torque"],
            force=applied.get(f"{body.name}.force", zero) + share * part["reaction_force"],
            torque=applied.get(f"{body.name}.torque", zero) + share * part["reaction_torque"],
        )
        motions.append(scene.keep(free_motion(body, state, scene.gravity, duration)))
    return motions


def _warm_start(scene: Scene, rows: Sequence[ContactRow], x: Expr, kick: Expr) -> list[Impulse]:
    """The last step's persistent forces, over this step's kick, in this step's frames."""
    if not scene.scheme.warm_start:
        return [ZERO for _ in rows]
    impulses = []
    for pair, row in zip(scene.world.pairs, rows, strict=True):
        n = row.impulse_normal
        normal, tangent = _split(kick * x[scene.layout[f"{pair.name}.force"]], n)
        spin, roll = ZERO.spin, ZERO.roll
        if pair.law.spins:
            torque = kick * x[scene.layout[f"{pair.name}.torque"]]
            spin, roll = ca.dot(n, torque), torque - n * ca.dot(n, torque)
        impulses.append(Impulse(normal, tangent, spin, roll))
    return impulses


def _split(impulse: Expr, n: Expr) -> tuple[Expr, Expr]:
    along = ca.dot(n, impulse)
    return ca.fmax(along, 0), impulse - n * along


def _store_forces(
    scene: Scene, rows: Sequence[ContactRow], impulses: Sequence[Impulse], kick: Expr, values: dict[str, Any]
) -> list[tuple[Expr, Expr]]:
    """Persistent contact forces (impacts left out) into ``values``; returns their sum on each body."""
    total = [(ca.SX.zeros(3), ca.SX.zeros(3)) for _ in scene.world.bodies]
    for pair, row, impulse in zip(scene.world.pairs, rows, impulses, strict=True):
        share = (1 - row.leaving) * (1 - row.struck) / kick
        force, torque = scene.keep(
            (share * impulse.linear(row.impulse_normal), share * impulse.angular(row.impulse_normal))
        )
        values[f"{pair.name}.force"] = force if scene.scheme.warm_start else ca.SX.zeros(3)
        if pair.law.spins:
            values[f"{pair.name}.torque"] = torque if scene.scheme.warm_start else ca.SX.zeros(3)
        for side in row.sides:
            f, t = total[side.body]
            sum_force = f + side.sign * force
            sum_torque = t + side.sign * (ca.cross(side.impulse_arm, force) + torque)
            total[side.body] = scene.keep((sum_force, sum_torque))
    return total


def _store_body(
    motion: Motion, velocity: Expr, angular: Expr, shift: Shift, resting: tuple[Expr, Expr]
) -> dict[str, Expr]:
    """The body's pose and true velocities at the end of the stretch, by name."""
    body, half, (force, torque) = motion.body, motion.dt / 2, resting
    orientation = rotation.turn(motion.orientation, shift.angular)
    end_momentum = angular + half * (motion.torque + torque)
    return {
        f"{body.name}.position": motion.position + shift.linear,
        f"{body.name}.orientation": orientation,
        f"{body.name}.velocity": velocity + half * (motion.acceleration + force / body.mass),
        f"{body.name}.angular_velocity": angular_velocity(body, orientation, end_momentum),
        f"{body.name}.reaction_force": force,
        f"{body.name}.reaction_torque": torque,
    }
