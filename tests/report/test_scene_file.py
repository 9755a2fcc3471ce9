"""scene.json is read as it is written; a shape, fixture or terrain that is damaged is left out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.yard import write_yard

from symphys.model.shapes import Convex, Cylinder, Ellipsoid, Shape
from symphys.results.scene import Scene, Solid, read_scene
from symphys.results.scene_of_problem import make_solid


def test_scene_is_read(tmp_path: Path) -> None:
    scene = read_scene(write_yard(tmp_path) / "scene.json")
    (crate,), (handle, head, ball) = scene.solids("crate"), scene.solids("hammer")
    assert (crate.half.tolist(), crate.radius, crate.girth) == ([0.2, 0.15, 0.1], 0, 0.1)
    assert (handle.half.tolist(), handle.radius, handle.girth) == ([0, 0, 0.3], 0.05, 0.05)
    assert head.orientation.tolist() == [1, 0, 0, 0]
    assert ball.is_ball
    assert [fixture.name for fixture in scene.fixtures] == ["ramp", "post"]
    (hills,) = scene.terrain
    assert hills.z.shape == (3, 17)
    assert np.isnan(hills.z[2]).all()


@pytest.mark.parametrize(
    "shape",
    [Cylinder(0.1, 0.2), Ellipsoid((0.1, 0.2, 0.3)), Convex(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, -1)), (1, 2, 3))],
)
def test_solids_are_read_as_they_are_written(shape: Shape) -> None:
    solid = make_solid(shape)
    read = Solid.from_json(json.loads(json.dumps(solid.to_json())))
    assert read is not None
    assert (read.kind, read.corners.tolist()) == (shape.kind, [list(each) for each in shape.rounded_hull.corners])
    assert read.to_json() == solid.to_json()


@pytest.mark.parametrize(
    "broken",
    [
        {"kind": "box", "size": [1, 0, 1]},
        {"kind": "box", "size": [1, 1]},
        {"kind": "box"},
        {"kind": "capsule", "radius": 1, "length": "inf"},
        {"kind": "capsule", "radius": -1, "length": 1},
        {"kind": "torus", "radius": 1},
        {"kind": "cylinder", "radius": 1, "length": -1},
        {"kind": "ellipsoid", "radii": [1, 0, 1]},
        {"kind": "convex", "points": []},
        {"kind": "convex", "points": 3},
        {"kind": "convex", "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]},
        {"kind": "convex", "points": [[0, 0, 0], [1, 0], [0, 1, 0], [1, 1, 1]]},
        {"kind": "sphere"},
        {"kind": "sphere", "radius": 1, "centre": [0, "inf", 0]},
        {},
    ],
)
def test_shapes_that_cannot_be_read_are_left_out(tmp_path: Path, broken: dict[str, Any]) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps({"bodies": [{"name": "a", "shapes": [broken, 3]}], "fixtures": [{"shape": broken}, 3]}))
    assert read_scene(path) == Scene(bodies=read_scene(path).bodies)
    assert read_scene(path).solids("a") == ()


@pytest.mark.parametrize(
    "broken",
    [
        {"z": []},
        {"z": [[1, 2], [3]]},
        {"z": [[1, 2]], "y": [0]},
        {"z": "hills"},
        {"x": [0, 0], "z": [[1, 2], [3, 4]]},
        {"x": [0, "nan"], "z": [[1, 2], [3, 4]]},
    ],
)
def test_terrain_that_cannot_be_read_is_left_out(tmp_path: Path, broken: dict[str, Any]) -> None:
    path = tmp_path / "scene.json"
    entry = {"name": "hills", "x": [0, 1], "y": [0, 1], **broken}
    path.write_text(json.dumps({"terrain": [entry, 3]}))
    assert read_scene(path).terrain == ()
