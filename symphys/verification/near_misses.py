"""Gaps between recorded instants: near misses, glancing touches, and bodies that pass through each other.

Near misses and glancing touches are places where a small change of z makes a touch, or loses one. There the motion
jumps, while gradient and differences at z agree with each other. Two surfaces that never touch are examined where they
come closest. Of two that touch, the bodies are followed from the step of the first touch on as if they flew on through
each other; how deep they would get is by how much they touch. The derivative of that distance by z says which change of
the variables would close it.

A body that moves by more than its own size in a step may be in front of a wall at one instant and behind it at the
next. Bodies are placed on the straight path between their places at both ends of the step. A path that bounces within
the step lies on the far side of that line, as seen from the surface, so the line cuts into a surface only if the path
did.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache, cached_property
from itertools import groupby
from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen.backends.calls import row_by_row
from symphys.dynamics.collision import collide
from symphys.dynamics.collision.predicted_path import PredictedPath, at_rest
from symphys.maths import rotation
from symphys.model.shapes import SolidShape
from symphys.model.state_layout import GIVEN, Layout
from symphys.model.world import Pair
from symphys.problem import Constraint, Target
from symphys.records import dataclass
from symphys.shooting import VariableBlock
from symphys.transcription import Record, Rollout, Transcription
from symphys.types import Array, Expr
from symphys.verification.bodies import bodies, parameters
from symphys.verification.contacts import acting
from symphys.verification.sensitivity_growth import DIRECTIONS

MAX_MISSES = 4
"""Pairs of surfaces that are examined: those that come closest, and those that touch first."""
CLOSE_INSTANTS = 16
"""Instants in each step around the closest."""
MAX_STEPS = 100
"""Steps for which a flight through each other is followed."""
INSTANTS_PER_STEP = 16
"""Instants in each of these steps."""
TUNNEL_SHARE = 0.5
"""Motion in a step, as a share of a body's size, below which nothing passes unseen."""
SPACING = 0.25
"""Distance of the places that are computed, as a share of a body's size."""
MAX_PLACES = 64
"""Places that are computed in one step, at most."""
MAX_TURN = 1.0
"""[rad] Rotation in a step beyond which the path of a body that is no ball is unknown between its ends."""


@dataclass(frozen=True, eq=False)
class SurfacePair:
    """Two surfaces that may touch.

    Attributes:
        name: of the contact, without the number of a point.
        columns: of its points, in what is recorded of contacts.
        pair: its first point.
    """

    rollout: Rollout
    name: str
    columns: tuple[int, ...]
    pair: Pair

    @property
    def first(self) -> int:
        """The index of the first body."""
        assert self.pair.first.body is not None
        return self.pair.first.body

    @property
    def second(self) -> int | None:
        """The index of the second body; None for a static surface."""
        return self.pair.second.body

    @property
    def bodies(self) -> tuple[int, ...]:
        """The indices of the bodies that can move."""
        return (self.first,) if self.second is None else (self.first, self.second)

    @cached_property
    def gaps(self) -> ca.Function:
        """Function (first pose (7,), second pose (7,), p) -> gaps (points,) [m]; a pose: position, orientation."""
        world, poses = self.rollout.world, [ca.SX.sym("pose", 7) for _ in range(2)]
        surfaces = world.surface(self.pair.first), world.surface(self.pair.second)
        static = at_rest(ca.SX(self.rollout.dt))
        second = static if self.second is None else _resting(poses[1], self.rollout.dt)
        found = [contact.gap for contact in collide(*surfaces, _resting(poses[0], self.rollout.dt), second)]
        return ca.Function("gaps", [*poses, parameters(self.rollout)], [ca.densify(ca.vertcat(*found))])

    def least(self, poses: Array, p: Array) -> Array:
        """Return the smallest gap of all points (m,) [m], for ``poses`` (m, 2, 7)."""
        least: Array = row_by_row(self.gaps, poses[:, 0], poses[:, 1], p)[0].min(axis=1)
        return least


def surface_pairs(rollout: Rollout) -> list[SurfacePair]:
    """Return all pairs of surfaces, in the order of the world's pairs."""
    found = []
    numbered = enumerate(rollout.world.pairs)
    for _, group in groupby(numbered, key=lambda entry: (entry[1].first, entry[1].second)):
        columns, pairs = zip(*group, strict=True)
        found.append(SurfacePair(rollout, pairs[0].name.partition(":")[0], tuple(columns), pairs[0]))
    return found


def _resting(pose: Expr, dt: float) -> PredictedPath:
    zero = ca.SX.zeros(3)
    return PredictedPath(pose[:3], rotation.matrix(pose[3:]), zero, zero, zero, zero, ca.SX(dt), None, None)


@dataclass(frozen=True)
class ClosestApproach:
    """The closest approach of two surfaces: ``gap`` (negative: depth), ``after`` [s] from the state of step ``k``."""

    pair: SurfacePair
    k: int
    after: float
    gap: float


