"""Fits of shapes to meshes: a mesh of a shape is that shape, deviations are what they are said to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from tools.repeats import first

from symphys.errors import SymphysError
from symphys.importing.fitting import Fit, best, draw_fit, fit, fits
from symphys.importing.fitting.fit import DISTANCES, SURFACES, Placed, directions, quaternion
from symphys.maths import rotation
from symphys.model.shapes import Box, Capsule, Sphere
from symphys.types import Array

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN = TURN * np.sign(np.linalg.det(TURN))
PLACE = np.array([0.4, -0.2, 0.1])
SIZES = {
    "sphere": [0.1],
    "capsule": [0.04, 0.12],
    "cylinder": [0.05, 0.1],
    "box": [0.05, 0.08, 0.12],
    "ellipsoid": [0.05, 0.08, 0.12],
}


def mesh(points: Array) -> tuple[Array, NDArray[np.int64]]:
    """Of the hull of points."""
    return points, np.asarray(ConvexHull(points).simplices, np.int64)


def both(*parts: tuple[Array, NDArray[np.int64]]) -> tuple[Array, NDArray[np.int64]]:
    """Several meshes as one, which overlap."""
    starts = np.cumsum([0] + [len(points) for points, _ in parts])
    return np.concatenate([p for p, _ in parts]), np.concatenate(
        [faces + start for (_, faces), start in zip(parts, starts, strict=False)]
    )


@pytest.mark.slow
@first("kind", SIZES)
def test_a_mesh_of_a_shape_is_that_shape(kind: str) -> None:
    """Turned and shifted, up to the coarseness of its triangles."""
    solid = Placed(kind, PLACE, TURN, np.array(SIZES[kind]))
    found = fit(*mesh(solid.surface()), kinds=[kind])
    assert found.kind == kind
    assert found.deviation_mm < 4
    (shape,) = found.shapes
    assert np.array(shape.centre) == pytest.approx(PLACE, abs=2e-3)
    assert shape.volume == pytest.approx(solid.shape().volume, rel=0.06)


@pytest.mark.slow
def test_a_shape_is_told_from_others() -> None:
    solid = Placed("box", PLACE, TURN, np.array(SIZES["box"]))
    found = fits(*mesh(solid.surface()), kinds=("sphere", "capsule", "box"))
    assert [each.kind for each in found] == ["sphere", "capsule", "box"]
    assert best(found).kind == "box"
    assert best(found).deviation_mm < min(found[0].deviation_mm, found[1].deviation_mm) / 4


@pytest.mark.thorough
def test_a_dumbbell_is_two_spheres() -> None:
    """With the deviations both ways, which for the one sphere in its place are large."""
    ball, aside = 0.06 * directions(400), np.array([0.09, 0.0, 0.0])
    dumbbell = both(mesh(ball + aside), mesh(ball - aside))
    found = fits(*dumbbell, kinds=("sphere", "spheres"))
    chosen = best(found)
    assert (chosen.kind, len(chosen.shapes)) == ("spheres", 2)
    assert chosen.deviation_mm < 2
    assert sorted(round(shape.centre[0], 2) for shape in chosen.shapes) == [-0.09, 0.09]
    assert found[0].deviation_mm > 20


@pytest.mark.slow
def test_deviations_are_distances_both_ways() -> None:
    """A ball that is fitted to a cube: its corners lie outside, the ball beyond its faces, by closed forms."""
    half = 0.1
    cube = np.array([(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)])
    found = fit(*mesh(cube), kinds=["sphere"])
    (ball,) = found.shapes
    assert isinstance(ball, Sphere)
    off = np.linalg.norm(ball.centre)
    assert found.outside_mm == pytest.approx(1000 * (half * np.sqrt(3) - ball.radius), abs=1000 * off + 0.1)
    assert found.inside_mm == pytest.approx(1000 * (ball.radius - half), abs=1000 * off + 1)
    assert off < 0.01


@pytest.mark.slow
def test_inner_walls_do_not_count() -> None:
    """A box with a smaller box inside it is that box."""
    outer, inner = (Placed("box", PLACE, TURN, s * np.array(SIZES["box"])).surface() for s in (1.0, 0.6))
    found = fit(*both(mesh(outer), mesh(inner)), kinds=["box"])
    assert found.deviation_mm < 4


@pytest.mark.slow
def test_the_answer_is_the_same_each_time() -> None:
    points, faces = mesh(Placed("capsule", PLACE, TURN, np.array(SIZES["capsule"])).surface())
    assert fit(points, faces, kinds=["capsule"]) == fit(points.copy(), faces.copy(), kinds=["capsule"])


@pytest.mark.parametrize("kind", SIZES)
def test_distances_are_zero_on_surfaces_and_grow_by_one(kind: str) -> None:
    sizes = np.array(SIZES[kind])
    points = SURFACES[kind](sizes)
    if kind == "cylinder":
        points = points[np.hypot(*points[:, :2].T) > sizes[0] - 1e-9]
    assert np.abs(DISTANCES[kind](points, sizes)).max() < 1e-9
    away = 3 * directions(50)
    step = 1e-6 * np.eye(3)
    slope = np.array([DISTANCES[kind](away + h, sizes) - DISTANCES[kind](away - h, sizes) for h in step]) / 2e-6
    assert np.linalg.norm(slope, axis=0) == pytest.approx(np.ones(50), abs=1e-6)


def test_axes_are_those_of_the_quaternion() -> None:
    assert np.array(rotation.matrix(quaternion(TURN))) == pytest.approx(TURN)


@first("name", ["fit.png", "fit.svg"])
def test_a_picture_is_drawn(tmp_path: Path, name: str) -> None:
    points, faces = mesh(0.1 * directions(100))
    shapes = (Sphere(0.1), Box((0.1, 0.1, 0.1)), Capsule(0.05, 0.1))
    draw_fit(Fit("spheres", shapes, 1.0, 2.0), points, faces, tmp_path / name, "ball")
    assert (tmp_path / name).read_bytes()[:5] in (b"\x89PNG\r", b"<?xml")
    assert [each.name for each in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize(
    ("points", "faces", "text"),
    [
        ([[0, 0, 0]], [[0, 0, 0]], "no area"),
        ([[0, 0, np.nan]], [[0, 0, 0]], "finite"),
        ([[0, 0, 0]], [[0, 1, 2]], "indices of the 1 vertices"),
        ([[0, 0, 0]], [], "indices"),
    ],
)
def test_what_is_no_mesh_is_refused(points: object, faces: object, text: str) -> None:
    with pytest.raises(SymphysError, match=text):
        fit(points, faces)  # type: ignore[arg-type]


def test_unknown_kinds_are_refused() -> None:
    with pytest.raises(SymphysError, match=r'"torus".*sphere, capsule'):
        fit(*mesh(directions(50)), kinds=["torus"])
