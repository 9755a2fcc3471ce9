"""Every shape is drawn with its outline: boxes, capsules, compounds, fixtures and terrain."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.yard import QUARTER, X, area, write_yard
from matplotlib.patches import Polygon

from symphys.report import write_motion, write_run_report
from symphys.report.charts.contacts import by_surfaces, contacts_chart, pair_normals, shown_pairs
from symphys.report.figures import style
from symphys.report.scene.animation import motion_data
from symphys.report.scene.motion import draw_motion
from symphys.report.scene.panel import make_panel
from symphys.report.scene.views import (
    SIDE_XZ,
    SIDE_YZ,
    TOP,
    TOP_TURNED,
    choose_views,
    corners,
    half_axes,
    inner_edges,
    outline,
)
from symphys.results.scene import Scene, Solid, read_scene
from symphys.results.trajectories import read_trajectory
from symphys.trajectory import Trajectory

SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))
UPRIGHT = np.array([1.0, 0, 0, 0])


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded motion and its scene, to be read only."""
    return write_yard(tmp_path_factory.mktemp("yard"))


@pytest.fixture
def motion(yard: Path) -> Trajectory:
    return read_trajectory(yard / "trajectory.npz")


@pytest.fixture
def scene(yard: Path) -> Scene:
    return read_scene(yard / "scene.json")


def test_outline_of_a_box_is_its_convex_hull() -> None:
    axes = np.random.default_rng(1).standard_normal((3, 2))
    around = outline(SIGNS @ axes, 0.0)
    a, b, c = axes
    parallelograms = [np.linalg.det(np.array(pair)) for pair in ((a, b), (a, c), (b, c))]
    assert area(around) == pytest.approx(4 * sum(abs(p) for p in parallelograms))
    for direction in np.random.default_rng(2).standard_normal((20, 2)):
        assert (around @ direction).max() == pytest.approx(np.abs(axes @ direction).sum())


def test_outline_of_a_capsule_is_a_stadium() -> None:
    around = outline(np.array([[-0.3, -0.4], [0.3, 0.4]]), 0.2)
    assert area(around) == pytest.approx(2 * 0.2 * 1.0 + np.pi * 0.04, rel=5e-3)
    assert np.abs(around[:, 0]).max() == pytest.approx(0.5, rel=5e-3)


def test_outline_of_what_is_seen_along_its_axis_is_a_circle() -> None:
    for axes in (np.zeros((3, 2)), np.array([[0, 0], [1e-16, 0], [0, 1e-17]])):
        np.testing.assert_allclose(np.linalg.norm(outline(SIGNS @ axes, 0.2), axis=1), 0.2)
    assert area(outline(np.zeros((1, 2)), 0.2)) > 0


def test_edges_inside_a_box() -> None:
    """Three from the nearest corner; seen along an axis none; seen along a diagonal of a face the one in front."""
    box = Solid(0.0, SIGNS * [1, 2, 3])
    general = inner_edges(UPRIGHT, box, np.array([0.6, -0.64, 0.48]))
    assert general.shape == (3, 2, 3)
    np.testing.assert_array_equal((general == [1, -2, 3]).all(axis=2).sum(axis=1), 1)
    np.testing.assert_array_equal((general[:, 0] != general[:, 1]).sum(axis=0), 1)
    assert inner_edges(UPRIGHT, box, np.array([0.0, -1.0, 0.0])).shape == (0, 2, 3)
    (front,) = inner_edges(UPRIGHT, box, np.array([0.6, -0.8, 0.0]))
    np.testing.assert_array_equal(np.sort(front[:, 2]), [-3, 3])
    np.testing.assert_array_equal(front[:, :2], [[1, -2], [1, -2]])


@pytest.mark.parametrize("view", [SIDE_XZ, SIDE_YZ, TOP, TOP_TURNED])
def test_the_viewer_is_in_front(view: Any) -> None:
    right, up = np.eye(3)[view.right], np.eye(3)[view.up] * (-1 if view.down else 1)
    assert np.linalg.det([right, up, view.front]) == pytest.approx(1)