def near_misses(transcription: Transcription, record: Record) -> list[dict[str, Any]]:
    """Return the closest misses and the shallowest touches.

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


def untouched(rollout: Rollout, record: Record, missed: Collection[str]) -> list[dict[str, Any]]:
    """Return the bodies that what is missed is about, and that nothing moves: whatever could push them stays away.

    They have no joint, and nothing that varies is their own.

    Args:
        rollout: of a problem.
        record: of its motion.
        missed: names of targets and constraints.

    Returns:
        For each its "body", the "contact" that comes nearest, its "gap" [m] and "time" [s].
    """
    problem, world, loaded = rollout.problem, rollout.world, acting(record.motion)
    tables: list[Target | Constraint] = [*problem.targets, *problem.constraints]
    asked = [name for each in tables if each.name in missed for name in each.formula.names]
    own = [*rollout.inputs, *(slot.name for variable in problem.variables for slot in variable.slots)]
    held = {body for joint in world.joints for body in (joint.first, joint.second)}
    rows = []
    for number, body in enumerate(world.bodies):
        named, driven = (any(name.startswith(f"{body.name}.") for name in names) for names in (asked, own))
        if number in held or driven or not named:
            continue
        pairs = [pair for pair in surface_pairs(rollout) if pair.second is not None and number in pair.bodies]
        if not pairs or any(loaded[:, list(pair.columns)].any() for pair in pairs):
            continue
        gaps = [record.motion.contact_gap[:-1, list(pair.columns)].min(axis=1) for pair in pairs]
        nearest = int(np.argmin([each.min() for each in gaps]))
        found = _around(pairs[nearest], record, int(gaps[nearest].argmin()))
        time = found.k * rollout.dt + found.after
        rows.append({"body": body.name, "contact": found.pair.name, "gap": found.gap, "time": time})
    return rows


def _pulled(transcription: Transcription, record: Record, some: Sequence[ClosestApproach]) -> Array | None:
    """Return derivatives of these gaps by z (n, DIRECTIONS), as many at once as ``sensitivity_growth`` sweeps."""
    states: dict[int, Array] = {}
    by_p = np.zeros((record.arrays.p.size, DIRECTIONS))
    for column, approach in enumerate(some):
        by_x, by_p[:, column] = _slopes(approach, record)
        states.setdefault(approach.k, np.zeros((record.arrays.x.shape[1], DIRECTIONS)))[:, column] = by_x
    return transcription.pull(record, states, by_p)


def _row(approach: ClosestApproach, blocks: Sequence[VariableBlock], slope: Array, dt: float) -> dict[str, Any]:
    """Return the row of an approach; ``slope`` (n,): the derivative of its gap by z."""
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
    """Return where surfaces that never touch come closest, the nearest first."""
    gaps, loaded = record.motion.contact_gap[:-1], acting(record.motion)
    near = [each for each in surface_pairs(rollout) if not loaded[:, list(each.columns)].any()]
    least = [gaps[:, list(each.columns)].min(axis=1) for each in near]
    order = np.argsort([float(np.min(each)) for each in least], kind="stable")[:MAX_MISSES]
    found = (_around(near[i], record, int(least[i].argmin())) for i in order)
    return [approach for approach in found if approach.gap > 0]


def _around(pair: SurfacePair, record: Record, k: int) -> ClosestApproach:
    """Return the closest approach in the steps before and after an instant."""
    dt, choices = pair.rollout.dt, []
    for step in range(max(k - 1, 0), min(k + 1, pair.rollout.steps)):
        after = np.linspace(0, 1, CLOSE_INSTANTS + 1) * dt
        gaps = pair.least(_flown(pair, record, step, after), record.arrays.p)
        choices.append(ClosestApproach(pair, step, float(after[gaps.argmin()]), float(gaps.min())))
    return min(choices, key=lambda approach: approach.gap)


def _touches(rollout: Rollout, record: Record) -> list[ClosestApproach]:
    """Return how deep surfaces would fly into each other before they come out again, for bodies without joints."""
    loaded, held = (
        acting(record.motion),
        {body for joint in rollout.world.joints for body in (joint.first, joint.second)},
    )
    touching = [
        each for each in surface_pairs(rollout) if loaded[:, list(each.columns)].any() and not held & {*each.bodies}
    ]
    starts = [int(loaded[:, list(each.columns)].any(axis=1).argmax()) for each in touching]
    first = sorted(range(len(starts)), key=lambda i: starts[i])[:MAX_MISSES]
    found = (_through(touching[i], record, starts[i]) for i in first if starts[i] > 0)
    return [approach for approach in found if approach is not None]


def _through(pair: SurfacePair, record: Record, k: int) -> ClosestApproach | None:
    """Return the deepest point of the flight through each other; None if it does not come out again."""
    rollout = pair.rollout
    steps = min(MAX_STEPS, rollout.steps - k)
    after = np.arange(steps * INSTANTS_PER_STEP + 1) * rollout.dt / INSTANTS_PER_STEP
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


def _flown(pair: SurfacePair, record: Record, k: int, after: Array) -> Array:
    """Return poses (m, 2, 7) of both bodies ``after`` (m,) [s], in free flight from state k."""
    fly, motion = _flight(), record.motion
    poses = np.zeros((len(after), 2, 7))
    poses[:, :, 3] = 1
    for side, body in enumerate(pair.bodies):
        state = np.concatenate([getattr(motion, field)[k, body] for field in GIVEN])
        poses[:, side] = row_by_row(fly, state, _acceleration(record, pair.rollout.dt, k, body), after[:, None])[0]
    return poses


def _acceleration(record: Record, dt: float, k: int, body: int) -> Array:
    """Return the acceleration (3,) [m/s^2] in the step before k, or in the first one."""
    velocity, step = record.motion.velocity[:, body], max(k - 1, 0)
    return np.asarray((velocity[step + 1] - velocity[step]) / dt)


@cache
def _flight() -> ca.Function:
    """Return the function (position, orientation, velocities (13,), acceleration (3,), time) -> pose (7,)."""
    state, bend, time = ca.SX.sym("state", 13), ca.SX.sym("acceleration", 3), ca.SX.sym("time")
    place = state[:3] + time * state[7:10] + time * time / 2 * bend
    return ca.Function("flight", [state, bend, time], [ca.vertcat(place, rotation.turn(state[3:7], time * state[10:]))])


def _slopes(approach: ClosestApproach, record: Record) -> tuple[Array, Array]:
    """Return derivatives of the gap by state k (nx,) and by p (np,)."""
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


def tunnelling(rollout: Rollout, record: Record) -> dict[str, Any]:
    """Find the worst overlap of rigid surfaces on the straight paths between two instants.

    Returns:
        "passed": its depth as a share of the smaller body's radius of gyration, 0 where nothing moves that fast; a
        ball's centre is at a surface at 1.6. "passed_at": None, or its "contact", "time" [s] and "depth" [m].
    """
    size, worst = bodies(rollout, record).size, 0.0
    found: dict[str, Any] = {"passed": 0.0, "passed_at": None}
    for pair in surface_pairs(rollout):
        if pair.pair.law.soft:
            continue
        own = float(min(size[body] for body in pair.bodies))
        for k, places in _fast_steps(pair, record, own):
            gaps = pair.least(_between(pair, record, k, places), record.arrays.p)
            depth, at = float(-gaps.min()), float(places[int(gaps.argmin())])
            if depth / own > worst:
                worst = depth / own
                time = (k + at) * rollout.dt
                found = {"passed": worst, "passed_at": {"contact": pair.name, "time": time, "depth": depth}}
    return found


def _fast_steps(pair: SurfacePair, record: Record, size: float) -> list[tuple[int, Array]]:
    """Return the steps with fast relative motion, each with the fractions of the step to look at."""
    way = np.linalg.norm(np.diff(relative(pair, record), axis=0), axis=1)
    outside = record.motion.contact_gap[:-1, list(pair.columns)].min(axis=1) > -TUNNEL_SHARE * size
    fast = outside & (way > TUNNEL_SHARE * size)
    if not _balls(pair):
        spin = np.linalg.norm(record.motion.angular_velocity[:-1, list(pair.bodies)], axis=2).max(axis=1)
        fast &= spin * pair.rollout.dt < MAX_TURN
    counts = np.minimum(np.ceil(way / (SPACING * size)), MAX_PLACES)
    return [(int(k), np.linspace(0, 1, int(counts[k]) + 1)[1:]) for k in np.flatnonzero(fast)]


def relative(pair: SurfacePair, record: Record) -> Array:
    """Return the first body's place as seen from the second (N + 1, 3) [m]."""
    place = record.motion.position
    return place[:, pair.first] - (0 if pair.second is None else place[:, pair.second])


def _balls(pair: SurfacePair) -> bool:
    """Whether the shapes are spheres about their centres of mass, so that turning changes nothing."""
    sides = [side for side in (pair.pair.first, pair.pair.second) if side.body is not None]
    surfaces = [pair.rollout.world.surface(side) for side in sides]
    return all(isinstance(surface, SolidShape) and surface.central for surface in surfaces)


def _between(pair: SurfacePair, record: Record, k: int, places: Array) -> Array:
    """Return poses of both bodies at these fractions of step k (m, 2, 7)."""
    poses = np.zeros((len(places), 2, 7))
    poses[:, :, 3] = 1
    for side, body in enumerate(pair.bodies):
        motion = record.motion
        ends = [np.concatenate([motion.position[k + i, body], motion.orientation[k + i, body]]) for i in range(2)]
        if ends[0][3:] @ ends[1][3:] < 0:
            ends[1][3:] *= -1
        poses[:, side] = (1 - places[:, None]) * ends[0] + places[:, None] * ends[1]
    poses[:, :, 3:] /= np.linalg.norm(poses[:, :, 3:], axis=2, keepdims=True)
    return poses
