"""Geoms of a model that may collide: shapes of bodies, hulls or fits of meshes, planes, blocks and terrain."""

from __future__ import annotations

import copy
from math import sqrt
from typing import Any

import numpy as np

from symphys.errors import SymphysError
from symphys.importing.tables.reading import ModelReading, WeldedLink, is_upright, matrix, numbers, quaternion
from symphys.model.heightfield import Heightfield
from symphys.types import Array

MIN_THICKNESS = 1e-9
"""Share of a mesh's length below which it has no volume."""
MAX_HULL_POINTS = 64
"""Vertices of the hull of a mesh, at most."""
FITTED = ("sphere", "box", "capsule", "spheres", "capsules")
"""Kinds of shapes that may stand in for a mesh, all of which touch each other."""
Solid = dict[str, Any]
"""A shape by its sizes; ``centre`` and ``orientation`` in the frame of the mesh."""
MAX_HEIGHTS = 1024
"""Heights of a terrain, at most, since each takes part in every contact with it."""
MIN_RELIEF = 1e-9
"""[m] Heights that differ by less make a plane."""
PLANE, TERRAIN, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)
"""MuJoCo's types of geoms."""
MIN_STRAIGHT = 1e-6
"""Least straight part of a capsule, as a share of its radius; below it is a sphere."""
Shapes = dict[int, list[tuple[int, dict[str, Any]]]]
"""(index of a geom, its table) by the top body of each link."""


def collides(reading: ModelReading, geom: int) -> bool:
    """Whether a geom may touch anything."""
    model = reading.model
    paired = geom in model.pair_geom1 or geom in model.pair_geom2
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom] or paired)


def read_shapes(reading: ModelReading) -> Shapes:
    """Return the shapes of every link: those that may touch, or, if there are none, those that are drawn."""
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
    """Return the shape of a geom by its sizes; None if it has no counterpart."""
    size, kind = numbers(np.array(reading.model.geom_size[geom])), int(reading.model.geom_type[geom])
    if kind == SPHERE:
        return {"sphere": {"radius": size[0]}}
    if kind == CAPSULE and size[1] <= MIN_STRAIGHT * size[0]:
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
    """Return a shape in the frame of its body; its own ``centre`` and ``orientation`` are in the frame of the geom."""
    axes = np.array(reading.data.geom_xmat[geom]).reshape(3, 3)
    centre = link.to_body(np.array(reading.data.geom_xpos[geom]) + axes @ shape.get("centre", np.zeros(3)))
    orientation = link.turned(axes @ matrix(shape.get("orientation", [1.0, 0.0, 0.0, 0.0])))
    found = {key: value for key, value in shape.items() if key not in ("centre", "orientation")}
    if np.abs(centre).max() > 1e-15:
        found["centre"] = numbers(centre)
    if not is_upright(orientation) and "sphere" not in shape:
        found["orientation"] = orientation
    return found


