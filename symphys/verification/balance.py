"""Conservation over a motion: energy and momentum against forces and contacts, and places against velocities.

Angular momentum is left out, since the points of contact are not recorded. Bodies and joints that are, after a step,
where no velocity of the step takes them show in neither energy nor momentum: what a coupling puts back, or a body that
is moved out of another at once, is counted among the effects of contacts and joints.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen.backends.calls import row_by_row
from symphys.dynamics.motion import momentum
from symphys.maths import rotation
from symphys.model.state_layout import Layout, force_names
from symphys.trajectory import Trajectory
from symphys.transcription import Record, Rollout, plain
from symphys.types import Array
from symphys.verification.bodies import bodies, coordinates, floating, joint_work, parameters, rotor_energy, uncounted
from symphys.verification.contacts import acting, slip_speeds, touching
from symphys.verification.sensitivity_growth import samples

MAX_SAMPLES = 400
MAX_GAINS = 5
MIN_GAIN = 1e-6
"""Energy that a contact must add in a step to be reported, as a share of the largest kinetic energy."""
MIN_STOP = 0.05
"""Energy that contacts take, beyond the slip, when they stop a body, as a share of the largest kinetic energy."""
SIDEWAYS_COSINE = 0.5
"""Cosine of the angle to the force that bore a body before, below which a force counts as sideways."""
SPEED_MARGIN = 1.5
"""Places may move by this factor times the larger speed at a step's ends, since speeds between them may be larger."""


def balance(rollout: Rollout, record: Record) -> dict[str, Any]:
    """Account for energy and momentum over a motion.

    Returns:
        "energy": at some 400 instants "time" [s], "kinetic" and "potential" [J] (0 at the origin), and up to then
        "applied", the work of applied forces and torques, motors, springs and changes of gravity, and "contact", what
        contacts, limits of joints and joints that give way gave (negative: took) [J].
        "gains": the steps in which rigid contacts gave most, each with "step", "time" [s], "energy" [J], "contacts";
        steps in which a soft contact acts are left out, since it gives back what it has stored. "gained" [J]: the sum
        of all such steps. "stops": the same of the steps in which they took most from a body that lay or rolled on
        something, by a force from another side: it ran into something, or tripped over an edge. What slip takes under
        the load of the step before is not counted. "drift" [J]: the largest change in a step that neither forces nor
        contacts account for.
        "unexplained" [J]: the largest that is more than twice what servos and springs did in the step, whose work is
        not known to that precision, in the step from "drift_at" [s]; "drifted" [J]: the largest sum of such changes
        since the start.
        "momentum": the largest part of a body's linear momentum that impulses of gravity, forces and contacts leave
        unexplained in a step, relative to the largest momentum or impulse; rounding, if the engine is right. Bodies
        that joints hold together count as one; those that are held by the world are left out.
    """
    motion = record.motion
    kinetic, potential, applied = _energies(rollout, record)
    by_motors, uncertain = joint_work(rollout, record)
    applied += by_motors
    surplus = np.diff(kinetic + potential) - applied
    by_joints = uncounted(rollout, record)
    touched = (np.abs(motion.contact_force).sum(axis=(1, 2)) > 0) | by_joints
    contact = np.where(touched, surplus, 0.0)
    soft = np.array([pair.law.soft for pair in rollout.world.pairs], bool)
    rigid = ~acting(motion)[:, soft].any(axis=1) & ~by_joints
    gains = np.where(rigid, contact, 0.0)
    floor = MIN_GAIN * kinetic.max() + 1e-12 * np.abs(potential).max()
    gains = np.where(gains > floor, gains, 0.0)
    first = np.argsort(-gains, kind="stable")[:MAX_GAINS]
    free = np.where(touched, 0.0, surplus)
    unknown = np.where(np.abs(free) <= 2 * uncertain, 0.0, free)
    return {
        "energy": _thinned(motion.time, kinetic, potential, applied, contact),
        "gains": [_gain(motion, int(k), float(gains[k])) for k in first if gains[k] > 0],
        "gained": float(gains.sum()),
        "stops": _stops(rollout, record, np.where(rigid, -contact, 0.0), MIN_STOP * kinetic.max()),
        "drift": float(np.abs(free).max()),
        "unexplained": float(np.abs(unknown).max()),
        "drift_at": float(motion.time[int(np.abs(unknown).argmax())]),
        "drifted": float(np.abs(np.cumsum(unknown)).max()),
        "momentum": momentum_gap(rollout, record),
    }


