"""Frames of contacts: unit normals from the second to the first, arms to the surfaces; and every derivative."""

from __future__ import annotations

import numpy as np
import pytest
from tools.distances import Solid, distance
from tools.repeats import few
from worlds.meetings import Thing, flying, later, met, moved_to, random_thing, rule
from worlds.slopes import compared, some_way

from symphys.types import Array

KINDS = ("sphere", "capsule", "box")
PAIRS = [(a, b) for a in KINDS for b in KINDS]
DT = 0.01


def meeting(rng: np.random.Generator, pair: tuple[str, str], spin: float = 1.0) -> tuple[Thing, Thing]:
    """Two turning things that meet within the step."""
    b = random_thing(rng, pair[1])
    a = moved_to(random_thing(rng, pair[0]), b, 0.005, rng)
    found = met(rule(*pair), *a.numbers(), *b.numbers(), DT)
    towards = -found.normal[np.argmin(found.gap)] + 0.2 * rng.normal(size=3)
    turning = spin * rng.normal(size=(2, 3))
    return flying(a, 1.0 + 0 * towards + towards, turning[0]), flying(b, [1.0, 1.0, 1.0], turning[1])


def from_surface(point: Array, solid: Solid) -> float:
    """How far a point is from a surface [m], on either side of it: at most, inside of boxes."""
    return abs(distance(Solid(point, np.eye(3), np.zeros(3), 0.0), solid))


@few("pair", PAIRS, 1)
def test_frames_at_the_touch(pair: tuple[str, str]) -> None:
    """One point in space, on both surfaces, and a step along the normal parts them.

    Where edges cross it lies where they were expected to meet; until they do, they slide past each other.
    """
    rng, function, hits = np.random.default_rng(4), rule(*pair), 0
    for _ in range(12):
        a, b = meeting(rng, pair)
        found = met(function, *a.numbers(), *b.numbers(), DT)
        assert np.linalg.norm(found.normal, axis=1) == pytest.approx(np.ones(len(found.gap)), abs=1e-9)
        if not found.hit.any():
            continue
        k = int(np.argmin(np.where(found.hit > 0, found.time, np.inf)))
        t, n = found.time[k], found.normal[k]
        points = [x.centre_of_mass(t) + arm[k] for x, arm in zip((a, b), found.arms, strict=True)]
        assert points[0] == pytest.approx(points[1], abs=1e-9)
        assert max(from_surface(p, x.at(t)) for p, x in zip(points, (a, b), strict=True)) < 5e-4
        aside = distance(flying(a, a.motion[7:10] + 0.01 * n / t, a.motion[13:16]).at(t), b.at(t))
        assert aside == pytest.approx(0.01, abs=1e-3)
        hits += 1
    assert hits >= 6


@few("pair", PAIRS, 5)
def test_gap_after_displacements(pair: tuple[str, str]) -> None:
    """The gap at the end is that of the shapes where small displacements have put them, to second order."""
    rng, errors = np.random.default_rng(6), []
    for _ in range(10):
        b = random_thing(rng, pair[1])
        a = moved_to(random_thing(rng, pair[0]), b, 1e-3, rng)
        shifts = 1e-3 * rng.normal(size=(2, 6))
        gaps = np.array(later(*pair)(*a.numbers(), *b.numbers(), DT, *shifts)).ravel()
        ends = [put(x, shift) for x, shift in zip((a, b), shifts, strict=True)]
        errors.append(gaps.min() - distance(ends[0], ends[1]))
    assert np.sort(np.abs(errors))[-2] < 2e-5
    assert np.median(np.abs(errors)) < 5e-6


def put(x: Thing, shift: Array) -> Solid:
    """Where a displacement puts a thing that lies still."""
    return flying(x, shift[:3] / DT, shift[3:] / DT).at(DT)


@few("pair", [*PAIRS, ("sphere", ""), ("capsule", ""), ("box", "")], 4)
def test_derivatives_of_gap_rate_time_and_frame(pair: tuple[str, str]) -> None:
    """Along random directions of sizes, places on the bodies, poses and motions, at random meetings."""
    rng, worst = np.random.default_rng(8), []
    for _ in range(10):
        if pair[1]:
            a, b = meeting(rng, pair)
            z = np.concatenate([*a.numbers(), *b.numbers(), [DT]])
        else:
            a = flying(random_thing(rng, pair[0]), [1, 0, -2], rng.normal(size=3), [0, 0, -9.81])
            lift = 0.1 * np.sin(3 * a.motion[0]) * np.cos(2 * a.motion[1]) + 0.6 - a.motion[2]
            z = np.concatenate([*a.numbers(), np.zeros(26), [DT]])
            z[len(a.size) + 7 + 2] += lift
        exact, differences = compared(pair, z, some_way(rng, z, pair), terrain=not pair[1])
        worst.append(np.abs(exact - differences).max(initial=0) / (1 + np.abs(exact).max(initial=0)))
    assert np.sort(worst)[-2] < 1e-6


def test_the_check_rejects_a_wrong_derivative() -> None:
    rng = np.random.default_rng(8)
    a, b = meeting(rng, ("box", "box"))
    z = np.concatenate([*a.numbers(), *b.numbers(), [DT]])
    one, other = (some_way(rng, z, ("box", "box")) for _ in range(2))
    assert compared(("box", "box"), z, one)[0] != pytest.approx(compared(("box", "box"), z, other)[1], rel=1e-2)
