"""Whether a body went through another between two instants: what recorded gaps, one for each instant, do not show.

A body that moves on by more than its own size in a step may be before a wall at one instant and behind it at the next.
Bodies are placed on the straight way between their places at both ends of the step. A path that bounces within the
step lies on the far side of that way, as seen from the surface, so the way cuts into a surface only if the path did.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from symphys.model.shapes import SolidShape, Surface
from symphys.transcription import Record, Rollout
from symphys.types import Array
from symphys.verification.bodies import bodies
from symphys.verification.signed_gaps import SurfacePair, surface_pairs

FAST = 0.5
"""Of a body's size: what moves by less in a step cannot pass unseen."""
FINENESS = 0.25
"""Of a body's size: the distance of the places that are computed."""
MOST_PLACES = 64
"""In one step."""
MOST_TURN = 1.0
"""[rad] in a step; beyond it the way of what is no ball is not known between its ends."""


def tunnelling(rollout: Rollout, record: Record) -> dict[str, Any]:
    """The worst overlap of rigid surfaces on the ways between two instants.

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
    """The steps in which the bodies move fast as seen from each other, and shares of the step to look at."""
    way = np.linalg.norm(np.diff(relative(pair, record), axis=0), axis=1)
    outside = record.motion.contact_gap[:-1, list(pair.columns)].min(axis=1) > -FAST * size
    fast = outside & (way > FAST * size)
    if not _balls(pair):
        spin = np.linalg.norm(record.motion.angular_velocity[:-1, list(pair.bodies)], axis=2).max(axis=1)
        fast &= spin * pair.rollout.dt < MOST_TURN
    counts = np.minimum(np.ceil(way / (FINENESS * size)), MOST_PLACES)
    return [(int(k), np.linspace(0, 1, int(counts[k]) + 1)[1:]) for k in np.flatnonzero(fast)]


def relative(pair: SurfacePair, record: Record) -> Array:
    """(N + 1, 3) [m]: the first body's place, as seen from the second."""
    place = record.motion.position
    return place[:, pair.first] - (0 if pair.second is None else place[:, pair.second])


def _balls(pair: SurfacePair) -> bool:
    """Whether turning changes nothing."""
    sides = [side for side in (pair.pair.first, pair.pair.second) if side.body is not None]
    return all(_is_ball(pair.rollout.world.surface(side)) for side in sides)


def _is_ball(surface: Surface) -> bool:
    """Whether it is a sphere about its body's centre of mass."""
    return isinstance(surface, SolidShape) and surface.central


def _between(pair: SurfacePair, record: Record, k: int, places: Array) -> Array:
    """(m, 2, 7): poses of both bodies at these shares of step k."""
    poses = np.zeros((len(places), 2, 7))
    poses[:, :, 3] = 1
    for side, body in enumerate(pair.bodies):
        ends = [np.concatenate([of[k + i, body] for of in _fields(record)]) for i in range(2)]
        if ends[0][3:] @ ends[1][3:] < 0:
            ends[1][3:] *= -1
        poses[:, side] = (1 - places[:, None]) * ends[0] + places[:, None] * ends[1]
    poses[:, :, 3:] /= np.linalg.norm(poses[:, :, 3:], axis=2, keepdims=True)
    return poses


def _fields(record: Record) -> tuple[Array, Array]:
    return record.motion.position, record.motion.orientation