class Meshes:
    """The shapes of meshes, each made once, with findings on their deviations."""

    def __init__(self, reading: ModelReading) -> None:
        """Start without shapes."""
        self.reading = reading
        self.hulls: dict[int, Solid | None] = {}
        self.fits: dict[int, list[Solid]] = {}
        self.off: dict[int, float] = {}
        self.refused: dict[str, list[str]] = {}

    def hull(self, geom: int) -> Solid | None:
        """Return the hull of a mesh geom, with which MuJoCo collides it too; None if it has no volume."""
        mesh = int(self.reading.model.geom_dataid[geom])
        if mesh not in self.hulls:
            try:
                points, self.off[mesh] = hull_points(self.vertices(mesh), MAX_HULL_POINTS)
                self.hulls[mesh] = {"convex": {"points": numbers(points)}}
            except ValueError as error:
                self.refuse(mesh, str(error))
                self.hulls[mesh] = None
        return copy.deepcopy(self.hulls[mesh])

    def fitted(self, geom: int) -> list[Solid]:
        """Return the shapes that stand in for a mesh geom, and note their deviations; none if it has no surface."""
        from symphys.importing.fitting import fit  # takes long to import, as few need it

        model = self.reading.model
        mesh = int(model.geom_dataid[geom])
        if mesh not in self.fits:
            first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
            try:
                found = fit(self.vertices(mesh), np.array(model.mesh_face[first : first + count]), FITTED)
            except SymphysError as error:
                self.refuse(mesh, str(error))
                self.fits[mesh] = []
            else:
                amount = f"{found.outside_mm:.2g} mm too small, {found.inside_mm:.2g} mm too large"
                what = f"mesh {self.called(mesh)}"
                self.reading.note("approximated", what, f"{len(found.shapes)} {found.kind}", amount)
                self.fits[mesh] = [
                    {
                        shape.kind: {key: numbers(value) for key, value in shape.sizes.items()},
                        "centre": numbers(shape.centre),
                        "orientation": numbers(shape.orientation),
                    }
                    for shape in found.shapes
                ]
        return copy.deepcopy(self.fits[mesh])

    def vertices(self, mesh: int) -> Array:
        """Return the vertices (n, 3) [m] in the frame of its geoms."""
        model = self.reading.model
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return np.array(model.mesh_vert[first : first + count], float)

    def called(self, mesh: int) -> str:
        """Return the name of a mesh, or its number."""
        return self.reading.name("mesh", mesh) or str(mesh)

    def refuse(self, mesh: int, why: str) -> None:
        """Keep the reason for which a mesh is left out."""
        self.refused.setdefault(why, []).append(self.called(mesh))

    def tell(self) -> None:
        """Note the deviations of all hulls together, and the meshes that are left out."""
        if self.off:
            exact = sum(not deviation for deviation in self.off.values())
            text = (
                f"their convex hulls, with at most {MAX_HULL_POINTS} of their vertices each; {exact} have all of them"
            )
            worst = max(self.off, key=lambda mesh: self.off[mesh])
            amount = f"up to {self.off[worst]:.2g} mm ({self.called(worst)})"
            self.reading.note("approximated", f"{len(self.off)} meshes", text, amount if self.off[worst] else "")
        for why, names in self.refused.items():
            self.reading.note("left out", f"{len(names)} meshes: {', '.join(names)}", why)


def hull_points(vertices: Array, most: int) -> tuple[Array, float]:
    """Return at most ``most`` vertices of the convex hull, and how far the others lie outside of these [mm].

    The point farthest from all kept ones is added next, so that the others are near to kept ones.

    Args:
        vertices: (n, 3) [m].
        most: how many to keep at most.

    Raises:
        ValueError: for a mesh that is flat, or has no four points.
    """
    from scipy.spatial import ConvexHull, QhullError

    spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(vertices) < 4 or spread[2] <= MIN_THICKNESS * spread[0]:
        raise ValueError("it is flat, so that it has no volume")
    try:
        corners = vertices[ConvexHull(vertices).vertices]
    except QhullError:
        raise ValueError("it has no convex hull with a volume") from None
    if len(corners) <= most:
        return corners, 0.0
    kept = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    distances = np.linalg.norm(corners - corners[kept[0]], axis=1)
    while len(kept) < most:
        kept.append(int(np.argmax(distances)))
        distances = np.minimum(distances, np.linalg.norm(corners - corners[kept[-1]], axis=1))
    thinned = corners[sorted(kept)]
    outside = ConvexHull(thinned).equations
    lost = np.max(corners @ outside[:, :3].T + outside[:, 3], axis=1)
    return thinned, float(1000 * max(lost.max(), 0.0))