def test_corners_turn_with_body_and_part() -> None:
    solid = Solid(0.1, np.array([[0, 0, -2.0], [0, 0, 2]]), np.zeros(3), np.array(QUARTER))
    np.testing.assert_allclose(half_axes(UPRIGHT, solid)[2], [2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(corners(UPRIGHT, solid), [[-2, 0, 0], [2, 0, 0]], atol=1e-12)
    about_z = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    np.testing.assert_allclose(half_axes(about_z, solid)[2], [0, 2, 0], atol=1e-12)
    np.testing.assert_allclose(corners(about_z, solid), [[0, -2, 0], [0, 2, 0]], atol=1e-12)


def test_terrain_and_fixtures_give_a_side_view(motion: Trajectory, scene: Scene) -> None:
    level = replace(motion, position=motion.position * [1, 1, 0])
    assert choose_views(level, Scene()) == [TOP]
    assert choose_views(level, Scene(terrain=scene.terrain)) == [SIDE_XZ, TOP]
    assert choose_views(level, Scene(fixtures=scene.fixtures)) == [SIDE_XZ, TOP]


def test_window_takes_in_what_stands_close_by(motion: Trajectory, scene: Scene) -> None:
    alone, among = (make_panel(SIDE_XZ, motion, s, None) for s in (Scene(bodies=scene.bodies), scene))
    assert among.low[1] < alone.low[1] - 0.3
    room = (alone.high - alone.low).max()
    assert among.high[0] - among.low[0] < 1.8 * room
    far = replace(scene.fixtures[1], solid=replace(scene.fixtures[1].solid, centre=np.array([100.0, 0, 0])))
    beside = make_panel(SIDE_XZ, motion, Scene(bodies=scene.bodies, fixtures=(far,)), None)
    assert beside.high[0] == alone.high[0]


@pytest.mark.slow
def test_everything_is_drawn(motion: Trajectory, scene: Scene) -> None:
    with style.paper():
        side, top = draw_motion(motion, scene).axes
        polygons = [patch for patch in side.patches if isinstance(patch, Polygon)]
        ramp = next(patch.get_xy() for patch in polygons if len(patch.get_xy()) == 5)
        assert sorted(np.round(ramp[:4], 9).tolist()) == [[-0.1, -1], [-0.1, 1], [0.1, -1], [0.1, 1]]
        profile = next(line.get_xydata() for line in side.lines if len(line.get_xdata()) == 17)
        np.testing.assert_allclose(profile[:, 1], 0.1 * X)
        assert "a line of height every 0.1 m" in top.get_title(loc="left")
        assert len(top.collections) >= 2


def test_level_terrain_has_no_lines_of_height(motion: Trajectory, scene: Scene) -> None:
    flat = Scene(terrain=(replace(scene.terrain[0], z=np.ones((3, 17))),))
    with style.paper():
        assert draw_motion(motion, flat).axes[1].get_title(loc="left") == "Top view"


@pytest.mark.slow
def test_page_of_shapes_is_written(yard: Path, tmp_path: Path) -> None:
    text = write_motion(yard / "trajectory.npz", yard / "scene.json", tmp_path / "motion.html").read_text()
    assert "<canvas" in text and "States over time" in text


def test_points_of_two_surfaces_are_one_row(motion: Trajectory, scene: Scene) -> None:
    merged = by_surfaces(motion)
    assert merged.contact_names == ("crate-ground", "hammer-ground")
    assert merged.contact_force[:, :, 2].tolist() == [[3, 7]] * 40
    assert merged.contact_gap.tolist() == [[-0.5, 1.5]] * 41
    assert shown_pairs(merged) == [1, 0]
    chart = contacts_chart(motion, scene)
    assert chart is not None
    titles = [panel.title for panel in chart.panels[::2] if panel]
    assert [title.partition(":")[0] for title in titles] == ["hammer-ground", "crate-ground"]


def test_contacts_with_one_point_stay_as_they_are(motion: Trajectory) -> None:
    single = replace(motion, contact_names=("a-b", "a-c", "odd:name", "b:1x"))
    assert by_surfaces(single) is single


def test_normals_that_shapes_tell(motion: Trajectory, scene: Scene) -> None:
    wanted = replace(motion, contact_names=("crate-hammer[2]", "hammer[0]-ground", "crate-ramp", "crate-hills"))
    assert set(dict(pair_normals(wanted, scene))) == {
        f"{n}-ground" for n in ("crate", *(f"hammer[{k}]" for k in range(3)))
    }


@pytest.mark.slow
def test_pairs_are_counted_by_surfaces(run_dir: Path, edit: Callable[..., None]) -> None:
    with np.load(run_dir / "trajectory.npz") as archive:
        arrays = dict(archive)
    names = [f"ball-ground{k // 8}:{k % 8}" for k in range(72)]
    arrays |= {"contact_names": np.array(names), "contact_force": np.repeat(arrays["contact_force"], 72, 1)}
    np.savez(run_dir / "trajectory.npz", **arrays | {"contact_gap": np.repeat(arrays["contact_gap"], 72, 1)})
    assert "Shown are 6 of 9 pairs" in write_run_report(run_dir).read_text(encoding="utf-8")


def test_data_of_the_page_holds_every_solid(motion: Trajectory, scene: Scene) -> None:
    data: dict[str, Any] = motion_data(motion, scene, None, 10_000)
    assert [len(body["solids"]) for body in data["bodies"]] == [1, 3]
    assert data["bodies"][1]["solids"][2] == {"radius": 0.1, "centre": [-0.3, 0, 0]}
    assert len(data["fixtures"]) == 2
    assert data["terrain"][0]["z"].count(None) == 17
    json.dumps(data, allow_nan=False)
