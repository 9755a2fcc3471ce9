"""Meshes of a model: their convex hulls, or the shapes that come nearest to them."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from symphys.errors import SymphysError
from symphys.importing.hulls import hull_points
from symphys.importing.tables.reading import ModelReading, numbers
from symphys.types import Array

MOST_POINTS = 64
"""Of the hull of a mesh."""
FITTED = ("sphere", "box", "capsule", "spheres", "capsules")
"""What stands in for a mesh: shapes that touch each other."""
Solid = dict[str, Any]
"""A shape by its sizes; ``centre`` and ``orientation`` in the frame of the mesh."""


class Meshes:
    """The shapes of meshes, each made once; says how far they are off."""

    def __init__(self, reading: ModelReading) -> None:
        """None so far."""
        self.reading = reading
        self.hulls: dict[int, Solid | None] = {}
        self.fits: dict[int, list[Solid]] = {}
        self.off: dict[int, float] = {}
        self.refused: dict[str, list[str]] = {}

    def hull(self, geom: int) -> Solid | None:
        """The hull of a geom that is a mesh, as MuJoCo collides it too; None for one without a volume."""
        mesh = int(self.reading.model.geom_dataid[geom])
        if mesh not in self.hulls:
            self.hulls[mesh] = self.hull_of(mesh)
        return copy.deepcopy(self.hulls[mesh])

    def hull_of(self, mesh: int) -> Solid | None:
        """The hull of a mesh."""
        try:
            points, self.off[mesh] = hull_points(self.vertices(mesh), MOST_POINTS)
        except ValueError as error:
            self.refuse(mesh, str(error))
            return None
        return {"convex": {"points": numbers(points)}}

    def fitted(self, geom: int) -> list[Solid]:
        """The shapes in place of a geom that is a mesh; none for one without a surface."""
        mesh = int(self.reading.model.geom_dataid[geom])
        if mesh not in self.fits:
            self.fits[mesh] = self.fit_of(mesh)
        return copy.deepcopy(self.fits[mesh])

    def fit_of(self, mesh: int) -> list[Solid]:
        """The shapes in place of a mesh, and how far they are off."""
        from symphys.importing.fitting import fit  # takes long to import, as few need it

        model = self.reading.model
        first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        try:
            found = fit(self.vertices(mesh), np.array(model.mesh_face[first : first + count]), FITTED)
        except SymphysError as error:
            self.refuse(mesh, str(error))
            return []
        amount = f"{found.outside_mm:.2g} mm too small, {found.inside_mm:.2g} mm too large"
        self.reading.note("approximated", f"mesh {self.called(mesh)}", f"{len(found.shapes)} {found.kind}", amount)
        return [
            {
                shape.kind: {key: numbers(value) for key, value in shape.sizes.items()},
                "centre": numbers(shape.centre),
                "orientation": numbers(shape.orientation),
            }
            for shape in found.shapes
        ]

    def vertices(self, mesh: int) -> Array:
        """(n, 3) [m], in the frame of its geoms."""
        model = self.reading.model
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return np.array(model.mesh_vert[first : first + count], float)

    def called(self, mesh: int) -> str:
        """Its name, or its number."""
        return self.reading.name("mesh", mesh) or str(mesh)

    def refuse(self, mesh: int, why: str) -> None:
        """Keep why a mesh is left out."""
        self.refused.setdefault(why, []).append(self.called(mesh))

    def tell(self) -> None:
        """What became of all hulls together, and of what is left out."""
        if self.off:
            exact = sum(not deviation for deviation in self.off.values())
            text = f"their convex hulls, with at most {MOST_POINTS} of their vertices each; {exact} have all of them"
            worst = max(self.off, key=lambda mesh: self.off[mesh])
            amount = f"up to {self.off[worst]:.2g} mm ({self.called(worst)})"
            self.reading.note("approximated", f"{len(self.off)} meshes", text, amount if self.off[worst] else "")
        for why, names in self.refused.items():
            self.reading.note("left out", f"{len(names)} meshes: {', '.join(names)}", why)
