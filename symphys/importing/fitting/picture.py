"""A picture of a fit: the mesh and the shapes in its place, from three sides."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symphys.files import write_bytes
from symphys.importing.fitting.fit import Fit, checked
from symphys.maths import rotation
from symphys.model.shapes import Shape
from symphys.types import Array

SIDES = ((0, 2), (1, 2), (0, 1))
"""The axes to the right and up in each view."""
MOST_FACES = 8000
"""Faces of a mesh that are drawn, at most."""
RINGS = 24
"""Corners of a drawn circle."""


def draw_fit(fitted: Fit, vertices: ArrayLike, faces: ArrayLike, path: Path | str, title: str = "") -> None:
    """Draw a fit as SVG or PNG, by the suffix: the mesh grey, the shapes as blue wires, deviations in the title.

    Raises:
        SymphysError: the file cannot be written, or the mesh has no surface.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # late: takes half a second
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    mesh = checked(vertices, faces)
    triangles = 1000 * mesh.vertices[mesh.faces[:: max(1, -(-len(mesh.faces) // MOST_FACES))]]
    wires = [1000 * wire for shape in fitted.shapes for wire in outline(shape)]
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    for k, side in enumerate(SIDES):
        axes: Any = figure.add_subplot(1, len(SIDES), k + 1)
        seen, lines = triangles[:, :, side], [wire[:, side] for wire in wires]
        axes.add_collection(PolyCollection(list(seen), facecolor="0.8", edgecolor="0.6", linewidth=0.15))
        axes.add_collection(LineCollection(lines, colors="#1f5fbf", linewidths=0.8))
        axes.autoscale_view()
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel(f"{'xyz'[side[0]]} [mm]", fontsize=8)
        axes.set_ylabel(f"{'xyz'[side[1]]} [mm]", fontsize=8)
        axes.tick_params(labelsize=7)
    figure.suptitle(f"{title}\n{fitted}" if title else str(fitted), fontsize=9)
    buffer = io.BytesIO()
    figure.savefig(buffer, format=Path(path).suffix[1:] or "svg", dpi=110)
    write_bytes(Path(path), buffer.getvalue())


def outline(shape: Shape) -> list[Array]:
    """Return closed lines (k, 3) on a shape, in the frame in which it is placed."""
    import casadi as ca

    turned = np.array(rotation.matrix(ca.DM(shape.orientation)))
    return [np.array(shape.centre, float) + line @ turned.T for line in own_lines(shape)]


def own_lines(shape: Shape) -> list[Array]:
    """Return lines on a shape in its own axes: edges of a polytope, circles of round shapes."""
    turn = np.linspace(0, 2 * np.pi, RINGS + 1)
    circle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    sizes = shape.sizes
    if shape.kind == "box":
        x, y, z = np.array(sizes["size"]) / 2
        loop = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)])
        rims = [np.column_stack([loop * [x, y], np.full(5, end)]) for end in (-z, z)]
        return [*rims, *(np.array([(a * x, b * y, -z), (a * x, b * y, z)]) for a, b in loop[:4])]
    if shape.kind in ("sphere", "ellipsoid"):
        radii = np.full(3, sizes["radius"]) if shape.kind == "sphere" else np.array(sizes["radii"])
        return [circle[:, list(order)] * radii for order in ((0, 1, 2), (0, 2, 1), (2, 0, 1))]
    r, h = sizes["radius"], sizes["length"] / 2
    rims = [r * circle + [0, 0, end] for end in (-h, h)]
    sides = [np.array([(r * c, r * s, -h), (r * c, r * s, h)]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    if shape.kind == "capsule":
        arcs = circle[:, [0, 2, 1]] * r
        arcs[:, 2] += np.where(arcs[:, 2] >= 0, h, -h)
        return [*rims, *sides, arcs, arcs[:, [1, 0, 2]]]
    return [*rims, *sides]
