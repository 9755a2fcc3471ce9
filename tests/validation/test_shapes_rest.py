"""Boxes, capsules and stacks of them come to rest, and stay; cases V10 and V11 with these shapes."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab
from tools.repeats import few, thorough
from worlds.blocks import among, block, drift, rod, stack, turned_by, unrest

from symphys.model.shapes import Box, Capsule, Fixture, Plane, Static
from symphys.model.world import Body, Law, Scheme, make_world

MOST_DRIFT, MOST_TURN, STILL = 1e-4, 0.01, 1e-6
"""[m], [degrees] in 10 s, and [m/s], [rad/s] at the end."""
SLAB = Fixture("slab", Box((2.0, 1.5, 0.2), (0.1, 0.05, -0.2)))
BODIES = {
    "cube": (block("b", (0.5, 0.5, 0.5)), 0.5),
    "brick": (block("b", (0.5, 0.3, 0.1), 3.0), 0.1),
    "tower": (block("b", (0.1, 0.3, 0.6), 3.0), 0.6),
    "rod": (rod("b", 0.1, 0.4), 0.1),
}
GROUNDS: dict[str, Static] = {"plane": Plane.ground(), "slab": SLAB}


@cache
def lab(body: str, ground: str) -> Lab:
    """With the restitution as a parameter."""
    e = ca.SX.sym("e")
    return Lab(make_world([BODIES[body][0]], [GROUNDS[ground]], Law(0.5, e)), Scheme(), parameters=[e])


@few(
    ("body", "ground"),
    [
        thorough("cube", "plane"),
        ("brick", "plane"),
        thorough("tower", "plane"),
        ("rod", "plane"),
        thorough("brick", "slab"),
        thorough("rod", "slab"),
    ],
    1,
)
def test_what_is_put_down_stays(body: str, ground: str) -> None:
    """Ten seconds at rest, ten sweeps. The first steps find the forces; from then on nothing moves at all."""
    states = lab(body, ground).states({"b.position": [0.2, 0.1, BODIES[body][1]]}, 10.0, p=[0.0])
    moved, turned = drift(states, "b")
    assert moved < MOST_DRIFT
    assert turned < MOST_TURN
    assert unrest(states, "b") < 1e-12
    assert drift(states, "b", since=200)[0] < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_v11_box_dropped_from_1_rests_at_half(restitution: float) -> None:
    """Brax: of side 1."""
    states = lab("cube", "plane").states({"b.position": [0, 0, 1.0]}, 3.0, p=[restitution])
    assert states["b.position"][-1, 2] == pytest.approx(0.5, abs=1e-9)
    assert unrest(states, "b") < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(("body", "height"), [("brick", 0.1), ("rod", 0.1)])
@pytest.mark.parametrize("ground", ["plane", thorough("slab")])
def test_what_falls_turned_comes_to_rest(body: str, height: float, ground: str) -> None:
    """On its broad side, after bounces on corners, edges and ends."""
    start = {"b.position": [0.2, 0.1, 0.8], "b.orientation": turned_by((0.6, 0.8, 0.0), 0.4)}
    states = lab(body, ground).states(start, 6.0, p=[0.3])
    assert states["b.position"][-1, 2] == pytest.approx(height, abs=1e-6)
    assert unrest(states, "b") < STILL
    assert drift(states, "b", since=500)[0] < STILL


@pytest.mark.thorough
def test_v11_box_on_box() -> None:
    """Brax: of half sizes .2 and .1, rests at .2 and .5 (on top .3 more)."""
    world = stack([block("low", (0.2, 0.2, 0.2)), block("high", (0.1, 0.1, 0.1))], Law(0.5, 0.0))
    states = Lab(world, Scheme()).states({"low.position": [0, 0, 0.3], "high.position": [0.05, 0, 0.65]}, 2.0)
    assert states["low.position"][-1, 2] == pytest.approx(0.2, abs=1e-9)
    assert states["high.position"][-1, 2] == pytest.approx(0.5, abs=1e-9)
    assert max(unrest(states, name) for name in ("low", "high")) < STILL


@pytest.mark.thorough
def test_v11_capsules_rest_on_each_other() -> None:
    """Brax: rest heights .5, .25 and 1.25: one on end, one on its side, a short one (a ball) on top of the first."""
    tall = Body("tall", 1.0, (0.05, 0.05, 0.02), (Capsule(0.25, 0.25),))
    bodies = [tall, rod("flat", 0.25, 0.5), Body("top", 0.5, 0.02, (Capsule(0.25, 0.0),))]
    world = among(make_world(bodies, [Plane.ground()], Law(0.8, 0.0)), {(0, None), (1, None), (0, 2)})
    start = {"tall.position": [0, 0, 0.6], "flat.position": [0, 2, 0.4], "top.position": [0, 0, 1.5]}
    states = Lab(world, Scheme()).states(start, 1.5)
    for name, height in (("tall", 0.5), ("flat", 0.25), ("top", 1.25)):
        assert states[f"{name}.position"][-1, 2] == pytest.approx(height, abs=1e-6)
        assert unrest(states, name) < STILL


@pytest.mark.thorough
def test_rods_lie_across_rods() -> None:
    """Two side by side carry one across them, which touches each in one point."""
    bodies = [rod("left", 0.1, 0.5), rod("right", 0.1, 0.5), rod("top", 0.1, 0.5)]
    start: dict[str, Any] = {"left.position": [0, -0.3, 0.1], "right.position": [0, 0.3, 0.1]}
    start |= {"top.position": [0, 0, 0.31], "top.orientation": turned_by((0, 0, 1), np.pi / 2)}
    world = among(make_world(bodies, [Plane.ground()], Law(0.5, 0.0)), {(0, None), (1, None), (0, 2), (1, 2)})
    states = Lab(world, Scheme()).states(start, 2.0)
    assert states["top.position"][-1] == pytest.approx([0, 0, 0.3], abs=1e-4)
    assert unrest(states, "top") < STILL


def tower(lab: Lab, masses: list[float], gap: float, time: float) -> tuple[float, float]:
    """(height error, unrest) of a tower of cubes, put down or dropped with gaps, beside each other by up to 2 cm."""
    count = len(masses)
    aside = np.random.default_rng(0).uniform(-0.02, 0.02, (count, 2)) * (gap > 0)
    start = {f"b{i}.position": [*aside[i], 0.2 + 0.4 * i + gap * (i + 1)] for i in range(count)}
    states = lab.states(start, time, p=masses)
    heights = np.array([states[f"b{i}.position"][-1, 2] for i in range(count)])
    return float(np.abs(heights - 0.2 - 0.4 * np.arange(count)).max()), max(
        unrest(states, f"b{i}") for i in range(count)
    )


@cache
def tower_lab(count: int, sweeps: int) -> Lab:
    masses = [ca.SX.sym(f"m{i}") for i in range(count)]
    cubes = [block(f"b{i}", (0.2, 0.2, 0.2), m) for i, m in enumerate(masses)]
    return Lab(stack(cubes, Law(0.5, 0.0)), Scheme(sweeps=sweeps), parameters=masses)


@pytest.mark.thorough
@pytest.mark.parametrize(("masses", "gap"), [([1, 1, 1], 0.0), ([1, 3, 1], 0.0), ([1, 1, 1], 0.02)])
def test_three_boxes_stand(masses: list[float], gap: float) -> None:
    """With ten sweeps."""
    error, velocity = tower(tower_lab(3, 10), masses, gap, 2.0)
    assert error < 1e-7
    assert velocity < STILL


@pytest.mark.thorough
@pytest.mark.parametrize("gap", [0.0, 0.02])
@pytest.mark.parametrize(
    ("sweeps", "masses"), [(10, [1, 1, 1, 1, 1]), (10, [1, 3, 1, 3, 1]), (20, [1, 1, 1, 1, 1]), (20, [1, 1, 1, 1, 8])]
)
def test_five_boxes_stand(sweeps: int, masses: list[float], gap: float) -> None:
    """Ten seconds. Equal ones with ten sweeps; eight times the mass on top of four takes twenty."""
    error, velocity = tower(tower_lab(5, sweeps), masses, gap, 10.0)
    assert error < 1e-7
    assert velocity < STILL


PEDESTAL = Fixture("pedestal", Box((0.5, 0.5, 0.2), (0, 0, -0.2)))
TABLE = Fixture("table", Box((2.0, 2.0, 0.2), (-2.0, 0, -0.2)))
PLANK, BEAM = block("b", (0.8, 0.08, 0.06)), Fixture("beam", Box((1.0, 0.06, 0.1), (0, 0, -0.1)))


def put_down(body: Body, ground: Static, x: float, yaw: float) -> dict[str, Any]:
    """The states of 0.6 s of a box that is put down turned."""
    height = body.shapes[0].half_sizes[2]  # type: ignore[union-attr]
    start = {"b.position": [x, 0, height], "b.orientation": turned_by([0, 0, 1], yaw)}
    return Lab(make_world([body], [ground], Law(0.5)), Scheme()).states(start, 0.6)


@pytest.mark.parametrize(
    ("body", "ground", "yaw"),
    [
        (BODIES["cube"][0], PEDESTAL, 0.6),  # the faces share an octagon
        pytest.param(PLANK, BEAM, 0.35, marks=pytest.mark.slow),  # a long parallelogram
        pytest.param(BODIES["cube"][0], PEDESTAL, np.pi / 4, marks=pytest.mark.slow),
    ],
)
def test_four_points_carry_what_faces_of_many_corners_share(body: Body, ground: Static, yaw: float) -> None:
    states = put_down(body, ground, 0.0, yaw)
    assert max(drift(states, "b")) < 1e-6
    assert unrest(states, "b") < 1e-12


@pytest.mark.parametrize(("beyond", "falls"), [(-0.001, False), (0.001, True)])
def test_a_turned_box_falls_when_its_middle_is_past_an_edge(beyond: float, falls: bool) -> None:
    """It hangs over an edge with one corner: the region that carries it has five."""
    _, turned = drift(put_down(BODIES["cube"][0], TABLE, beyond, 0.4), "b")
    assert (turned > 0.1) == falls
