"""Blocks on slopes, pushed blocks, balls that roll on a block that is pulled; cases V6, V9 and V10."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab
from tools.repeats import thorough
from worlds.blocks import among, block, turned_by

from symphys.model.shapes import Box, Fixture, Plane
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

G, MU = 9.81, 0.6
HEADINGS = np.arange(16) * np.pi / 8
SOME = {"plane": HEADINGS, "box": HEADINGS[1::4]}
"""Directions of slope; a static box, which takes longer, stands for a plane in a few of them."""


@cache
def slope_lab(kind: str) -> Lab:
    """A block on a slope, a plane or the face of a static box, whose normal and orientation are parameters."""
    n, q = ca.SX.sym("n", 3), ca.SX.sym("q", 4)
    normal, turn = tuple(n[i] for i in range(3)), tuple(q[i] for i in range(4))
    box = Box((5.0, 5.0, 0.3), tuple(-0.3 * c for c in normal), turn)
    static = Plane("slope", normal) if kind == "plane" else Fixture("slope", box)
    world = make_world([block("b", (0.2, 0.2, 0.1))], [static], Law(MU, 0.0))
    return Lab(world, Scheme(), parameters=[n, q])


def slides(kind: str, share: float, heading: float, time: float) -> tuple[Array, float]:
    """(speeds, what they would be) of a block on a slope of tan = share mu; straight down is along ``heading``."""
    slope = np.arctan(share * MU)
    turn = turned_by((-np.sin(heading), np.cos(heading), 0), slope)
    normal = np.array([np.sin(slope) * np.cos(heading), np.sin(slope) * np.sin(heading), np.cos(slope)])
    start = {"b.position": 0.1 * normal, "b.orientation": turn}
    states = slope_lab(kind).states(start, time, p=np.concatenate([normal, turn]))
    return np.linalg.norm(states["b.velocity"], axis=1), G * (np.sin(slope) - MU * np.cos(slope)) * time


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["plane", "box"])
def test_v10_block_sticks_below_the_cone(kind: str) -> None:
    """At 0.998 of it, in every direction: it creeps while the first steps find the forces, then does not move."""
    for heading in SOME[kind]:
        speeds, _ = slides(kind, 0.998, heading, 1.0)
        assert speeds.max() < 2e-3
        assert speeds[-20:].max() < 1e-6
        assert speeds.sum() * 0.01 < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "share"), [thorough("plane", 1.002), ("plane", 1.5), thorough("box", 1.002)])
def test_v10_block_slides_above_the_cone(kind: str, share: float) -> None:
    """At 1.002 of it, with the acceleration g (sin - mu cos), once the first steps have found the forces."""
    for heading in SOME[kind]:
        speeds, expected = slides(kind, share, heading, 1.0)
        assert speeds[-1] - speeds[-51] == pytest.approx(expected / 2, rel=1e-3)
        assert speeds[-1] == pytest.approx(expected, abs=1e-3)


H = 0.1


@cache
def push_lab(sweeps: int, newton_start: bool) -> Lab:
    world = make_world([block("b", (0.5, 0.5, 0.5))], [Plane.ground()], Law(1.0, 0.0), (0, 0, -1.0))
    return Lab(world, Scheme(dt=H, sweeps=sweeps, newton_start=newton_start), inputs=["b.force"])


def pushed(force: Sequence[float], sweeps: int = 30, smoothing: float = 0.0, newton_start: bool = True) -> Any:
    """Displacement in one step from rest under a force."""
    lab, start = push_lab(sweeps, newton_start), {"b.position": [0, 0, 0.5]}
    return lab.states(start, H, u=list(force), smoothing=smoothing)["b.position"][-1] - [0, 0, 0.5]


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.5, 0.9, 0.99, 1.0, 1.01, 1.1, 1.5])
def test_v6_push_at_rest(share: float) -> None:
    """Dojo, contact_gradients: nothing below the weight and inside the cone, (F - 1) h^2 / 2 beyond; thirty sweeps."""
    expected = max(share - 1, 0) * H * H / 2
    assert pushed([0, 0, share])[2] == pytest.approx(expected, abs=1e-9)
    assert pushed([share, 0, 0])[0] == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_v6_ten_sweeps_are_not_enough_for_that() -> None:
    """By themselves they leave 0.05 mm at 0.99 of the cone, which is why the case above takes thirty."""
    assert 1e-5 < pushed([0.99, 0, 0], sweeps=10, newton_start=False)[0] < 1e-4


@pytest.mark.slow
def test_v6_smoothing_makes_a_sigmoid_across_the_cone() -> None:
    """Sideways: monotonous up to what sweeps leave, rises before the kink and goes to it with the smoothing."""
    shares = np.linspace(0.5, 1.5, 11)
    kink = np.maximum(shares - 1, 0) * H * H / 2
    errors = []
    for smoothing in (1e-2, 1e-3, 1e-4):
        smooth = np.array([pushed([share, 0, 0], smoothing=smoothing)[0] for share in shares])
        assert (np.diff(smooth) > -1e-8).all()
        assert smooth[4] > smooth[0]
        errors.append(np.abs(smooth - kink).max())
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert errors[2] < 1e-5


def pulled_block(dt: float, cuts: int | None) -> Lab:
    """SimBenchmark, rolling: a block of 10 kg on the ground, mu .4, 25 balls of 1 kg on it, mu .8."""
    balls = [Body.ball(f"s{k}", 0.1, 1.0) for k in range(25)]
    world = make_world([block("box", (2.0, 6.0, 0.1), 10.0), *balls], [Plane.ground()], Law(0.8, 0.0))
    world = among(world, {(0, None)} | {(0, k + 1) for k in range(25)})
    on_ground = Law(0.4, 0.0)
    pairs = tuple(replace(p, law=on_ground) if p.second.body is None else p for p in world.pairs)
    return Lab(World(world.bodies, world.statics, pairs), Scheme(dt=dt, cuts=cuts), inputs=["box.force"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dt", "time", "cuts"),
    [
        (0.01, 1.0, 0),
        pytest.param(0.001, 4.0, 0, marks=pytest.mark.thorough),
        pytest.param(0.01, 4.0, None, marks=pytest.mark.thorough),
    ],
)
def test_v9_balls_roll_on_a_pulled_block(dt: float, time: float, cuts: int | None) -> None:
    """150 N along y: a_box = (F - mu (M + n m) g) / (M + 2/7 n m) = .7385, a_ball = 2/7 of it, so v = 2.954, .844."""
    lab = pulled_block(dt, cuts)
    start = {"box.position": [0, 0, 0.1]}
    start |= {f"s{k}.position": [0.5 * (k % 5 - 2), 0.5 * (k // 5 - 2) + 2, 0.3] for k in range(25)}
    states = lab.states(start, time, u=ca.repmat(ca.DM([0, 150, 0]), 1, round(time / dt)))
    speeds = np.array([states[f"s{k}.velocity"][-1] for k in range(25)])
    assert states["box.velocity"][-1, 1] == pytest.approx(0.7385 * time, rel=1e-3)
    assert speeds[:, 1] == pytest.approx(np.full(25, 0.2110 * time), rel=1e-3)
    assert np.abs(speeds[:, [0, 2]]).max() < 1e-4
    assert states["box.position"][-1, 2] == pytest.approx(0.1, abs=1e-6)
