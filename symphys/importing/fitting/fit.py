"""The shapes nearest to a mesh: one primitive, a few spheres or a few capsules, and their deviations.

A fit minimises deviations by least squares, then their fourth powers, which come near to the least largest deviation.
A deviation is how far a point of the mesh's outer surface is from the surface of the solids, how far a point inside the
mesh is outside them, or how much nearer they are to a point outside than the mesh is.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symphys.errors import SymphysError
from symphys.files import write_bytes
from symphys.importing.fitting.mesh import Mesh
from symphys.maths import rotation
from symphys.model.shapes import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Array

FOOT_STEPS = 8
"""Newton steps towards the foot of a perpendicular on an ellipsoid."""
POINTS_ON_SOLID = 1500
"""Points on the surface of a solid."""


@dataclass(frozen=True)
class Placed:
    """A solid: kind, place (3,), axes (3, 3) in columns, and sizes: radius, radius and half length, or three [m]."""

    kind: str
    centre: Array
    axes: Array
    sizes: Array

    def distance(self, points: Array) -> Array:
        """Return the signed distances (n,) [m], negative inside."""
        return DISTANCES[self.kind]((points - self.centre) @ self.axes, self.sizes)

    def surface(self) -> Array:
        """Return points (k, 3) all over the surface."""
        return np.asarray(self.centre + SURFACES[self.kind](self.sizes) @ self.axes.T)

    def shape(self) -> Shape:
        """Return the shape of the model."""
        centre = tuple(self.centre.tolist())
        orientation = quaternion(self.axes)
        a, *more = self.sizes.tolist()
        if self.kind == "sphere":
            return Sphere(a, centre)
        if self.kind == "capsule":
            return Capsule(a, more[0], centre, orientation)
        if self.kind == "cylinder":
            return Cylinder(a, more[0], centre, orientation)
        kind = Box if self.kind == "box" else Ellipsoid
        return kind((a, *more), centre, orientation)


def to_sphere(p: Array, sizes: Array) -> Array:
    """Return distances from a sphere about the origin."""
    return np.asarray(np.linalg.norm(p, axis=1) - sizes[0])


def to_capsule(p: Array, sizes: Array) -> Array:
    """Return distances from a capsule along z."""
    along = np.clip(p[:, 2], -sizes[1], sizes[1])
    return np.asarray(np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2 + (p[:, 2] - along) ** 2) - sizes[0])


def to_cylinder(p: Array, sizes: Array) -> Array:
    """Return distances from a cylinder along z."""
    over = np.stack([np.hypot(p[:, 0], p[:, 1]) - sizes[0], np.abs(p[:, 2]) - sizes[1]])
    return np.asarray(np.linalg.norm(np.maximum(over, 0), axis=0) + np.minimum(over.max(axis=0), 0))


def to_box(p: Array, sizes: Array) -> Array:
    """Return distances from a box by its half sizes."""
    over = np.abs(p) - sizes
    return np.asarray(np.linalg.norm(np.maximum(over, 0), axis=1) + np.minimum(over.max(axis=1), 0))


def to_ellipsoid(p: Array, sizes: Array) -> Array:
    """Return distances from an ellipsoid, by the same iteration as ``EllipsoidField`` of the collision."""
    squares, scaled = sizes**2, sizes * p
    low = -0.98 * squares.min()
    m = np.maximum((np.abs(scaled) - squares).max(axis=1), low)
    for _ in range(FOOT_STEPS):
        parts = scaled / (squares + m[:, None])
        square = (parts**2).sum(axis=1) + 1e-30
        slope = (parts**2 / (squares + m[:, None])).sum(axis=1) + 1e-30
        m = np.maximum(m + (np.sqrt(square) - 1) * square / slope, low)
    return np.asarray(m * np.linalg.norm(p / (squares + m[:, None]), axis=1))


DISTANCES: dict[str, Callable[[Array, Array], Array]] = {
    "sphere": to_sphere,
    "capsule": to_capsule,
    "cylinder": to_cylinder,
    "box": to_box,
    "ellipsoid": to_ellipsoid,
}
"""Signed distances by the kinds of shapes."""


def directions(count: int = POINTS_ON_SOLID) -> Array:
    """Return unit vectors (count, 3), spread evenly by a Fibonacci spiral."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (1 + 5**0.5) * np.arange(count)
    ring = np.sqrt(1 - z**2)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)


