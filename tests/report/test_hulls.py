"""Solids are drawn as rounded hulls of corners, whatever their kind; many corners approximate a curved surface."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import pairwise, product
from math import pi
from typing import Any

import numpy as np
import pytest
from data.walker import SCENE, motion
from data.yard import QUARTER, area, motion_of, prism
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from tools.page_scripts import NODE, plays_to_the_end, run_script
from tools.repeats import few

from symphys.model.shapes import SHAPES, Capsule, RoundedHull
from symphys.report.figures import style
from symphys.report.robots.poses import RobotDrawing
from symphys.report.scene.animation import motion_data, solid_data
from symphys.report.scene.motion import draw_motion
from symphys.report.scene.views import SIDE_XZ, TOP, choose_views, inner_edges, outline
from symphys.results.polytope import Polytope, make_polytope
from symphys.results.scene import Scene, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

Load = Callable[..., tuple[Trajectory, Scene]]
UPRIGHT = np.array([1.0, 0, 0, 0])
STILL = "{ p: [1, 2, 3], q: [1, 0, 0, 0] }"
CYLINDER = Solid(0.0, prism(24, 0.3, 0.5))
BALL = np.random.default_rng(7).standard_normal((60, 3))
BALL /= np.linalg.norm(BALL, axis=1, keepdims=True)


class Drum(Capsule):
    """A shape that the package does not have, of the sizes of a capsule."""

    kind = "drum"

    @property
    def rounded_hull(self) -> RoundedHull:
        corners = prism(24, float(self.radius), float(self.half_length))
        return RoundedHull(0.0, tuple((x, y, z) for x, y, z in corners.tolist()))


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SHAPES, "drum", Drum)


def polytope(corners: Array) -> Polytope:
    return make_polytope(tuple(map(tuple, corners.tolist())))


def of_script(points: Array) -> Array:
    """The outline that the page draws."""
    return np.array(run_script(f"outline({points.tolist()}, 0)"))


def volume(corners: Array, found: Polytope) -> float:
    """By the tetrahedra from the origin to each face; positive if all faces are ordered outward."""
    fans = [(face[0], *pair) for face in found.faces for pair in pairwise(face[1:])]
    return float(np.linalg.det(corners[np.array(fans)]).sum() / 6)


@few("stretch", [(1, 1, 1), (1, 1e-3, 1), (1e-6, 1, 1), (1e20, 1e20, 1e19)], 2)
@pytest.mark.parametrize(
    "corners",
    [
        np.array(list(product((-1.0, 1.0), repeat=3))),
        np.array(list(product(np.linspace(-1, 1, 4), repeat=3))),
        prism(24),
        BALL,
        np.random.default_rng(1).standard_normal((4, 3)),
        np.random.default_rng(2).standard_normal((30, 3)),
    ],
    ids=["box", "grid", "prism", "ball", "tetrahedron", "random"],
)
def test_faces_enclose_the_hull(corners: Array, stretch: tuple[float, float, float]) -> None:
    """Euler's formula, the volume, and no point outside of a face."""
    for turned in (Rotation.identity(), *Rotation.random(5, random_state=1)):
        points = turned.apply(corners * stretch)
        found, size = polytope(points), np.abs(points).max()
        count = len({corner for face in found.faces for corner in face})
        assert count - len(found.edges) + len(found.faces) == 2
        assert count == len(ConvexHull(corners).vertices)
        assert volume(points, found) == pytest.approx(ConvexHull(corners).volume * np.prod(stretch), rel=1e-5)
        for face, normal in zip(found.faces, found.normals, strict=True):
            assert ((points - points[face[0]]) @ normal).max() < 1e-7 * size


def test_faces_in_one_plane_are_one() -> None:
    box, cylinder = polytope(np.array(list(product((-1.0, 1.0), (-2.0, 2.0), (-3.0, 3.0))))), CYLINDER.polytope
    assert (len(box.faces), len(box.edges), box.inradius) == (6, 12, 1)
    assert sorted(map(len, cylinder.faces)) == [4] * 24 + [24] * 2
    assert cylinder.inradius == pytest.approx(0.3 * np.cos(pi / 24))


def test_edges_of_a_curved_surface_are_not_sharp() -> None:
    """Of a prism with many sides only those at its ends are; of a box and of a prism with six sides all."""
    assert polytope(np.array(list(product((-1.0, 1.0), repeat=3)))).sharp.all()
    assert polytope(prism(6)).sharp.all()
    sharp = CYLINDER.polytope.edges[CYLINDER.polytope.sharp, :2]
    assert len(sharp) == 48
    assert np.ptp(CYLINDER.corners[sharp][..., 2], axis=1).max() == 0