def read_statics(reading: ModelReading) -> dict[str, Any]:
    """Return the static surfaces that may be touched: [ground], [[plane]], [[block]] and [[terrain]]."""
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
    """Read a plane; the first level one is the ground. MuJoCo's planes have no edges either."""
    if "ground" not in found and np.abs(normal - [0, 0, 1]).max() < 1e-12:
        found["ground"] = {"height": numbers(place[2])}
        reading.static_names[geom] = "ground"
        return
    name = reading.names.give("plane", reading.name("geom", geom), "plane")
    reading.static_names[geom] = name
    found["plane"].append({"name": name, "normal": numbers(normal), "point": numbers(place)})


def block(reading: ModelReading, geom: int, place: Array, axes: Array, found: dict[str, Any], meshes: Meshes) -> None:
    """Read a static solid."""
    shape = solid(reading, geom, meshes)
    if shape is None:
        return
    name = reading.names.give("block", reading.name("geom", geom), "block")
    reading.static_names[geom] = name
    table = {"name": name, "shape": shape, "position": numbers(place)}
    orientation = quaternion(axes)
    found["block"].append(table if is_upright(orientation) else {**table, "orientation": orientation})


def terrain(reading: ModelReading, geom: int, place: Array, axes: Array, found: dict[str, Any]) -> None:
    """Read a height field that is not turned: heights in rows along y and columns along x, about the geom."""
    model, field = reading.model, int(reading.model.geom_dataid[geom])
    what = reading.called("geom", geom)
    if np.abs(axes - np.eye(3)).max() > 1e-12:
        reading.note("left out", what, "a height field that is turned has no counterpart")
        return
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    start = int(model.hfield_adr[field])
    shares = np.array(model.hfield_data[start : start + rows * columns], float).reshape(rows, columns)
    x, y, top, _ = (float(value) for value in model.hfield_size[field])
    heights = place[2] + top * shares
    if float(np.ptp(heights)) <= MIN_RELIEF:
        name = reading.names.give("plane", reading.name("geom", geom), "plane")
        reading.static_names[geom] = name
        reading.note("approximated", what, "all its heights are the same, so it is a plane, which has no edges")
        found["plane"].append({"name": name, "normal": [0.0, 0.0, 1.0], "point": numbers([*place[:2], heights[0, 0]])})
        return
    name = reading.names.give("terrain", reading.name("geom", geom), "terrain")
    reading.static_names[geom] = name
    kept = thinned(heights)
    text = "a smooth surface through its heights, which goes straight on; MuJoCo's is made of triangles, and ends"
    if kept.shape != heights.shape:
        text = f"{rows} x {columns} heights are thinned to {kept.shape[0]} x {kept.shape[1]}; {text}"
    spacing = [2 * x / (kept.shape[1] - 1), 2 * y / (kept.shape[0] - 1)]
    origin = [place[0] - x, place[1] - y]
    surface = Heightfield(tuple(map(tuple, kept.tolist())), (spacing[0], spacing[1]), (origin[0], origin[1]))
    off = f"the surfaces differ by at most {1e3 * surface.off_triangles(heights):.3g} mm"
    reading.note("approximated", what, text, off)
    table = {"name": name, "heights": numbers(kept), "spacing": numbers(spacing), "origin": numbers(origin)}
    found["terrain"].append(table)


def thinned(heights: Array) -> Array:
    """Return at most ``MAX_HEIGHTS`` heights over the same area."""
    rows, columns = heights.shape
    if rows * columns <= MAX_HEIGHTS:
        return heights
    shrink = sqrt(MAX_HEIGHTS / (rows * columns))
    few = min(max(2, int(rows * shrink)), MAX_HEIGHTS // 2)
    return resampled(heights, few, min(columns, MAX_HEIGHTS // few))


def resampled(heights: Array, rows: int, columns: int) -> Array:
    """Return heights (rows, columns), linear between neighbours."""
    y, x = (np.linspace(0, size - 1, count) for size, count in zip(heights.shape, (rows, columns), strict=True))
    along = np.array([np.interp(x, np.arange(heights.shape[1]), row) for row in heights])
    return np.array([np.interp(y, np.arange(heights.shape[0]), column) for column in along.T]).T
