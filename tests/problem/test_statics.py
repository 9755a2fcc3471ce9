"""Blocks and terrain: what stands still besides planes."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from symphys.model.shapes import Box, Capsule, Fixture, Plane, Sphere, Terrain, contact_points
from symphys.problem import Problem

Load = Callable[..., Problem]

BASE = """
[simulation]
duration = 1.0
dt = 0.01

[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0.5, 0.25, 2]
"""
RAMP = """
[[block]]
name = "ramp"
shape = { box = { size = [2, 1, 0.2] } }
position = [1, 0, 0.5]
orientation = { pitch_deg = 90 }
friction = 0.3
restitution = 0.5
rolling = 0.01
"""
GRID = """
[[terrain]]
name = "dunes"
heights = [[0, 0.1, 0.2], [0, 0.1, 0.3]]
spacing = [0.5, 0.25]
origin = [0, -1]
"""
HILLS = '[[terrain]]\nname = "hills"\nheight = "0.1 * sin(3 * x) * cos(2 * y)"\nfriction = 0.7\n'


def test_a_block(load: Load) -> None:
    problem = load(text=BASE + RAMP)
    (ramp,) = problem.world().statics
    assert isinstance(ramp, Fixture)
    assert isinstance(ramp.shape, Box)
    assert (ramp.name, ramp.shape.half_sizes, ramp.shape.centre) == ("ramp", (1, 0.5, 0.1), (1, 0, 0.5))
    assert ramp.shape.orientation == pytest.approx((np.sqrt(0.5), 0, np.sqrt(0.5), 0))
    (pair,) = problem.world().pairs
    assert pair.name == "ball-ramp"
    assert (pair.law.friction, pair.law.restitution, pair.law.rolling) == (0.3, 0.5, 0.01)
    found = {name: value.tolist() for name, value in problem.parameters.items() if name.startswith("ramp")}
    assert found == {
        "ramp.position": [1, 0, 0.5],
        "ramp.friction": [0.3],
        "ramp.restitution": [0.5],
        "ramp.rolling": [0.01],
    }


def test_blocks_of_every_shape(load: Load) -> None:
    text = '[[block]]\nname = "{}"\nshape = {{ {} }}\n'
    blocks = {"post": "capsule = { radius = 0.1, length = 2 }", "knob": "sphere = { radius = 0.3 }"}
    world = load(text=BASE + "".join(text.format(*item) for item in blocks.items()) + "[ground]\n" + GRID).world()
    shapes = [static.shape for static in world.statics if isinstance(static, Fixture)]
    assert shapes == [Capsule(0.1, 1.0), Sphere(0.3)]
    assert [static.name for static in world.statics] == ["ground", "post", "knob", "dunes"]
    assert isinstance(world.statics[0], Plane)


def test_a_variable_may_move_a_block(load: Load) -> None:
    text = BASE + RAMP + '[[variable]]\nname = "where"\nsets = "ramp.position[0:2]"\nlower = [0.5, -1]\n'
    problem = load(text=text)
    assert problem.variables[0].guess.tolist() == [1, 0]
    place = ca.SX.sym("place", 3)
    (ramp,) = problem.world({"ramp.position": place}).statics
    assert isinstance(ramp, Fixture)
    moved = ca.Function("f", [place], [ca.vertcat(*ramp.shape.centre)])
    assert np.array(moved([1, 2, 3])).ravel().tolist() == [1, 2, 3]


def height(problem: Problem, x: float, y: float) -> float:
    (terrain,) = problem.world().statics
    assert isinstance(terrain, Terrain)
    return float(terrain.height(x, y))


def test_terrain_by_a_formula(load: Load) -> None:
    problem = load(text=BASE + HILLS)
    assert height(problem, 0.4, 0.7) == pytest.approx(0.1 * np.sin(1.2) * np.cos(1.4))
    assert problem.parameters["hills.friction"] == 0.7
    assert [pair.name for pair in problem.world().pairs] == ["ball-hills"]
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    symbolic = ca.Function("f", [x, y], [problem.world().statics[0].height(x, y)])  # type: ignore[union-attr]
    assert float(symbolic(0.4, 0.7)) == height(problem, 0.4, 0.7)


def test_level_terrain(load: Load) -> None:
    assert height(load(text=BASE + '[[terrain]]\nname = "shelf"\nheight = "1 / 4"\n'), 3, 4) == 0.25


def test_terrain_by_heights(load: Load) -> None:
    problem = load(text=BASE + GRID)
    assert height(problem, 0.5, -1) == pytest.approx(0.1)
    assert height(problem, 1.0, -0.75) == pytest.approx(0.3)
    assert height(problem, 0.25, -1) == pytest.approx(0.05)


def test_one_spacing_counts_for_both_directions(load: Load) -> None:
    text = GRID.replace("[0.5, 0.25]", "2").replace("origin = [0, -1]", "")
    assert height(load(text=BASE + text), 4, 2) == pytest.approx(0.3)


@pytest.mark.parametrize("text", [GRID, HILLS])
def test_terrain_travels_to_other_processes(load: Load, text: str) -> None:
    problem = load(text=BASE + text)
    assert height(pickle.loads(pickle.dumps(problem)), 0.3, 0.2) == height(problem, 0.3, 0.2)


def test_settings_reach_blocks_and_terrain(load: Load) -> None:
    settings = {"block.ramp.friction": 0.9, "block.ramp.shape.box.size.0": 5, "terrain.hills.friction": 0.2}
    problem = load(text=BASE + RAMP + HILLS, settings=settings)
    assert (problem.parameters["ramp.friction"], problem.parameters["hills.friction"]) == (0.9, 0.2)
    ramp = problem.world().statics[0]
    assert isinstance(ramp, Fixture)
    assert isinstance(ramp.shape, Box)
    assert ramp.shape.half_sizes[0] == 2.5


@pytest.mark.slow
def test_surfaces_that_touch_in_several_points(load: Load) -> None:
    box = BASE.replace("sphere = { radius = 0.1 }", "box = { size = [1, 1, 1] }")
    second = box[box.index("[[body]]") :].replace("ball", "other").replace("[0.5, 0.25, 2]", "[0.5, 0.25, 9]")
    names = [pair.name for pair in load(text=box + second + GRID + RAMP).world().pairs]
    cube = Box((0.5, 0.5, 0.5))
    each, down = contact_points(cube, cube), contact_points(cube, Terrain("dunes", max))
    assert names[:each] == [f"ball-ramp:{k}" for k in range(each)]
    assert names[each : each + down] == [f"ball-dunes:{k}" for k in range(down)]
    assert sum(name.startswith("ball-other:") for name in names) == each
    assert len(set(names)) == len(names)


@pytest.mark.slow
def test_all_points_of_a_pair_have_one_law(load: Load) -> None:
    box = BASE.replace("sphere = { radius = 0.1 }", "box = { size = [1, 1, 1] }") + GRID
    table = '[[pair]]\nbetween = ["ball", "dunes"]\nfriction = 0.25\n'
    pairs = load(text=box + table).world().pairs
    assert len(pairs) > 1
    assert {pair.law.friction for pair in pairs} == {0.25}
