"""Geoms of a model that may collide, as shapes of bodies and as what stands still."""

from __future__ import annotations

from typing import Any

import numpy as np

from symphys.importing.tables.meshes import Meshes
from symphys.importing.tables.reading import ModelReading, WeldedLink, is_upright, numbers, quaternion
from symphys.importing.tables.terrain import terrain
from symphys.types import Array

PLANE, TERRAIN, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)
"""MuJoCo's types of geoms."""
FLATTEST = 1e-6
"""Share of its radius that the straight part of a capsule must have."""
Shapes = dict[int, list[tuple[int, dict[str, Any]]]]
"""By the top body of each link: (index of the geom, its table)."""


def collides(reading: ModelReading, geom: int) -> bool:
    """Whether a geom may touch anything."""
    model = reading.model
    paired = geom in model.pair_geom1 or geom in model.pair_geom2
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom] or paired)


def read_shapes(reading: ModelReading) -> Shapes:
    """The shapes of every link: what may touch; of a link without that, what it looks like."""
    touching, drawn = Shapes(), Shapes()
    bare = dict[str, list[int]]()
    meshes = Meshes(reading)
    for geom in range(reading.model.ngeom):
        link = reading.links.get(int(reading.model.geom_bodyid[geom]))
        if link is None:
            continue
        touches = collides(reading, geom)
        if not link.mass:
            bare.setdefault(link.name, []).append(geom)
        elif touches or reading.model.geom_type[geom] != MESH:
            fits = reading.model.geom_type[geom] == MESH and reading.options.meshes == "fit"
            shapes = meshes.fitted(geom) if fits else [solid(reading, geom, meshes)]
            kind = touching if touches else drawn
            for shape in shapes:
                if shape is not None:
                    kind.setdefault(link.top, []).append((geom, placed(reading, geom, link, shape)))
    reading.seen |= {reading.links[top].name for top in drawn.keys() - touching.keys()}
    unseen = int(np.sum([not collides(reading, geom) for geom in range(reading.model.ngeom)]))
    unseen -= sum(len(drawn[top]) for top in drawn.keys() - touching.keys())
    if unseen:
        text = "surfaces that may touch are taken, and of a body without any what it looks like"
        reading.note("left out", f"{unseen} geoms that collide with nothing", text)
    for name, geoms in bare.items():
        reading.note("left out", f"{len(geoms)} geoms of {name}", "it has no mass, so it has no surface")
    meshes.tell()
    return {**{top: drawn[top] for top in drawn if top not in touching}, **touching}


def solid(reading: ModelReading, geom: int, meshes: Meshes) -> dict[str, Any] | None:
    """The sizes of a geom; None for one that has no counterpart."""
    size, kind = numbers(np.array(reading.model.geom_size[geom])), int(reading.model.geom_type[geom])
    if kind == SPHERE:
        return {"sphere": {"radius": size[0]}}
    if kind == CAPSULE and size[1] <= FLATTEST * size[0]:
        return {"sphere": {"radius": size[0]}}
    if kind in (CAPSULE, CYLINDER):
        return {"capsule" if kind == CAPSULE else "cylinder": {"radius": size[0], "length": 2 * size[1]}}
    if kind == ELLIPSOID:
        return {"ellipsoid": {"radii": size}}
    if kind == BOX:
        return {"box": {"size": [2 * half for half in size]}}
    if kind == MESH:
        return meshes.hull(geom)
    text = "planes and height fields belong to the world, and signed distance fields have no counterpart"
    reading.note("left out", reading.called("geom", geom), text)
    return None


def placed(reading: ModelReading, geom: int, link: WeldedLink, shape: dict[str, Any]) -> dict[str, Any]:
    """A shape in the frame of its body; ``centre`` and ``orientation``, where it has them, are in that of the geom."""
    axes = np.array(reading.data.geom_xmat[geom]).reshape(3, 3)
    centre = link.to_body(np.array(reading.data.geom_xpos[geom]) + axes @ shape.get("centre", np.zeros(3)))
    own = np.eye(3).ravel()
    reading.library.mju_quat2Mat(own, np.array(shape.get("orientation", [1.0, 0.0, 0.0, 0.0])))
    orientation = link.turned(axes @ own.reshape(3, 3))
    found = {key: value for key, value in shape.items() if key not in ("centre", "orientation")}
    if np.abs(centre).max() > 1e-15:
        found["centre"] = numbers(centre)
    if not is_upright(orientation) and "sphere" not in shape:
        found["orientation"] = orientation
    return found


def read_statics(reading: ModelReading) -> dict[str, Any]:
    """What stands still and may be touched: [ground], [[plane]], [[block]] and [[terrain]]."""
    model = reading.model
    found: dict[str, Any] = {"plane": [], "block": [], "terrain": []}
    meshes = Meshes(reading)
    for geom in range(model.ngeom):
        if int(model.geom_bodyid[geom]) in reading.links or not collides(reading, geom):
            continue
        place, axes = np.array(reading.data.geom_xpos[geom]), np.array(reading.data.geom_xmat[geom]).reshape(3, 3)
        kind = int(model.geom_type[geom])
        if kind == PLANE:
            plane(reading, geom, place, axes[:, 2], found)
        elif kind == TERRAIN:
            terrain(reading, geom, place, axes, found)
        else:
            block(reading, geom, place, axes, found, meshes)
    meshes.tell()
    return {key: tables for key, tables in found.items() if tables or key == "ground"}


def plane(reading: ModelReading, geom: int, place: Array, normal: Array, found: dict[str, Any]) -> None:
    """A plane; the first that is level is the ground. MuJoCo's have no edges either."""
    if "ground" not in found and np.abs(normal - [0, 0, 1]).max() < 1e-12:
        found["ground"] = {"height": numbers(place[2])}
        reading.static_names[geom] = "ground"
        return
    name = reading.names.give("plane", reading.name("geom", geom), "plane")
    reading.static_names[geom] = name
    found["plane"].append({"name": name, "normal": numbers(normal), "point": numbers(place)})


def block(reading: ModelReading, geom: int, place: Array, axes: Array, found: dict[str, Any], meshes: Meshes) -> None:
    """A solid that stands still."""
    shape = solid(reading, geom, meshes)
    if shape is None:
        return
    name = reading.names.give("block", reading.name("geom", geom), "block")
    reading.static_names[geom] = name
    table = {"name": name, "shape": shape, "position": numbers(place)}
    orientation = quaternion(axes)
    found["block"].append(table if is_upright(orientation) else {**table, "orientation": orientation})
