"""The exact rollout of one z with all reported quantities, as plain arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen.backends.calls import row_by_row
from symphys.dynamics.functions import StepReport
from symphys.dynamics.observation import reading_function
from symphys.model.joints import Joint
from symphys.model.state_layout import GIVEN, Layout, input_columns
from symphys.records import dataclass
from symphys.trajectory import NotFinite, Trajectory
from symphys.transcription.nan_tracing import first_non_finite
from symphys.transcription.recorded_parts import RolloutArrays
from symphys.transcription.rollout import Rollout
from symphys.types import Array

ALONG = [field.name for field in fields(StepReport)].index("along")
AGREEMENT = 1e-7
"""Relative and absolute difference of two evaluations of a step up to which it is rounding."""


@dataclass(frozen=True)
class Record:
    """A rollout of ``z`` (n,): its states and arguments, and the motion.

    Attributes:
        along: (N, k) impulses of motors, springs and dry friction in each step [N m s], [N s]; see ``force_names``.
    """

    z: Array
    arrays: RolloutArrays
    motion: Trajectory
    along: Array


def recorder(rollout: Rollout) -> Callable[[Array, float], list[Array]]:
    """Return (z, smoothing) -> (x, u, given, p, forces, .. motors) over time; see ``StepReport``.

    One step is called after the other: a function of all of them would take longer to build than to evaluate.
    """
    results = [rollout.x0, rollout.given, rollout.p, ca.MX(rollout.interval)]
    start, step = ca.Function("start", [rollout.z], results), rollout.close(rollout.report)

    def record(z: Array, smoothing: float) -> list[Array]:
        x0, given, p, interval = start.call([z])
        inputs = given
        if rollout.feedback is not None:
            inputs = ca.vertcat(given, ca.DM(np.arange(rollout.steps)).T * interval)
        now, columns = x0, list[list[Any]]()
        for k in range(rollout.steps):
            columns.append(step.call([now, inputs[:, k], p, smoothing]))
            now = columns[-1][0]
        after, *others = (np.array(ca.horzcat(*each)) for each in zip(*columns, strict=True))
        u = np.array(given) if rollout.feedback is None else others.pop()
        return [np.hstack([np.array(x0), after]), u, np.array(given), np.array(p), *others]

    return record


def simulate(rollout: Rollout, record: Callable[[Array, float], Sequence[Array]], z: Array, smoothing: float) -> Record:
    """Simulate z; NotFinite, with place and cause, if a number is not finite."""
    x, u, given, p, *happened = (np.array(part).T for part in record(z, smoothing))
    dt = rollout.parameters.step_length(rollout.problem.simulation, p.ravel())
    time = np.arange(rollout.steps + 1, dtype=np.float64) * dt
    return _recorded(rollout, RolloutArrays(np.asarray(z, float), smoothing, x, u, given, p.ravel(), time), happened)


def recorded(rollout: Rollout, arrays: RolloutArrays) -> Record | None:
    """Return the record of a motion whose states are known, by casadi's virtual machine.

    None where a step leads elsewhere there, beyond rounding. NotFinite, with place and cause, if it is not finite.
    """
    after, *happened = row_by_row(rollout.report, arrays.x[:-1], arrays.u, arrays.p, [arrays.smoothing])
    if not np.allclose(after, arrays.x[1:], AGREEMENT, AGREEMENT, equal_nan=True):
        return None
    return _recorded(rollout, arrays, happened)


def _recorded(rollout: Rollout, arrays: RolloutArrays, happened: Sequence[Array]) -> Record:
    motion = _trajectory(rollout, arrays.time, arrays.x, arrays.u, arrays.p, *happened)
    try:
        return Record(arrays.z, arrays, motion.require_finite(), happened[ALONG])
    except NotFinite as error:
        raise NotFinite(f"{error}; {first_non_finite(rollout, arrays)}") from None


def motion_of(rollout: Rollout, time: Array, x: Array, u: Array, p: Array) -> Trajectory:
    """Return the motion of states (K + 1, nx), simulated step by step with inputs (K, m), at times (K + 1,)."""
    report, steps = rollout.report, len(u)
    if rollout.feedback is not None:
        pairs = zip(x, u, time, strict=False)
        u = np.array([np.array(rollout.feedback(state, given, p, now)).ravel() for state, given, now in pairs])
    happened = row_by_row(report, x[:-1], u, p, [0.0])[1:]
    simulation = replace(rollout.problem.simulation, duration=steps * rollout.dt)
    whole = replace(rollout, problem=replace(rollout.problem, simulation=simulation))
    return _trajectory(whole, time, x, u, p, *happened).require_finite()


def _trajectory(
    rollout: Rollout,
    time: Array,
    x: Array,
    u: Array,
    p: Array,
    forces: Array,
    gaps: Array,
    residual: Array,
    crowded: Array,
    ambiguous: Array,
    paradox: Array,
    along: Array,
    motors: Array,
) -> Trajectory:
    world, steps = rollout.world, rollout.steps
    layout, (force, torque) = Layout(world), _applied(rollout, x, u, p)
    bodies: dict[str, Any] = {
        field: _stack([x[:, layout[f"{body.name}.{field}"]] for body in world.bodies]) for field in GIVEN
    }
    return Trajectory(
        time=time,
        body_names=tuple(body.name for body in world.bodies),
        **bodies,
        force=force,
        torque=torque,
        contact_names=tuple(pair.name for pair in world.pairs),
        contact_force=forces.reshape(steps, len(world.pairs), 3),
        contact_gap=np.concatenate([gaps, gaps[-1:]]),
        residual=residual.ravel(),
        crowded=crowded.ravel(),
        ambiguous=ambiguous.ravel(),
        paradox=paradox.ravel(),
        **_joints(rollout, x, u, p, motors),
    )


def plain(rollout: Rollout, x: Array) -> Array:
    """Return the states without memory."""
    return x[:, : Layout(rollout.world).size]


def _stack(parts: list[Any]) -> Array:
    return np.stack(parts, axis=1)


def _joints(rollout: Rollout, x: Array, u: Array, p: Array, motors: Array) -> dict[str, Any]:
    """Return the fields of joints; ``motors`` (N, m) are the impulses of their motors."""
    joints, lag = rollout.world.joints, x[:, Layout(rollout.world)["lag"]]
    counts = [len(joint.kind.coordinates) for joint in joints]
    read = reading_function(rollout.world, rollout.parameters.symbols)
    value, rate, _, separation = row_by_row(read, plain(rollout, x), p)
    torque = np.zeros((len(u), sum(counts)))
    driven = np.repeat([joint.driven for joint in joints], counts).astype(bool)
    torque[:, driven] = motors / (rollout.dt + lag[:-1] - lag[1:])
    return {
        "joint_names": tuple(joint.name for joint in joints),
        "joint_value": _split(value, counts),
        "joint_rate": _split(rate, counts),
        "joint_torque": _split(torque, counts),
        "joint_command": _split(_commands(rollout, u, counts), counts),
        "joint_separation": separation,
        "joint_units": tuple(map(_unit, joints)),
    }


def _unit(joint: Joint) -> str:
    """Return the units of a joint's coordinates; none for a joint without coordinates."""
    return "".join(coordinate.unit for coordinate in joint.kind.coordinates[:1])


