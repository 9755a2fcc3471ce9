"""Near misses and glancing touches: places where a small change of z makes a touch, or loses one.

There the motion jumps, while gradient and differences at z agree with each other. Two surfaces that never touch are
examined where they come closest. Of two that touch, the bodies are followed from the step of the first touch on as if
they flew on through each other; how deep they would get is by how much they touch. The derivative by z of that distance
says what change of the variables would close it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.maths import rotation
from symphys.model.state_layout import GIVEN, Layout
from symphys.shooting import VariableBlock
from symphys.transcription import Record, Rollout, Transcription
from symphys.types import Array
from symphys.verification.sensitivity_growth import DIRECTIONS
from symphys.verification.signed_gaps import SurfacePair, surface_pairs

MOST = 4
"""Pairs of surfaces that are examined: those that come closest, and those that touch first."""
AROUND = 16
"""Instants that are computed in each step around the closest."""
LONGEST = 100
"""Steps that a flight through each other is followed for."""
FINENESS = 16
"""Instants in each of these."""


@dataclass(frozen=True)
class ClosestApproach:
    """How near two surfaces come: ``gap`` (negative: how deep) at ``after`` [s] behind the state of step ``k``."""

    pair: SurfacePair
    k: int
    after: float
    gap: float


def near_misses(transcription: Transcription, record: Record) -> list[dict[str, Any]]:
    """The closest misses and the shallowest touches.

    Returns:
        Each with its "contact", "touches", whether it does, "time" [s], "gap" [m], by how much it misses, or how deep
        it touches; "variable": which would change that most by its scale, and "change": by how much of its own unit
        it would have to change alone. "steps" and "spreads": how many scales, or spreads, of all variables together.
        Empty for problems with large nets.
    """
    rollout = transcription.rollout
    found = [*_closest(rollout, record), *_touches(rollout, record)]
    if not found:
        return []
    blocks, rows = transcription.shooting.blocks, []
    for first in range(0, len(found), DIRECTIONS):
        some = found[first : first + DIRECTIONS]
        slopes = _pulled(transcription, record, some)
        if slopes is None:
            return []
        rows += [_row(approach, blocks, slope, rollout.dt) for approach, slope in zip(some, slopes.T, strict=False)]
    return rows


def _pulled(transcription: Transcription, record: Record, some: Sequence[ClosestApproach]) -> Array | None:
    """(n, DIRECTIONS): derivatives of these gaps by z; as many at once as ``sensitivity_growth`` sweeps."""
    states: dict[int, Array] = {}
    by_p = np.zeros((record.arrays.p.size, DIRECTIONS))
    for column, approach in enumerate(some):
        by_x, by_p[:, column] = _slopes(approach, record)
        states.setdefault(approach.k, np.zeros((record.arrays.x.shape[1], DIRECTIONS)))[:, column] = by_x
    return transcription.pull(record, states, by_p)


def _row(approach: ClosestApproach, blocks: Sequence[VariableBlock], slope: Array, dt: float) -> dict[str, Any]:
    """``slope`` (n,): of the gap."""
    parts = [slope[block.start : block.stop] for block in blocks]
    effects = [float(np.linalg.norm(part * block.scale)) for part, block in zip(parts, blocks, strict=True)]
    spreads = float(np.linalg.norm(np.concatenate([p * b.spread for p, b in zip(parts, blocks, strict=True)])))
    most, gap = int(np.argmax(effects)), abs(approach.gap)
    return {
        "contact": approach.pair.name,
        "touches": approach.gap < 0,
        "time": approach.k * dt + approach.after,
        "gap": gap,
        "variable": blocks[most].name,
        "change": _ratio(gap, float(np.linalg.norm(parts[most]))),
        "steps": _ratio(gap, float(np.linalg.norm(effects))),
        "spreads": _ratio(gap, spreads),
    }


def _ratio(gap: float, effect: float) -> float:
    return gap / effect if effect > 0 else np.inf


def _closest(rollout: Rollout, record: Record) -> list[ClosestApproach]:
    """Where surfaces that never touch come closest, the nearest first."""
    gaps, acting = record.motion.contact_gap[:-1], _acting(record)
    near = [each for each in surface_pairs(rollout) if not acting[:, list(each.columns)].any()]
    least = [gaps[:, list(each.columns)].min(axis=1) for each in near]
    order = np.argsort([float(np.min(each)) for each in least], kind="stable")[:MOST]
    found = (_around(near[i], record, int(least[i].argmin())) for i in order)
    return [approach for approach in found if approach.gap > 0]


def _around(pair: SurfacePair, record: Record, k: int) -> ClosestApproach:
    """The closest in the steps before and after an instant."""
    dt, choices = pair.rollout.dt, []
    for step in range(max(k - 1, 0), min(k + 1, pair.rollout.steps)):
        after = np.linspace(0, 1, AROUND + 1) * dt
        gaps = pair.least(_flown(pair, record, step, after), record.arrays.p)
        choices.append(ClosestApproach(pair, step, float(after[gaps.argmin()]), float(gaps.min())))
    return min(choices, key=lambda approach: approach.gap)


def _touches(rollout: Rollout, record: Record) -> list[ClosestApproach]:
    """How deep surfaces would get that fly into each other and out again, for bodies without joints."""
    acting, held = _acting(record), {body for joint in rollout.world.joints for body in (joint.first, joint.second)}
    touching = [
        each for each in surface_pairs(rollout) if acting[:, list(each.columns)].any() and not held & {*each.bodies}
    ]
    starts = [int(acting[:, list(each.columns)].any(axis=1).argmax()) for each in touching]
    first = sorted(range(len(starts)), key=lambda i: starts[i])[:MOST]
    found = (_through(touching[i], record, starts[i]) for i in first if starts[i] > 0)
    return [approach for approach in found if approach is not None]


def _through(pair: SurfacePair, record: Record, k: int) -> ClosestApproach | None:
    """The deepest on the way through; None where the way does not come out again."""
    rollout = pair.rollout
    steps = min(LONGEST, rollout.steps - k)
    after = np.arange(steps * FINENESS + 1) * rollout.dt / FINENESS
    gaps = pair.least(_flown(pair, record, k, after), record.arrays.p)
    inside = gaps < 0
    if not inside.any():
        return None
    enters = int(inside.argmax())
    leaves = np.flatnonzero(~inside[enters:])
    if not leaves.size:
        return None
    deepest = enters + int(gaps[enters : enters + leaves[0]].argmin())
    return ClosestApproach(pair, k, float(after[deepest]), float(gaps[deepest]))


def _acting(record: Record) -> NDArray[np.bool_]:
    """(N, C): whether a contact gives an impulse in a step."""
    return np.asarray(np.abs(record.motion.contact_force).sum(axis=2) > 0)


def _flown(pair: SurfacePair, record: Record, k: int, after: Array) -> Array:
    """(m, 2, 7): poses of both bodies ``after`` (m,) [s], as they fly on from state k."""
    fly, motion = _flight(), record.motion
    poses = np.zeros((len(after), 2, 7))
    poses[:, :, 3] = 1
    for side, body in enumerate(pair.bodies):
        state = np.concatenate([getattr(motion, field)[k, body] for field in GIVEN])
        many = np.tile(state[:, None], len(after))
        bend = np.tile(_acceleration(record, pair.rollout.dt, k, body)[:, None], len(after))
        poses[:, side] = np.array(fly.map(len(after))(many, bend, after[None])).T
    return poses


def _acceleration(record: Record, dt: float, k: int, body: int) -> Array:
    """(3,) [m/s^2]: that of the step before, or of the first one."""
    velocity, step = record.motion.velocity[:, body], max(k - 1, 0)
    return np.asarray((velocity[step + 1] - velocity[step]) / dt)


def _flight() -> ca.Function:
    """(position, orientation, velocity, angular velocity (13,), acceleration (3,), time) -> pose (7,)."""
    state, bend, time = ca.SX.sym("state", 13), ca.SX.sym("acceleration", 3), ca.SX.sym("time")
    place = state[:3] + time * state[7:10] + time * time / 2 * bend
    return ca.Function("flight", [state, bend, time], [ca.vertcat(place, rotation.turn(state[3:7], time * state[10:]))])


def _slopes(approach: ClosestApproach, record: Record) -> tuple[Array, Array]:
    """Derivatives of the gap by state k (nx,) and by p (np,)."""
    pair, rollout = approach.pair, approach.pair.rollout
    layout, fly = Layout(rollout.world), _flight()
    p, states = ca.SX.sym("p", record.arrays.p.size), [ca.SX.sym("state", 13) for _ in pair.bodies]
    poses = [
        fly(state, ca.DM(_acceleration(record, rollout.dt, approach.k, body)), approach.after)
        for state, body in zip(states, pair.bodies, strict=True)
    ]
    gaps = pair.gaps(poses[0], poses[1] if len(poses) == 2 else ca.DM([0, 0, 0, 1, 0, 0, 0]), p)
    given = [np.concatenate([getattr(record.motion, f)[approach.k, body] for f in GIVEN]) for body in pair.bodies]
    values = ca.Function("values", [*states, p], [gaps])(*given, record.arrays.p)
    least = gaps[int(np.argmin(np.array(values)))]
    slope = ca.Function("slope", [*states, p], [ca.gradient(least, ca.vertcat(*states, p))])(*given, record.arrays.p)
    found, by_x = np.array(slope).ravel(), np.zeros(record.arrays.x.shape[1])
    for side, body in enumerate(pair.bodies):
        name = rollout.world.bodies[body].name
        for field, part in zip(GIVEN, ((0, 3), (3, 7), (7, 10), (10, 13)), strict=True):
            by_x[layout[f"{name}.{field}"]] = found[13 * side + part[0] : 13 * side + part[1]]
    return by_x, found[13 * len(pair.bodies) :]
