"""The direction that keeps two solids apart, and when they come to overlap along it.

The nearest points of the solids' cores give a first direction (Gilbert, Johnson and Keerthi, A fast procedure for
computing the distance between complex objects in three-dimensional space, 1988). Cores lie within the solids, so that
these may touch, and overlap by a tenth of a smallest half size, and still have one. The direction is then that of the
normal of a face, or of an edge across an edge, near it, whichever keeps the solids farther apart; or where a corner or
a rim is nearest, the direction itself, as it is when they meet.
"""

from __future__ import annotations

from itertools import combinations

import casadi as ca

from symphys.dynamics.collision.box_geometry import (
    EDGE_MARGIN,
    MAX_STEP_UP,
    MAX_STEP_UP_SHARE,
    MIN_OVERLAP,
    PARALLEL,
    crossed,
    is_nearly_vertical,
)
from symphys.dynamics.collision.predicted_path import Parabola, chosen
from symphys.dynamics.collision.solids import MovingSolid
from symphys.dynamics.collision.witness_points import steady
from symphys.dynamics.tracing.decorator import traced
from symphys.maths.smoothing import TINY_SQUARE
from symphys.records import dataclass
from symphys.types import Expr

ROUNDS = (9, 1), (7, 2)
"""Steps of the search where the solids are, and again where they are expected to meet, and choices of a direction: what
is turned to the one that was chosen leads to a better one."""
MIN_SQUARE = 1e-24
"""Squared area or length, by the solids' size, below which points of the search are in a line, or one."""
FAR = 1e3
"""Times the solids' size: more than any distance."""


@dataclass(frozen=True)
class SeparatingDirection:
    """The direction that separates two solids within a step.

    Attributes:
        direction: its path, from the second to the first.
        time: when they begin to overlap along it [s]; 0 if they do from the start, the end of the step if never.
        distance: along it, at the start [m].
        apart: 1 if they do not overlap along it within the step.
        nearest: paths of points of both that are nearest to each other, seen along it.
        farthest: 1 if along none of the directions that were tried they are farther apart, and no top was preferred.
    """

    direction: Parabola
    time: Expr
    distance: Expr
    apart: Expr
    nearest: tuple[Parabola, Parabola]
    farthest: Expr


def separation_of(a: MovingSolid, b: MovingSolid, dt: Expr) -> SeparatingDirection:
    """Return how two solids are kept apart within a step, by traced parts."""
    away, time, found = _between_centres(a, b), ca.SX(0), None
    for rounds, choices in ROUNDS:
        away, place = nearest_of_cores(a, b, away, time, rounds)
        farthest: Expr = ca.SX(1)
        for _ in range(choices):
            found = _along(a, b, away, place, time, dt, farthest)
            away, time, farthest = _now(found), found.time, found.farthest
    assert found is not None
    return found


@traced
def _between_centres(a: MovingSolid, b: MovingSolid) -> Expr:
    """Return the vector (3,) from the second centre to the first; upwards where that is none."""
    apart = (a.centre - b.centre).start
    return apart + ca.if_else(ca.dot(apart, apart) > TINY_SQUARE, 0, 1) * ca.vertcat(0, 0, _size(a, b))


@traced
def _now(found: SeparatingDirection) -> Expr:
    return found.direction.at(found.time)


def _size(a: MovingSolid, b: MovingSolid) -> Expr:
    return a.solid.size + b.solid.size


@dataclass(frozen=True)
class Simplex:
    """Four differences of points of two cores: the first's points, the differences, and shares of the nearest point."""

    firsts: tuple[Expr, ...]
    points: tuple[Expr, ...]
    shares: tuple[Expr, ...]


def nearest_of_cores(a: MovingSolid, b: MovingSolid, away: Expr, t: Expr, rounds: int) -> tuple[Expr, Expr]:
    """Return the shortest vector (3,) from the core of the second to that of the first, and the first's end of it.

    ``away``: a guess.
    """
    simplex, away = _simplex_at(a, b, away, t)
    for _ in range(rounds):
        simplex, away = _nearer(a, b, simplex, away, t)
    return away, _place(simplex)


@traced
def _simplex_at(a: MovingSolid, b: MovingSolid, away: Expr, t: Expr) -> tuple[Simplex, Expr]:
    first = a.core(-away, t)
    point = first - b.core(away, t)
    return Simplex((first,) * 4, (point,) * 4, (ca.SX(1), ca.SX(0), ca.SX(0), ca.SX(0))), point


@traced
def _nearer(a: MovingSolid, b: MovingSolid, simplex: Simplex, away: Expr, t: Expr) -> tuple[Simplex, Expr]:
    firsts, points, shares = list(simplex.firsts), list(simplex.points), simplex.shares
    first, free = a.core(-away, t), ca.SX(1)
    new = first - b.core(away, t)
    for k in range(4):  # the new point takes the place of the first one without a share
        taken = ca.logic_and(free, shares[k] <= 0)
        firsts[k], points[k] = ca.if_else(taken, first, firsts[k]), ca.if_else(taken, new, points[k])
        free = ca.logic_and(free, ca.logic_not(taken))
    away, found = _nearest_to_origin(points, _size(a, b))
    return Simplex(tuple(firsts), tuple(points), tuple(found)), away


@traced
def _place(simplex: Simplex) -> Expr:
    return sum(share * point for share, point in zip(simplex.shares, simplex.firsts, strict=True))