def capsule_surface(sizes: Array) -> Array:
    """Return points (k, 3) on both ends and the side."""
    ball = sizes[0] * directions()
    ball[:, 2] += np.where(ball[:, 2] > 0, sizes[1], -sizes[1])
    turn, z = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(-sizes[1], sizes[1], 30))
    side = np.stack([sizes[0] * np.cos(turn), sizes[0] * np.sin(turn), z], axis=-1).reshape(-1, 3)
    return np.concatenate([ball, side])


def cylinder_surface(sizes: Array) -> Array:
    """Return points (k, 3) on both faces and the side."""
    turn, z = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(-sizes[1], sizes[1], 24))
    side = np.stack([sizes[0] * np.cos(turn), sizes[0] * np.sin(turn), z], axis=-1).reshape(-1, 3)
    turn, out = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0, 1, 10))
    face = sizes[0] * np.stack([out * np.cos(turn), out * np.sin(turn), 0 * out], axis=-1).reshape(-1, 3)
    end = np.array([0.0, 0.0, sizes[1]])
    return np.concatenate([side, face + end, face - end])


def box_surface(sizes: Array) -> Array:
    """Return points (k, 3) of a grid on each face."""
    side = np.linspace(-1, 1, 16)
    u, v = (each.ravel() for each in np.meshgrid(side, side))
    found = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            face = np.zeros((u.size, 3))
            face[:, axis], face[:, axis - 2], face[:, axis - 1] = sign, u, v
            found.append(face * sizes)
    return np.concatenate(found)


SURFACES: dict[str, Callable[[Array], Array]] = {
    "sphere": lambda sizes: sizes[0] * directions(),
    "capsule": capsule_surface,
    "cylinder": cylinder_surface,
    "box": box_surface,
    "ellipsoid": lambda sizes: sizes * directions(),
}
"""Points on the surface by the kinds of shapes."""