def _commands(rollout: Rollout, u: Array, counts: list[int]) -> Array:
    """Return (N, coordinates of all joints) the commands of their motors."""
    columns = input_columns(rollout.world, rollout.inputs)
    commands = [
        u[:, columns[name]] if (name := f"{joint.name}.command") in columns else np.zeros((rollout.steps, count))
        for joint, count in zip(rollout.world.joints, counts, strict=True)
    ]
    return np.concatenate([np.zeros((rollout.steps, 0)), *commands], axis=1)


def _split(columns: Array, counts: list[int]) -> Array:
    """Split the coordinates of all joints by joint: (N, J, K)."""
    apart = np.full((len(columns), len(counts), max(counts, default=0)), np.nan)
    start = 0
    for j, count in enumerate(counts):
        apart[:, j, :count] = columns[:, start : start + count]
        start += count
    return apart


def _applied(rollout: Rollout, x: Array, u: Array, p: Array) -> tuple[Array, Array]:
    """Return forces and torques (N, B, 3) that inputs exert on bodies, zero for bodies without any."""
    found = row_by_row(rollout.applied_wrenches, plain(rollout, x)[:-1], u, p)
    force, torque = (each.reshape(rollout.steps, len(rollout.world.bodies), 3) for each in found)
    return force, torque
