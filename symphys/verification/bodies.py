"""Bodies and joints of a rollout as numbers, with the parameters that variables set."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen.backends.calls import row_by_row
from symphys.dynamics.joints.warm_start import components
from symphys.dynamics.motion import inertia_matrix
from symphys.dynamics.observation import readings
from symphys.model.joints import Joint, given_torque
from symphys.model.scalar import is_zero
from symphys.model.state_layout import Layout, force_names, input_symbols
from symphys.model.world import World
from symphys.records import dataclass
from symphys.transcription import Record, Rollout
from symphys.types import Array, Bools

LIMIT_DISTANCE = 1e-6
"""[rad], [m] Distance from a limit that counts as being there, plus the motion in a step."""


@dataclass(frozen=True)
class Bodies:
    """``mass`` (B,) [kg], ``size`` (B,) [m] radius of gyration (of a frame the largest), ``gravity`` (N, 3) [m/s^2]."""

    mass: Array
    size: Array
    gravity: Array


def bodies(rollout: Rollout, record: Record) -> Bodies:
    """Return the bodies of a rollout as numbers."""
    world = rollout.world
    mass = ca.vertcat(*(ca.SX(body.mass) for body in world.bodies))
    inertia = ca.vertcat(*(ca.trace(inertia_matrix(body.inertia)) / 3 for body in world.bodies))
    size = ca.vertcat(*(ca.SX(0) if b.massless else ca.sqrt(inertia[k] / mass[k]) for k, b in enumerate(world.bodies)))
    numbers = ca.Function("bodies", [parameters(rollout)], [mass, size])(record.arrays.p)
    found = Bodies(np.array(numbers[0]).ravel(), np.array(numbers[1]).ravel(), gravity(rollout, record))
    frames = np.array([body.massless for body in world.bodies], bool)
    return replace(found, size=np.where(frames, found.size.max(), found.size))


def gravity(rollout: Rollout, record: Record) -> Array:
    """Return gravity in each step (N, 3) [m/s^2], which phases may set."""
    u = input_symbols(rollout.world, rollout.inputs)
    vector = ca.vertcat(*(ca.SX(g) for g in rollout.world.gravity))
    of_step, arrays = ca.Function("gravity", [u, parameters(rollout)], [ca.densify(vector)]), record.arrays
    return row_by_row(of_step, arrays.u, arrays.p)[0]


def parameters(rollout: Rollout) -> Any:
    """Return the symbols (np,) that p stacks."""
    return ca.vertcat(ca.SX(0, 1), *rollout.parameters.symbols)


def joint_work(rollout: Rollout, record: Record) -> tuple[Array, Array]:
    """Return the work of motors, springs and dry friction in each step (N,) [J], and the sum of its absolute values.

    An impulse counts until half a substep before the end of its step, and ``lag`` after that (docs/time_step.md).
    Rates count with their mean over a step, so the work of a servo that goes from one bound to the other within a step
    is wrong by up to its sum of absolute values.
    """
    layout, x = Layout(rollout.world), record.arrays.x
    total, gross, lag = np.zeros(rollout.steps), np.zeros(rollout.steps), x[:, [layout["lag"].start]]
    rates = {joint.name: (joint, rate) for joint, _, rate in coordinates(rollout, record)}
    start = 0
    for name, count in force_names(rollout.world):
        owner, _, part = name.rpartition(".")
        joint, rate = rates[owner]
        ahead = lag * x[:, layout[name]]
        impulse = record.along[:, start : start + count] + ahead[1:] - ahead[:-1]
        work, start = impulse * (rate[:-1] + rate[1:]) / 2, start + count
        total += work.sum(axis=1)
        gross += 0 if part == "motor" and given_torque(joint.motor) else np.abs(work).sum(axis=1)
    return total, gross


def rotor_energy(world: World, x: Any) -> Any:
    """Return the kinetic energy [J] of the rotors in a state (casadi SX)."""
    total, layout = ca.SX(0), Layout(world)
    found = readings(world, x) if any(not is_zero(joint.armature) for joint in world.joints) else {}
    for joint in world.joints if found else ():
        rate = found[joint.name].rate
        if not joint.kind.coordinates and joint.kind.free:
            spins = [x[layout[f"{world.bodies[k].name}.angular_velocity"]] for k in joint.bodies]
            rate = spins[0] if len(spins) == 1 else spins[0] - spins[1]
        total += joint.armature / 2 * ca.sumsqr(rate)
    return total


def uncounted(rollout: Rollout, record: Record) -> Bools:
    """Return the steps (N,) in which a joint may take or store other energy: at a limit, or where it is compliant."""
    found = np.full(rollout.steps, any(joint.soft for joint in rollout.world.joints))
    for joint, value, rate in coordinates(rollout, record):
        reach = rollout.dt * np.abs(rate) + LIMIT_DISTANCE
        for sign, limit in ((-1, joint.limits.lower), (1, joint.limits.upper)):
            if limit is not None:
                bound = number(rollout, record, limit)
                there: Bools = np.any(sign * (value - bound) + reach >= 0, axis=1)
                found |= there[:-1] | there[1:]
    return found


def floating(rollout: Rollout) -> list[list[int]]:
    """Return groups of bodies that joints connect, none of which the world holds."""
    world = rollout.world
    held = {joint.first for joint in world.joints if joint.second is None}
    return [sorted(group) for group in components(world) if not group & held]


def coordinates(rollout: Rollout, record: Record) -> Iterator[tuple[Joint, Array, Array]]:
    """Yield joints with coordinates, their values and rates (N + 1, k)."""
    motion = record.motion
    for j, joint in enumerate(rollout.world.joints):
        count = len(joint.kind.coordinates)
        if count:
            yield joint, motion.joint_value[:, j, :count], motion.joint_rate[:, j, :count]


def number(rollout: Rollout, record: Record, value: Any) -> float:
    """Return a number of the world, which a parameter may set."""
    return float(ca.Function("number", [parameters(rollout)], [ca.SX(value)])(record.arrays.p))