def quaternion(axes: Array) -> tuple[float, float, float, float]:
    """Return the unit quaternion w x y z of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(axes).as_quat(canonical=True).tolist()
    return w, x, y, z


def union_distance(solids: list[Placed], points: Array) -> Array:
    """Return the distances (n,) [m] from the nearest of several solids."""
    return np.asarray(np.min([solid.distance(points) for solid in solids], axis=0))


SURFACE_POINTS = 320
"""Points of the outer surface in a search; half as many outside, a quarter inside."""
MAX_EVALUATIONS = 20
"""Evaluations of a search, for each power."""
POWERS = (1, 2, 4)
"""Powers of a distance, as a share of the mesh's size, in the residuals."""
SIZE_COUNTS = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
"""Number of sizes of a solid."""
ROTATION_COUNTS = {"sphere": 0, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
"""Rotational degrees of freedom that change a solid."""
MIN_SIZE = 1e-3
"""The least size of a solid, as a share of the mesh's size."""
CLUSTER_STEPS = 25
"""Iterations of k-means."""
SHAPE_COUNTS = {"spheres": ("sphere", (2, 4, 8)), "capsules": ("capsule", (2, 3, 4))}
"""Fits by more than one shape: the kind, and the counts that are tried."""
KINDS = (*SIZE_COUNTS, *SHAPE_COUNTS)
"""Everything that ``fit`` tries, in the order of simplicity."""
GAIN_PER_SHAPE = 0.07
"""Relative decrease of the largest deviation that justifies one more shape."""
NEGLIGIBLE_DEVIATION = 0.005
"""Share of the mesh's size that is added to compared deviations: smaller differences do not matter."""
VIEW_AXES = ((0, 2), (1, 2), (0, 1))
"""The axes to the right and up in each view."""
MAX_FACES = 8000
"""Faces of a mesh that are drawn, at most."""
CIRCLE_CORNERS = 24
"""Corners of a drawn circle."""


@dataclass(frozen=True)
class Fit:
    """The shapes that stand in for a mesh.

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
        """The larger of the two deviations [mm]."""
        return max(self.outside_mm, self.inside_mm)

    def __str__(self) -> str:
        """Return one line for reports."""
        counted = self.kind if len(self.shapes) == 1 else f"{len(self.shapes)} {self.kind}"
        return (
            f"{counted}: the mesh is {self.outside_mm:.1f} mm outside, the fit up to {self.inside_mm:.1f} mm too large"
        )


def fit(vertices: ArrayLike, faces: ArrayLike, kinds: Sequence[str] = KINDS) -> Fit:
    """Return the best fit of a mesh by some kinds of shapes.

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
    """Return the best fit of each kind; arguments as for ``fit``."""
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown or not kinds:
        raise SymphysError(f"there is no kind of fit {quote(unknown[0] if unknown else '')}; {hint('', KINDS)}")
    mesh = checked(vertices, faces)
    found = []
    for kind in kinds:
        if kind in SHAPE_COUNTS:
            single, counts = SHAPE_COUNTS[kind]
            found += [measured(kind, mesh, improved(mesh, several(single, mesh, count))) for count in counts]
        else:
            cloud = cloud_of(mesh)
            tried = [improved(mesh, [start]) for start in starts(kind, cloud.surface)]
            far = [float(cloud.deviations(solids).max()) for solids in tried]
            found.append(measured(kind, mesh, tried[int(np.argmin(far))]))
    return found


def best(found: Sequence[Fit]) -> Fit:
    """Return the fit with the least deviation, where each additional shape must be worth it."""
    return min(found, key=cost)


def cost(each: Fit) -> float:
    """Return the deviation [mm] with a penalty for each additional shape."""
    return (each.deviation_mm + NEGLIGIBLE_DEVIATION * each.size_mm) * (1 + GAIN_PER_SHAPE) ** (len(each.shapes) - 1)


def measured(kind: str, mesh: Mesh, solids: list[Placed]) -> Fit:
    """Return the fit with its deviations."""
    out = float(max(union_distance(solids, mesh.samples).max(), 0.0))
    surface = np.concatenate([solid.surface() for solid in solids])
    bare = surface[union_distance(solids, surface) > -1e-6 * mesh.size]
    free = bare[mesh.outside(bare)]
    over = float(mesh.distance(free).max()) if len(free) else 0.0
    return Fit(kind, tuple(solid.shape() for solid in solids), 1000 * out, 1000 * over, 1000 * mesh.size)


def checked(vertices: ArrayLike, faces: ArrayLike) -> Mesh:
    """Return the mesh; SymphysError if it has no surface."""
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


def improved(mesh: Mesh, start: Sequence[Placed]) -> list[Placed]:
    """Return solids that fit better, from a start."""
    from scipy.optimize import least_squares

    cloud, solids = cloud_of(mesh), list(start)
    for power in POWERS:
        numbers = np.zeros(sum(3 + ROTATION_COUNTS[solid.kind] + SIZE_COUNTS[solid.kind] for solid in solids))

        def residuals(change: Array, power: int = power, solids: list[Placed] = solids) -> Array:
            return np.asarray((10 * cloud.deviations(changed(solids, change, mesh.size)) / mesh.size) ** power)

        found = least_squares(
            residuals, numbers, method="trf", max_nfev=MAX_EVALUATIONS, x_scale=0.1, xtol=1e-4, ftol=1e-4
        )
        solids = changed(solids, found.x, mesh.size)
    return solids


@dataclass(frozen=True)
class Cloud:
    """Points on the surface and inside of a mesh, and points outside at known distances [m]."""

    surface: Array
    inside: Array
    outside: Array
    away: Array

    def deviations(self, solids: list[Placed]) -> Array:
        """Return the deviation (n,) [m] at each point, at least 0."""
        distance = union_distance(solids, np.concatenate([self.surface, self.inside, self.outside]))
        on, within, out = np.split(distance, np.cumsum([len(self.surface), len(self.inside)]))
        return np.concatenate([np.abs(on), np.maximum(within, 0), np.maximum(self.away - out, 0)])


@lru_cache(maxsize=4)
def cloud_of(mesh: Mesh) -> Cloud:
    """Return a few points of a mesh, the same each time."""
    low, high = mesh.outer.min(axis=0), mesh.outer.max(axis=0)
    margin = 0.3 * (high - low).max()
    grid = low - margin + np.random.default_rng(2).random((2000, 3)) * (high - low + 2 * margin)
    outside = thinned(grid[mesh.outside(grid)], SURFACE_POINTS // 2)
    away = np.asarray(mesh.tree.query(outside)[0], float)
    return Cloud(thinned(mesh.outer, SURFACE_POINTS), thinned(mesh.filling, SURFACE_POINTS // 4), outside, away)


def changed(solids: Sequence[Placed], numbers: Array, size: float) -> list[Placed]:
    """Return solids after shifts [share of the mesh's size], turns [rad] and growths [logarithms of sizes]."""
    from scipy.spatial.transform import Rotation

    found, at = [], 0
    for solid in solids:
        turns, width = ROTATION_COUNTS[solid.kind], SIZE_COUNTS[solid.kind]
        shift, turn, growth = np.split(numbers[at : at + 3 + turns + width], [3, 3 + turns])
        axes = solid.axes @ Rotation.from_rotvec(np.append(turn, [0] * (3 - turns))).as_matrix()
        sizes = np.maximum(solid.sizes * np.exp(np.clip(growth, -3, 3)), MIN_SIZE * size)
        found.append(Placed(solid.kind, solid.centre + size * shift, axes, sizes))
        at += 3 + turns + width
    return found


def thinned(points: Array, count: int) -> Array:
    """Return ``count`` of the points, spread over them: each is the farthest from those before."""
    rng = np.random.default_rng(1)
    pool = points[rng.choice(len(points), min(len(points), 8 * count), replace=False)]
    if len(pool) <= count:
        return pool
    chosen = [int(np.linalg.norm(pool - pool.mean(axis=0), axis=1).argmax())]
    away = np.linalg.norm(pool - pool[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(pool - pool[chosen[-1]], axis=1))
    return np.asarray(pool[chosen])


def frames(points: Array) -> list[Array]:
    """Return rotations (3, 3) along which a cloud may be laid out: the given axes and the principal ones."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return [np.eye(3), axes]


def starts(kind: str, points: Array) -> list[Placed]:
    """Return solids of a kind that roughly hold a cloud: along every axis where one is special."""
    found = []
    for frame in frames(points):
        turns = range(3) if kind in ("capsule", "cylinder") else range(1)
        for turn in turns:
            axes = np.roll(frame, -turn - 1, axis=1) if kind in ("capsule", "cylinder") else frame
            own = points @ axes
            middle, half = (own.max(axis=0) + own.min(axis=0)) / 2, np.ptp(own, axis=0) / 2
            half = np.maximum(half, 0.01 * half.max())
            across = float(np.sqrt(half[0] * half[1]))
            sizes = {
                "sphere": [half.mean()],
                "capsule": [across, max(half[2] - across, 0.1 * half[2])],
                "cylinder": [across, half[2]],
                "box": half,
                "ellipsoid": 1.1 * half,
            }[kind]
            found.append(Placed(kind, axes @ middle, axes, np.array(sizes, float)))
        if kind == "sphere":
            break
    return found


def several(kind: str, mesh: Mesh, count: int) -> list[Placed]:
    """Return spheres or capsules in clusters of the mesh's inside."""
    points = thinned(mesh.filling, 1500)
    middles = thinned(points, count)
    for _ in range(CLUSTER_STEPS):
        owner = ((points[:, None] - middles[None]) ** 2).sum(axis=2).argmin(axis=1)
        middles = np.array(
            [points[owner == k].mean(axis=0) if (owner == k).any() else middles[k] for k in range(count)]
        )
    found = []
    for k in range(count):
        own = points[owner == k]
        if len(own) < 4:
            continue
        own = own - middles[k]
        axes = np.linalg.svd(own, full_matrices=False)[2][::-1].T
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        half = np.maximum(np.abs(own @ axes).max(axis=0), mesh.size / 40)
        sizes = (
            [float(half.mean())]
            if kind == "sphere"
            else [float(half[:2].mean()), float(max(half[2] - half[0], half[2] / 4))]
        )
        found.append(Placed(kind, middles[k], axes, np.array(sizes)))
    return found


def draw_fit(fitted: Fit, vertices: ArrayLike, faces: ArrayLike, path: Path | str, title: str = "") -> None:
    """Draw a fit as SVG or PNG, by the suffix: the mesh grey, the shapes as blue wires, deviations in the title.

    Raises:
        SymphysError: the file cannot be written, or the mesh has no surface.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # late: takes half a second
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    mesh = checked(vertices, faces)
    triangles = 1000 * mesh.vertices[mesh.faces[:: max(1, -(-len(mesh.faces) // MAX_FACES))]]
    wires = [1000 * wire for shape in fitted.shapes for wire in outline(shape)]
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    for k, side in enumerate(VIEW_AXES):
        axes: Any = figure.add_subplot(1, len(VIEW_AXES), k + 1)
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
    turn = np.linspace(0, 2 * np.pi, CIRCLE_CORNERS + 1)
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