@pytest.mark.parametrize("count", [1, 2, 24])
def test_corners_without_volume_make_no_solid(count: int) -> None:
    """A point and a line have no faces; a plate has two, back to back."""
    found = polytope(prism(24, half=0.0)[:24] if count == 24 else np.array([[0, 0, -1.0], [0, 0, 1]])[:count])
    assert [len(face) for face in found.faces] == ([24, 24] if count == 24 else [])
    assert found.inradius == 0
    assert np.abs(found.normals.sum(axis=0)).max() == 0


@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_outline_of_a_cylinder_touches_its_supporting_lines(radius: float) -> None:
    """Also seen along its axis and from the side, where many corners lie behind each other."""
    for axes in (*np.random.default_rng(3).standard_normal((5, 3, 2)), np.eye(3)[:, :2], np.eye(3)[:, 1:]):
        points = CYLINDER.corners @ axes
        around = outline(points, radius)
        assert area(around) > 0
        for angle in np.linspace(0, 2 * pi, 50):
            direction = np.array([np.cos(angle), np.sin(angle)])
            far = (points @ direction).max() + radius
            assert (around @ direction).max() == pytest.approx(far, abs=5e-3 * radius + 1e-12)
        edges, after = np.roll(around, -1, axis=0) - around, np.roll(around, -2, axis=0) - np.roll(around, -1, axis=0)
        assert (edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]).min() > -1e-12, "it is convex"


@pytest.mark.slow
@pytest.mark.parametrize("by", [lambda points: outline(points, 0.0), pytest.param(of_script, marks=NODE)])
def test_rounding_does_not_change_an_outline(by: Callable[[Array], Array]) -> None:
    """Seen along an axis, many corners lie behind each other and on the sides of the outline, nearly."""
    grid = np.array(list(product(np.linspace(-1, 1, 4), repeat=2)) * 2)
    for seed in range(10):
        noise = 1e-16 * np.random.default_rng(seed).standard_normal(grid.shape)
        found = by(np.random.default_rng(seed).permutation(grid + noise))
        assert sorted(found.round(9).tolist()) == [[-1, -1], [-1, 1], [1, -1], [1, 1]]


def test_outline_of_a_cylinder_from_its_sides() -> None:
    assert area(outline(CYLINDER.corners[:, :2], 0.0)) == pytest.approx(12 * 0.09 * np.sin(pi / 12))
    side = outline(CYLINDER.corners[:, [0, 2]], 0.0)
    assert sorted(side.round(12).tolist()) == [[-0.3, -0.5], [-0.3, 0.5], [0.3, -0.5], [0.3, 0.5]]


@pytest.mark.parametrize("end", [(0.3, 0.4), (-0.3, 0.4), (0.5, 0), (0, 0.5), (-1e-3, 0.5)])
def test_outline_of_a_capsule_has_round_ends_wherever_it_leans(end: tuple[float, float]) -> None:
    around = outline(np.array([end, (-end[0], -end[1])]), 0.2)
    straight = np.hypot(*end)
    assert area(around) == pytest.approx(4 * 0.2 * straight + pi * 0.04, rel=5e-3)
    assert np.linalg.norm(around, axis=1).max() == pytest.approx(straight + 0.2, rel=5e-3)


def test_inner_edges_of_a_cylinder() -> None:
    """The near half of the base that is seen; from the side, along the axis and of a ball none."""
    oblique = inner_edges(UPRIGHT, CYLINDER, np.array([0.0, -0.8, 0.6]))
    assert len(oblique) in (11, 12, 13)
    np.testing.assert_array_equal(oblique[..., 2], 0.5)
    assert oblique[..., 1].max() < 0.05
    assert len(inner_edges(UPRIGHT, CYLINDER, np.array([0.6, -0.8, 0.0]))) == 0
    assert len(inner_edges(UPRIGHT, CYLINDER, np.array([0.0, 0.0, 1.0]))) == 0
    assert len(inner_edges(UPRIGHT, Solid(0.1), np.array([0.0, 0.0, 1.0]))) == 0
    lying = inner_edges(np.array(QUARTER), CYLINDER, np.array([0.6, -0.8, 0.0]))
    np.testing.assert_allclose(lying[..., 0], 0.5)