def _stops(rollout: Rollout, record: Record, taken: Array, least: float) -> list[dict[str, Any]]:
    """Return the steps in which contacts took more than ``least`` [J] by a sideways force; ``taken`` (N,) [J]."""
    motion = record.motion
    if not (motion.contact_names and (taken > least).any()):
        return []
    size = np.linalg.norm(motion.contact_force, axis=2)
    lasting = np.minimum(size, np.vstack([size[:1], size[:-1]]))
    taken = taken - rollout.dt * (lasting * slip_speeds(rollout, record)).sum(axis=1)
    found = [k for k in np.argsort(-taken, kind="stable") if k and taken[k] > least and _sideways(rollout, motion, k)]
    return [_gain(motion, int(k), float(taken[k])) for k in found[:MAX_GAINS]]


def _sideways(rollout: Rollout, motion: Trajectory, k: int) -> bool:
    """Whether a contact in step k pushes a body from another side than the one that bore it in the step before."""
    bore = np.zeros((len(motion.body_names), 3))
    sides = contact_sides(rollout)
    for c, body, sign in sides:
        bore[body] += sign * motion.contact_force[k - 1, c]
    for c, body, sign in sides:
        push = sign * motion.contact_force[k, c]
        both = float(np.linalg.norm(push) * np.linalg.norm(bore[body]))
        if both > 0 and push @ bore[body] < SIDEWAYS_COSINE * both:
            return True
    return False


def momentum_gap(rollout: Rollout, record: Record) -> float:
    """Return the largest unexplained change of momentum in a step, of bodies or groups that joints connect.

    Momenta are those of the leapfrog: without what persistent forces, half a step ahead, have done already.
    """
    motion, dt, numbers = record.motion, rollout.dt, bodies(rollout, record)
    layout, x = Layout(rollout.world), record.arrays.x
    memory = np.stack([x[:, layout[f"{name}.reaction_force"]] for name in motion.body_names], axis=1)
    held = numbers.mass[:, None] * motion.velocity - x[:, layout["lag"], None] * memory
    impulses = dt * (numbers.mass[:, None] * numbers.gravity[:, None] + motion.force + contact_forces(rollout, motion))
    groups = floating(rollout)
    held, impulses = (
        np.stack([of[:, g].sum(axis=1) for g in groups], axis=1) if groups else of[:, :0] for of in (held, impulses)
    )
    gap = np.diff(held, axis=0) - impulses
    size = max(np.abs(held).max(initial=0.0), np.abs(impulses).max(initial=0.0))
    return float(np.abs(gap).max() / size) if size > 0 else 0.0


def contact_forces(rollout: Rollout, motion: Trajectory) -> Array:
    """Return the sum of contact forces on each body (N, B, 3) [N], world."""
    total = np.zeros_like(motion.force)
    for c, body, sign in contact_sides(rollout):
        total[:, body] += sign * motion.contact_force[:, c]
    return total


def contact_sides(rollout: Rollout) -> list[tuple[int, int, float]]:
    """Return (contact, body, sign of the contact's force on it) for every body of every contact."""
    numbered = enumerate(rollout.world.pairs)
    sides = [(c, side.body, sign) for c, pair in numbered for side, sign in ((pair.first, 1.0), (pair.second, -1.0))]
    return [(c, body, sign) for c, body, sign in sides if body is not None]


def _energies(rollout: Rollout, record: Record) -> tuple[Array, Array, Array]:
    """Return kinetic and potential energy (N + 1,), and the work of applied forces in each step (N,) [J]."""
    world, layout, p = rollout.world, Layout(rollout.world), parameters(rollout)
    x, after = ca.SX.sym("x", layout.size), ca.SX.sym("after", layout.size)
    count, motion = len(world.bodies), record.motion
    force, torque = ca.SX.sym("force", 3, count), ca.SX.sym("torque", 3, count)
    kinetic, work = ca.SX(0), ca.SX(0)
    for k, body in enumerate(world.bodies):
        at = {field: x[layout[f"{body.name}.{field}"]] for field in ("position", "orientation", "velocity")}
        spin = x[layout[f"{body.name}.angular_velocity"]]
        turning = momentum(body.inertia, at["orientation"], spin)
        kinetic += (body.mass * ca.sumsqr(at["velocity"]) + ca.dot(spin, turning)) / 2
        moved = after[layout[f"{body.name}.position"]] - at["position"]
        turned = rotation.between(at["orientation"], after[layout[f"{body.name}.orientation"]])
        work += ca.dot(force[:, k], moved) + ca.dot(torque[:, k], turned)
    kinetic += rotor_energy(world, x)
    states, arrays = ca.Function("energies", [x, p], [kinetic]), record.arrays
    x_k = plain(rollout, arrays.x)
    moving = row_by_row(states, x_k, arrays.p)[0][:, 0]
    works = ca.Function("work", [x, after, force, torque], [work])
    done = row_by_row(works, x_k[:-1], x_k[1:], motion.force, motion.torque)[0][:, 0]
    potential, lifted = _potential(rollout, record)
    return moving, potential, done + lifted