def _nearest_to_origin(points: list[Expr], size: Expr) -> tuple[Expr, list[Expr]]:
    """Return the point (3,) of the faces of a tetrahedron that is nearest to the origin, and the shares of its corners.

    Corners may coincide. At most three shares are not 0.
    """
    dots = [[ca.dot(one, other) for other in points] for one in points]
    least, shares = dots[0][0], [ca.SX(1), ca.SX(0), ca.SX(0), ca.SX(0)]

    def offer(square: Expr, allowed: Expr, numbers: dict[int, Expr]) -> None:
        nonlocal least, shares
        better = ca.logic_and(allowed, square < least)
        least = ca.if_else(better, square, least)
        shares = [ca.if_else(better, numbers.get(k, ca.SX(0)), shares[k]) for k in range(4)]

    for k in range(1, 4):
        offer(dots[k][k], ca.SX(1), {k: ca.SX(1)})
    for i, j in combinations(range(4), 2):
        length = dots[i][i] - 2 * dots[i][j] + dots[j][j]
        apart = length > MIN_SQUARE * size * size
        share = (dots[i][i] - dots[i][j]) / ca.if_else(apart, length, 1)
        within = ca.logic_and(apart, ca.logic_and(share > 0, share < 1))
        offer(dots[i][i] - share * share * length, within, {i: 1 - share, j: share})
    for i, j, k in combinations(range(4), 3):
        crosses = [ca.cross(points[m], points[n]) for m, n in ((j, k), (k, i), (i, j))]
        normal = crosses[0] + crosses[1] + crosses[2]
        area = ca.dot(normal, normal)
        wide = area > MIN_SQUARE * size**4
        parts = [ca.dot(normal, each) / ca.if_else(wide, area, 1) for each in crosses]
        within = wide
        for part in parts:
            within = ca.logic_and(within, part > 0)
        height = ca.dot(normal, points[i])
        offer(height * height / ca.if_else(wide, area, 1), within, dict(zip((i, j, k), parts, strict=True)))
    found: Expr = sum(share * point for share, point in zip(shares, points, strict=True))
    return found, shares


@traced
def _along(
    a: MovingSolid, b: MovingSolid, away: Expr, place: Expr, t: Expr, dt: Expr, before: Expr
) -> SeparatingDirection:
    """Choose among directions near a vector; see the module.

    Args:
        a: the first.
        b: the second.
        away: (3,) from the second to the first.
        place: (3,) where the first's core is nearest.
        t: when they are looked at [s].
        dt: length of the step [s].
        before: 0 where a choice before preferred a top.
    """
    still, size = ca.SX.zeros(3), _size(a, b)
    away = away / ca.sqrt(ca.dot(away, away) + TINY_SQUARE)
    near = Parabola(away, still, still)
    gravity = a.path.gravity if a.path.gravity is not None else b.path.gravity
    # each direction with what it gains: edges must be farther apart than faces, tops are preferred
    step = ca.fmin(MAX_STEP_UP, MAX_STEP_UP_SHARE * ca.fmin(a.solid.size, b.solid.size))
    tried: list[tuple[Parabola, Expr, Expr]] = [(near, -EDGE_MARGIN * size, ca.SX(0))]
    for across in (one.cross(other) for one in a.edges(-away, t) for other in b.edges(away, t)):
        turned = ca.if_else(ca.dot(across.at(t), away) >= 0, 1, -1) * across
        tried.append((turned, -EDGE_MARGIN * size / 2, ca.SX(0)))
    turned_to = [away] if gravity is None else [away, ca.if_else(ca.dot(away, gravity) >= 0, 1, -1) * gravity]
    for sign, face in ((sign, face) for d in turned_to for sign, face in ((-1, a.face(-d, t)), (1, b.face(d, t)))):
        top: Expr = ca.SX(0)
        if gravity is not None:
            top = ca.logic_and(is_nearly_vertical(face.normal.start, gravity), face.flat)
        tried.append((sign * face.normal, ca.SX(0), ca.if_else(top, step, 0)))
    # how far they are apart along each; what overlaps does so along its own direction, whatever it may come onto
    gaps = []
    for direction, _, _ in tried:
        now = direction.at(t)
        known = ca.dot(now, now) > PARALLEL * (ca.dot(now, now) + 1)
        gaps.append(ca.if_else(known, _apart(a, b, direction, t), -FAR * size))
    highest = ca.mmax(ca.vertcat(*gaps))
    meets = highest > -MIN_OVERLAP
    best, own, most = near, gaps[0], gaps[0] + tried[0][1]
    for gap, (direction, gained, preferred) in zip(gaps[1:], tried[1:], strict=True):
        score = gap + gained + ca.if_else(meets, preferred, 0)
        better = score >= most
        best, most, own = chosen(better, direction, best), ca.if_else(better, score, most), ca.if_else(better, gap, own)
    # when they begin to overlap along it
    first, last = _apart(a, b, best, ca.SX(0)), _apart(a, b, best, dt)
    met = ca.if_else(first > 0, crossed(first, last), 0)
    now = best.at(t)
    unit = now / ca.sqrt(ca.dot(now, now) + TINY_SQUARE)
    nearest = a.outermost(place, -unit, t), b.outermost(place, unit, t)
    farthest = ca.logic_and(before, own >= highest - 3 * EDGE_MARGIN * size)
    apart = ca.logic_and(first > 0, last > 0)
    return SeparatingDirection(steady(best, met * dt, dt), met * dt, first, apart, nearest, farthest)


def _apart(a: MovingSolid, b: MovingSolid, direction: Parabola, t: Expr) -> Expr:
    """Return how far two solids are apart along a direction at time t [m]; negative where they overlap along it."""
    now = direction.at(t)
    unit = now / ca.sqrt(ca.dot(now, now) + TINY_SQUARE)
    return ca.dot(unit, (a.centre - b.centre).at(t)) - a.reach(-unit, t) - b.reach(unit, t)