@pytest.mark.slow
@NODE
@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_support_of_the_script(radius: float) -> None:
    """Radius and the farthest corner, also where the opposite side is nearer."""
    tent = Solid(radius, np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, 2]]), orientation=np.array(QUARTER))
    for solid in (Solid(0.4), Solid(0.4, np.array([[0, 0, -1.0], [0, 0, 1]])), Solid(radius, CYLINDER.corners), tent):
        turned = Rotation.from_quat(solid.orientation[[1, 2, 3, 0]]).apply(solid.corners)
        for n in ([0, 0, 1.0], [0, 0, -1.0], [0.6, -0.64, 0.48], [-0.6, 0.64, -0.48]):
            found = run_script(f"support(place({json.dumps(solid_data(solid))}, {STILL}, '', false), {n})")
            assert found == pytest.approx((turned @ n).max() + solid.radius, abs=1e-5)


@NODE
def test_faces_of_the_script() -> None:
    """Their normals point outward; an edge that is not drawn names the face beyond it."""
    faces = run_script(f"place({json.dumps(solid_data(CYLINDER))}, {STILL}, '', false).faces")
    np.testing.assert_allclose([face["normal"] for face in faces], CYLINDER.polytope.normals, atol=1e-5)
    np.testing.assert_allclose(np.concatenate([face["corners"] for face in faces]).mean(axis=0), [1, 2, 3], atol=1e-5)
    for f, face in enumerate(faces):
        corners = np.array(face["corners"])
        upright = np.roll(corners, -1, axis=0)[:, 2] != corners[:, 2]
        assert [beyond >= 0 for beyond in face["smooth"]] == upright.tolist()
        assert all(f in faces[beyond]["smooth"] for beyond in face["smooth"] if beyond >= 0)


def test_a_box_has_all_its_edges_drawn() -> None:
    data = solid_data(Solid(0.0, np.array(list(product((-1.0, 1.0), repeat=3)))))
    assert set(data) == {"radius", "centre", "corners", "q", "faces"}
    assert set(solid_data(Solid(0.1, np.array([[0, 0, -1.0], [0, 0, 1]])))) == {"radius", "centre", "corners", "q"}


def yard_of(kind: str) -> dict[str, Any]:
    """A scene of one body and a block of this kind."""
    shape = {"kind": kind, "radius": 0.3, "length": 1.0, "centre": [0, 0, 0], "orientation": UPRIGHT.tolist()}
    block = {"name": "log", "shape": {**shape, "centre": [0, 2.0, -1], "orientation": QUARTER}}
    ground = {"name": "ground", "normal": [0, 0, 1], "offset": -1.0}
    return {"bodies": [{"name": "can", "shapes": [shape]}], "planes": [ground], "fixtures": [block]}


def test_a_shape_is_unknown_until_it_is_listed() -> None:
    assert Scene.from_json(yard_of("drum")).solids("can") == ()


@pytest.mark.usefixtures("known")
def test_figures_draw_a_shape_that_they_have_never_met(load: Load) -> None:
    trajectory, scene = load(motion_of(["can"]), yard_of("drum"))
    assert Scene.from_json(scene.to_json()).to_json() == scene.to_json()
    with style.paper():
        side, top = draw_motion(trajectory, scene).axes
    assert [view.title for view in choose_views(trajectory, scene)] == [SIDE_XZ.title, TOP.title]
    first = next(patch.get_xy() for patch in side.patches if isinstance(patch, Polygon) and len(patch.get_xy()) == 5)
    assert sorted(first[:4].round(9).tolist()) == [[-0.5, -1.3], [-0.5, -0.7], [0.5, -1.3], [0.5, -0.7]], "the log"
    rings = [patch.get_xy() for patch in top.patches if isinstance(patch, Polygon) and len(patch.get_xy()) == 25]
    assert np.linalg.norm(rings[0] - [-1.5, 0], axis=1) == pytest.approx(0.3)


@NODE
@pytest.mark.usefixtures("known")
def test_the_page_plays_a_shape_that_it_has_never_met(load: Load) -> None:
    data: dict[str, Any] = motion_data(*load(motion_of(["can"]), yard_of("drum")), None, 10_000)
    (solid,), (log,) = data["bodies"][0]["solids"], data["fixtures"]
    assert len(solid["corners"]) == 3 * 48
    assert len(solid["faces"]) == len(solid["smooth"]) == len(log["faces"]) == 26
    plays_to_the_end(data)


@pytest.mark.usefixtures("known")
def test_robots_may_have_a_shape_that_is_new(load: Load) -> None:
    links = json.loads(json.dumps(SCENE).replace('"capsule"', '"drum"'))
    trajectory, scene = load(motion(), links)
    with style.paper():
        axes = draw_motion(trajectory, scene).axes[0]
        RobotDrawing(axes, SIDE_XZ, trajectory, scene, 0).draw()
    assert json.dumps(motion_data(trajectory, scene, None, 1000)).count('"smooth"') == 8