def _potential(rollout: Rollout, record: Record) -> tuple[Array, Array]:
    """Return the potential energy (N + 1,) [J], and its gain after each step (N,) as the next phase changes gravity."""
    numbers = bodies(rollout, record)
    moments = np.einsum("b,kbi->ki", numbers.mass, record.motion.position)
    gravity = np.concatenate([numbers.gravity, numbers.gravity[-1:]])
    return -(gravity * moments).sum(axis=1), -(np.diff(gravity, axis=0) * moments[1:]).sum(axis=1)


def _gain(motion: Trajectory, k: int, energy: float) -> dict[str, Any]:
    return {"step": k, "time": float(motion.time[k]), "energy": energy, "contacts": touching(motion, k)}


def _thinned(time: Array, kinetic: Array, potential: Array, applied: Array, contact: Array) -> dict[str, list[float]]:
    keep = samples(len(time), MAX_SAMPLES)
    given, taken = (np.concatenate([[0.0], np.cumsum(part)]) for part in (applied, contact))
    columns = {"time": time, "kinetic": kinetic, "potential": potential, "applied": given, "contact": taken}
    return {name: column[keep].tolist() for name, column in columns.items()}


def jumps(rollout: Rollout, record: Record) -> dict[str, Any]:
    """Find the largest jump.

    Returns:
        "jump": how far it is beyond what the velocities explain, as a share: of a body's radius of gyration; of the
        smallest one for sliders; of a radian for hinges. "jump_at": None, or its "name" of a body or joint, "time" [s]
        and "size" [m] or [rad].
    """
    motion, dt, sizes = record.motion, rollout.dt, bodies(rollout, record).size
    by_joint, by_body = quick_moves(rollout, record)
    moving = [
        (
            name,
            np.linalg.norm(np.diff(motion.position[:, b], axis=0), axis=1) - by_body[:, b],
            motion.velocity[:, b],
            float(sizes[b]),
        )
        for b, name in enumerate(motion.body_names)
        if np.isfinite(sizes[b])
    ]
    for joint, value, rate in coordinates(rollout, record):
        for i, coordinate in enumerate(joint.kind.coordinates):
            size = 1.0 if coordinate.turns else float(sizes.min())
            step = np.abs(np.diff(value[:, i])) - by_joint[joint.name][:, i]
            moving.append((joint.name, step, rate[:, [i]], size))
    found: dict[str, Any] = {"jump": 0.0, "jump_at": None}
    for name, step, velocity, size in moving:
        speed = np.linalg.norm(velocity, axis=1)
        beyond = step - SPEED_MARGIN * dt * np.maximum(speed[:-1], speed[1:])
        k = int(beyond.argmax())
        if size > 0 and beyond[k] > found["jump"] * size:
            at = {"name": name, "time": float(motion.time[k]), "size": float(step[k])}
            found = {"jump": float(beyond[k] / size), "jump_at": at}
    return found


def quick_moves(rollout: Rollout, record: Record) -> tuple[dict[str, Array], Array]:
    """Return how far motors, springs and contacts may take joints and bodies within a step, from rest to rest.

    A light finger that a strong motor drives goes from one stop to the other in a step, and no velocity at the ends of
    the step tells of it.

    Returns:
        By joint (N, k) [m] or [rad], and for the bodies of these joints (N, B) [m].
    """
    known, world, layout, x = bodies(rollout, record), rollout.world, Layout(rollout.world), record.arrays.x
    lag = layout["lag"]
    by_joint = {joint.name: np.zeros((rollout.steps, len(joint.kind.coordinates))) for joint in world.joints}
    by_body, start = np.zeros((rollout.steps, len(world.bodies))), 0
    owners = {joint.name: joint for joint in world.joints}
    for name, count in force_names(world):
        joint = owners[name.rpartition(".")[0]]
        ahead = np.abs(x[:, lag] * x[:, layout[name]])
        impulse, start = np.abs(record.along[:, start : start + count]) + ahead[1:] + ahead[:-1], start + count
        sides = [b for b in joint.bodies if not world.bodies[b].massless]
        for i, coordinate in enumerate(joint.kind.coordinates):
            for b in sides:
                arm = float(known.size[b]) if coordinate.turns else 1.0
                moved = rollout.dt * impulse[:, i] / (float(known.mass[b]) * arm)
                by_joint[joint.name][:, i] += moved / arm
                by_body[:, b] += moved
    for c, b, _ in contact_sides(rollout):
        if not world.bodies[b].massless:
            by_body[:, b] += rollout.dt**2 * np.linalg.norm(record.motion.contact_force[:, c], axis=1) / known.mass[b]
    for joint in world.joints:
        for i, coordinate in enumerate(joint.kind.coordinates):
            pushed = [by_body[:, b] / (known.size[b] if coordinate.turns else 1.0) for b in joint.bodies]
            by_joint[joint.name][:, i] = np.maximum(by_joint[joint.name][:, i], np.max(pushed, axis=0))
    return by_joint, by_body
