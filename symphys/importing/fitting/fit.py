"""The shapes that come nearest to a mesh: one primitive, a few spheres or a few capsules; and how far off they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from symphys.errors import SymphysError
from symphys.importing.fitting.mesh import Mesh
from symphys.importing.fitting.search import WIDTHS, cloud_of, improved, several, starts
from symphys.importing.fitting.solids import Placed, union_distance
from symphys.model.shapes import Shape
from symphys.suggest import hint, quote

SEVERAL = {"spheres": ("sphere", (2, 4, 8)), "capsules": ("capsule", (2, 3, 4))}
"""What more than one shape may be, and how many are tried."""
KINDS = (*WIDTHS, *SEVERAL)
"""Everything that ``fit`` tries, in the order of simplicity."""
WORTH = 0.07
"""How much smaller the largest deviation must become for each shape more."""
FINE = 0.005
"""Of the mesh's size, added to the deviations that are compared: less of a difference does not matter."""


@dataclass(frozen=True)
class Fit:
    """Shapes in place of a mesh.

    Attributes:
        kind: of ``KINDS``.
        shapes: placed in the mesh's frame.
        outside_mm: how far the mesh reaches out of the shapes at most [mm].
        inside_mm: how far the shapes reach out of the mesh at most [mm]. Hollows that are seen from no side are filled.
        size_mm: the longest side of the mesh [mm].
    """

    kind: str
    shapes: tuple[Shape, ...]
    outside_mm: float
    inside_mm: float
    size_mm: float = 0.0

    @property
    def deviation_mm(self) -> float:
        """The larger of both [mm]."""
        return max(self.outside_mm, self.inside_mm)

    def __str__(self) -> str:
        """One line for reports."""
        counted = self.kind if len(self.shapes) == 1 else f"{len(self.shapes)} {self.kind}"
        return (
            f"{counted}: the mesh is {self.outside_mm:.1f} mm outside, the fit up to {self.inside_mm:.1f} mm too large"
        )


def fit(vertices: ArrayLike, faces: ArrayLike, kinds: Sequence[str] = KINDS) -> Fit:
    """The best of some kinds of shapes for a mesh.

    The largest deviation counts, in either direction; several shapes are taken where each more makes it 7 %
    smaller at least. The answer is the same each time.

    Args:
        vertices: (n, 3) [m].
        faces: (m, 3) indices of vertices.
        kinds: of ``KINDS``: what may be taken.

    Raises:
        SymphysError: an unknown kind, or a mesh without a surface.
    """
    return best(fits(vertices, faces, kinds))


def fits(vertices: ArrayLike, faces: ArrayLike, kinds: Sequence[str] = KINDS) -> list[Fit]:
    """The best of each kind; see ``fit``."""
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown or not kinds:
        raise SymphysError(f"there is no kind of fit {quote(unknown[0] if unknown else '')}; {hint('', KINDS)}")
    mesh = checked(vertices, faces)
    found = []
    for kind in kinds:
        if kind in SEVERAL:
            single, counts = SEVERAL[kind]
            found += [measured(kind, mesh, improved(mesh, several(single, mesh, count))) for count in counts]
        else:
            cloud = cloud_of(mesh)
            tried = [improved(mesh, [start]) for start in starts(kind, cloud.surface)]
            far = [float(cloud.deviations(solids).max()) for solids in tried]
            found.append(measured(kind, mesh, tried[int(np.argmin(far))]))
    return found


def best(found: Sequence[Fit]) -> Fit:
    """The one with the least deviation, where each more shape must be worth it."""
    return min(found, key=cost)


def cost(each: Fit) -> float:
    """What is compared: the deviation, times a little for each shape more [mm]."""
    return (each.deviation_mm + FINE * each.size_mm) * (1 + WORTH) ** (len(each.shapes) - 1)


def checked(vertices: ArrayLike, faces: ArrayLike) -> Mesh:
    """The mesh; SymphysError for one that has no surface."""
    points, triangles = np.asarray(vertices, float), np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise SymphysError("vertices must be (n, 3) finite numbers [m]")
    whole = triangles.ndim == 2 and triangles.shape[1] == 3 and triangles.dtype.kind in "iu" and len(triangles)
    if not whole or triangles.min() < 0 or triangles.max() >= len(points):
        raise SymphysError(f"faces must be (m, 3) indices of the {len(points)} vertices")
    corners = points[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    if not area > 0:
        raise SymphysError("the triangles of this mesh have no area; it has no surface to fit")
    return Mesh(points, triangles.astype(np.int64))


def measured(kind: str, mesh: Mesh, solids: list[Placed]) -> Fit:
    """The fit, with its deviations."""
    out = float(max(union_distance(solids, mesh.samples).max(), 0.0))
    surface = np.concatenate([solid.surface() for solid in solids])
    bare = surface[union_distance(solids, surface) > -1e-6 * mesh.size]
    free = bare[mesh.outside(bare)]
    over = float(mesh.distance(free).max()) if len(free) else 0.0
    return Fit(kind, tuple(solid.shape() for solid in solids), 1000 * out, 1000 * over, 1000 * mesh.size)
