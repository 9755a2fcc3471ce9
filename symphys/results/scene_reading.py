"""Reading scene.json: what cannot be read is left out of the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from symphys.findings import values
from symphys.model.shapes import SHAPES
from symphys.results import text_files as tables
from symphys.results.drawable import LARGEST, small
from symphys.results.joint_records import make_joints
from symphys.results.records import Array
from symphys.results.scene_records import UPRIGHT, Scene, SceneBody, SceneFixture, ScenePlane, SceneTerrain, Solid

SCENE = "scene.json"


def read_scene(path: Path) -> Scene:
    """Read the bodies, what stands still, the joints and gravity. Raises ReportError."""
    content = tables.read_table(path)
    bodies = tuple(
        SceneBody(values.name(entry.get("name")), make_solids(entry.get("shapes")), values.number(entry.get("mass")))
        for entry in values.tables(content.get("bodies"))
    )
    planes = (make_plane(entry) for entry in values.tables(content.get("planes")))
    fixtures = (make_fixture(entry) for entry in values.tables(content.get("fixtures")))
    terrain = (make_terrain(entry) for entry in values.tables(content.get("terrain")))
    return Scene(
        bodies,
        tuple(plane for plane in planes if plane is not None),
        tuple(fixture for fixture in fixtures if fixture is not None),
        tuple(ground for ground in terrain if ground is not None),
        tuple(make_joints(content.get("joints"))),
        float(np.linalg.norm(values.numbers(content["gravity"]))) if "gravity" in content else np.nan,
    )


def make_solids(shapes: object) -> tuple[Solid, ...]:
    """A body's shapes."""
    found = (make_solid(entry) for entry in values.tables(shapes))
    return tuple(solid for solid in found if solid is not None)


def make_solid(entry: dict[str, object]) -> Solid | None:
    """One of the shapes; None if it has no size and place that can be drawn."""
    shape, centre = SHAPES.get(str(entry.get("kind", "sphere"))), values.vector(entry.get("centre"))
    if shape is None:
        return None
    sizes = {
        key.name: values.number(entry.get(key.name)) if key.count == 1 else values.vector(entry.get(key.name))
        for key in shape.size_keys
    }
    whole = np.concatenate([np.atleast_1d(size) for size in sizes.values()])
    if not (small([*whole, *centre]) and (whole > 0).all()):
        return None
    radius, half = shape.from_sizes(sizes, tuple(centre), UPRIGHT).rounded_box
    return Solid(radius, np.array(half), centre, make_orientation(entry.get("orientation")))


def make_orientation(value: object) -> Array:
    """(4,): a unit quaternion; no rotation for anything that is none."""
    read = values.numbers(value)
    length = float(np.linalg.norm(read)) if read.size == 4 else 0.0
    return read / length if 0 < length < np.inf else np.array(UPRIGHT)


def make_plane(entry: dict[str, object]) -> ScenePlane | None:
    """One of ``planes``; None if it has no direction."""
    normal, offset = values.vector(entry.get("normal")), values.number(entry.get("offset", 0.0))
    length = float(np.linalg.norm(normal))
    if not (0 < length < np.inf and small(offset)):
        return None
    return ScenePlane(values.name(entry.get("name")), normal / length, offset)


def make_fixture(entry: dict[str, object]) -> SceneFixture | None:
    """One of ``fixtures``; None if its shape cannot be read."""
    solid = make_solid(values.table(entry.get("shape")))
    return None if solid is None else SceneFixture(values.name(entry.get("name")), solid)


def make_terrain(entry: dict[str, object]) -> SceneTerrain | None:
    """One of ``terrain``; None if its heights are no grid over rising x and y."""
    x, y, rows = values.numbers(entry.get("x")), values.numbers(entry.get("y")), entry.get("z")
    found = [values.numbers(row) for row in rows] if isinstance(rows, list) else []
    if len(found) != y.size or any(row.size != x.size for row in found) or min(x.size, y.size) < 2:
        return None
    if not all(small(side) and (np.diff(side) > 0).all() for side in (x, y)):
        return None
    z = np.array(found)
    return SceneTerrain(values.name(entry.get("name")), x, y, np.where(np.abs(z) <= LARGEST, z, np.nan))
