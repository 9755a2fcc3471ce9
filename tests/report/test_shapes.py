"""Boxes, capsules, compounds, fixtures and terrain: how they are read, seen from the side, and played."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from symphys.report import style, write_motion, write_run_report
from symphys.report.animation import motion_data
from symphys.report.contacts import by_surfaces, draw_contacts, pair_normals, shown_pairs
from symphys.report.markup import HERE
from symphys.report.motion import draw_motion
from symphys.report.outlines import inner_edges, outline
from symphys.report.panel import make_panel
from symphys.report.recordings import read_trajectory
from symphys.report.records import Trajectory
from symphys.report.run_page import Recording, sizes
from symphys.report.scene_file import read_scene
from symphys.report.scenery import Scene, Solid
from symphys.report.views import SIDE_XZ, SIDE_YZ, TOP, TOP_TURNED, choose_views, half_axes

Array = NDArray[np.float64]
QUARTER = [float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0]
X = np.linspace(-4, 4, 17)
YARD: dict[str, Any] = {
    "bodies": [
        {"name": "crate", "shapes": [{"kind": "box", "size": [0.4, 0.3, 0.2], "centre": [0, 0, 0]}]},
        {
            "name": "hammer",
            "shapes": [
                {"kind": "capsule", "radius": 0.05, "length": 0.6, "centre": [0, 0, 0], "orientation": QUARTER},
                {"kind": "box", "size": [0.1, 0.4, 0.2], "centre": [0.3, 0, 0], "orientation": [2, 0, 0, 0]},
                {"kind": "sphere", "radius": 0.1, "centre": [-0.3, 0, 0]},
            ],
        },
    ],
    "planes": [{"name": "ground", "normal": [0, 0, 1], "offset": -1.0}],
    "fixtures": [
        {"name": "ramp", "shape": {"kind": "box", "size": [2, 1, 0.2], "centre": [0, 0, 0], "orientation": QUARTER}},
        {"name": "post", "shape": {"kind": "capsule", "radius": 0.1, "length": 1, "centre": [2, 0, 0]}},
    ],
    "terrain": [{"name": "hills", "x": X.tolist(), "y": [-1, 1, 2], "z": [(0.1 * X).tolist()] * 2 + [["nan"] * 17]}],
}


def motion_of(names: list[str], steps: int = 40) -> dict[str, Any]:
    """Bodies beside each other that move along x and turn about y, with two points of contact each."""
    count, time = len(names), np.linspace(0, 1, steps + 1)
    position = np.stack([np.stack([3 * time - 1.5, 0 * time + b, 1 + 0.5 * time], 1) for b in range(count)], 1)
    turned = np.stack([np.cos(time), 0 * time, np.sin(time), 0 * time], 1)
    contacts = [f"{name}-ground:{k}" for name in names for k in range(2)]
    force = np.zeros((steps, 2 * count, 3))
    force[:, :, 2] = 1 + np.arange(2 * count)
    return {
        "time": time,
        "body_names": np.array(names),
        "position": position,
        "orientation": np.repeat(turned[:, None], count, 1),
        "velocity": np.zeros_like(position),
        "angular_velocity": np.zeros_like(position),
        "contact_names": np.array(contacts),
        "contact_force": force,
        "contact_gap": np.tile(np.arange(2 * count) - 0.5, (steps + 1, 1)),
    }


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded motion and its scene, to be read only."""
    folder = tmp_path_factory.mktemp("yard")
    np.savez(folder / "trajectory.npz", **motion_of(["crate", "hammer"]))
    (folder / "scene.json").write_text(json.dumps(YARD))
    return folder


@pytest.fixture
def motion(yard: Path) -> Trajectory:
    return read_trajectory(yard / "trajectory.npz")


@pytest.fixture
def scene(yard: Path) -> Scene:
    return read_scene(yard / "scene.json")


def area(points: Array) -> float:
    x, y = points.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def test_scene_is_read(scene: Scene) -> None:
    (crate,), (handle, head, ball) = scene.solids("crate"), scene.solids("hammer")
    assert (crate.half.tolist(), crate.radius, crate.girth) == ([0.2, 0.15, 0.1], 0, 0.1)
    assert (handle.half.tolist(), handle.radius, handle.girth) == ([0, 0, 0.3], 0.05, 0.05)
    assert head.orientation.tolist() == [1, 0, 0, 0]
    assert ball.is_ball
    assert [fixture.name for fixture in scene.fixtures] == ["ramp", "post"]
    (hills,) = scene.terrain
    assert hills.z.shape == (3, 17)
    assert np.isnan(hills.z[2]).all()


@pytest.mark.parametrize(
    "broken",
    [
        {"kind": "box", "size": [1, 0, 1]},
        {"kind": "box", "size": [1, 1]},
        {"kind": "box"},
        {"kind": "capsule", "radius": 1, "length": "inf"},
        {"kind": "capsule", "radius": -1, "length": 1},
        {"kind": "torus", "radius": 1},
        {"kind": "sphere"},
        {"kind": "sphere", "radius": 1, "centre": [0, "inf", 0]},
        {},
    ],
)
def test_shapes_that_cannot_be_read_are_left_out(tmp_path: Path, broken: dict[str, Any]) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps({"bodies": [{"name": "a", "shapes": [broken, 3]}], "fixtures": [{"shape": broken}, 3]}))
    assert read_scene(path) == Scene(bodies=read_scene(path).bodies)
    assert read_scene(path).solids("a") == ()


@pytest.mark.parametrize(
    "broken",
    [
        {"z": []},
        {"z": [[1, 2], [3]]},
        {"z": [[1, 2]], "y": [0]},
        {"z": "hills"},
        {"x": [0, 0], "z": [[1, 2], [3, 4]]},
        {"x": [0, "nan"], "z": [[1, 2], [3, 4]]},
    ],
)
def test_terrain_that_cannot_be_read_is_left_out(tmp_path: Path, broken: dict[str, Any]) -> None:
    path = tmp_path / "scene.json"
    entry = {"name": "hills", "x": [0, 1], "y": [0, 1], **broken}
    path.write_text(json.dumps({"terrain": [entry, 3]}))
    assert read_scene(path).terrain == ()


def test_outline_of_a_box_is_its_convex_hull() -> None:
    axes = np.random.default_rng(1).standard_normal((3, 2))
    around = outline(axes, 0.0)
    a, b, c = axes
    parallelograms = [np.linalg.det(np.array(pair)) for pair in ((a, b), (a, c), (b, c))]
    assert area(around) == pytest.approx(4 * sum(abs(p) for p in parallelograms))
    for direction in np.random.default_rng(2).standard_normal((20, 2)):
        assert (around @ direction).max() == pytest.approx(np.abs(axes @ direction).sum())


def test_outline_of_a_capsule_is_a_stadium() -> None:
    around = outline(np.array([[0, 0], [0, 0], [0.3, 0.4]]), 0.2)
    assert area(around) == pytest.approx(2 * 0.2 * 1.0 + np.pi * 0.04, rel=5e-3)
    assert np.abs(around[:, 0]).max() == pytest.approx(0.5, rel=5e-3)


def test_outline_of_what_is_seen_along_its_axis_is_a_circle() -> None:
    for axes in (np.zeros((3, 2)), np.array([[0, 0], [1e-16, 0], [0, 1e-17]])):
        np.testing.assert_allclose(np.linalg.norm(outline(axes, 0.2), axis=1), 0.2)
    assert area(outline(np.zeros((3, 2)), 0.2)) > 0


def test_edges_inside_a_box() -> None:
    """Three from the nearest corner; seen along an axis none; seen along a diagonal of a face the one in front."""
    axes = np.diag([1.0, 2.0, 3.0])
    general = inner_edges(axes, np.array([0.6, -0.64, 0.48]))
    assert general.shape == (3, 2, 3)
    np.testing.assert_array_equal(general[:, 0], np.tile([1, -2, 3], (3, 1)))
    assert inner_edges(axes, np.array([0.0, -1.0, 0.0])).shape == (0, 2, 3)
    (front,) = inner_edges(axes, np.array([0.6, -0.8, 0.0]))
    np.testing.assert_array_equal(np.sort(front[:, 2]), [-3, 3])
    np.testing.assert_array_equal(front[:, :2], [[1, -2], [1, -2]])


@pytest.mark.parametrize("view", [SIDE_XZ, SIDE_YZ, TOP, TOP_TURNED])
def test_the_viewer_is_in_front(view: Any) -> None:
    right, up = np.eye(3)[view.right], np.eye(3)[view.up] * (-1 if view.down else 1)
    assert np.linalg.det([right, up, view.front]) == pytest.approx(1)


def test_half_axes_turn_with_body_and_part() -> None:
    solid = Solid(0.1, np.array([0.0, 0.0, 2.0]), np.zeros(3), np.array(QUARTER))
    np.testing.assert_allclose(half_axes(np.array([1.0, 0, 0, 0]), solid)[2], [2, 0, 0], atol=1e-12)
    about_z = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    np.testing.assert_allclose(half_axes(about_z, solid)[2], [0, 2, 0], atol=1e-12)


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


def test_page_of_shapes_is_written(yard: Path, tmp_path: Path) -> None:
    text = write_motion(yard / "trajectory.npz", yard / "scene.json", tmp_path / "motion.html").read_text()
    assert "spokes and edges turn with it" in text


def test_points_of_two_surfaces_are_one_row(motion: Trajectory, scene: Scene) -> None:
    merged = by_surfaces(motion)
    assert merged.contact_names == ("crate-ground", "hammer-ground")
    assert merged.contact_force[:, :, 2].tolist() == [[3, 7]] * 40
    assert merged.contact_gap.tolist() == [[-0.5, 1.5]] * 41
    assert shown_pairs(merged) == [1, 0]
    with style.paper():
        figure = draw_contacts(motion, scene)
        assert figure is not None
        assert [axes.get_ylabel() for axes in figure.axes[::2]] == ["hammer-ground", "crate-ground"]


def test_contacts_with_one_point_stay_as_they_are(motion: Trajectory) -> None:
    single = replace(motion, contact_names=("a-b", "a-c", "odd:name", "b:1x"))
    assert by_surfaces(single) is single


def test_normals_that_shapes_tell(motion: Trajectory, scene: Scene) -> None:
    wanted = replace(motion, contact_names=("crate-hammer[2]", "hammer[0]-ground", "crate-ramp", "crate-hills"))
    assert set(dict(pair_normals(wanted, scene))) == {
        f"{n}-ground" for n in ("crate", *(f"hammer[{k}]" for k in range(3)))
    }


def test_smallest_size_counts_for_trust(motion: Trajectory, scene: Scene) -> None:
    assert sizes(Recording(motion, None, scene, ())).radius == 0.05
    crate = Scene(bodies=scene.bodies[:1])
    assert sizes(Recording(motion, None, crate, ())).radius == pytest.approx(0.1)


def test_pairs_are_counted_by_surfaces(run_dir: Path, edit: Callable[..., None]) -> None:
    with np.load(run_dir / "trajectory.npz") as archive:
        arrays = dict(archive)
    names = [f"ball-ground{k // 8}:{k % 8}" for k in range(72)]
    arrays |= {"contact_names": np.array(names), "contact_force": np.repeat(arrays["contact_force"], 72, 1)}
    np.savez(run_dir / "trajectory.npz", **arrays | {"contact_gap": np.repeat(arrays["contact_gap"], 72, 1)})
    assert "Shown are 6 of 9 pairs" in write_run_report(run_dir).read_text(encoding="utf-8")


# The scripts of the page


def run_script(code: str) -> Any:
    """What an expression of the page's geometry gives."""
    script = "".join((HERE / name).read_text(encoding="utf-8") for name in ("geometry.js", "solids.js", "terrain.js"))
    done = subprocess.run(
        ["node", "-"],
        input=f"{script}\nconsole.log(JSON.stringify({code}));",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    return json.loads(done.stdout)


needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="needs node to run the page's script")
EYE = "camera(-2, 0.4)"


@needs_node
@pytest.mark.parametrize("radius", [0.0, 0.3])
def test_script_and_figures_have_the_same_outline(radius: float) -> None:
    axes = np.random.default_rng(1).standard_normal((3, 2))
    found = np.array(run_script(f"outline({axes.tolist()}, {radius})"))
    assert area(found) == pytest.approx(area(outline(axes, radius)))


def placed(solid: Solid, name: str, fixed: bool = False) -> str:
    data = {
        "radius": solid.radius,
        "centre": solid.centre.tolist(),
        "half": solid.half.tolist(),
        "q": solid.orientation.tolist(),
    }
    if solid.is_ball:
        del data["half"], data["q"]
    return f"place({json.dumps(data)}, {{ p: [0, 0, 0], q: [1, 0, 0, 0] }}, '{name}', {str(fixed).lower()})"


RAMP = Solid(0.0, np.array([2.0, 1, 0.1]))


@needs_node
def test_what_lies_on_a_large_block_is_drawn_after_it() -> None:
    """Also at its far end, where its centre is farther away than that of the block."""
    for x, y in ((-1.8, 0.9), (1.8, 0.9), (1.8, -0.9), (-1.8, -0.9)):
        for solid in (Solid(0.1, centre=np.array([x, y, 0.2])), Solid(0.0, np.full(3, 0.1), np.array([x, y, 0.2]))):
            both = f"[{placed(solid, 'top')}, {placed(RAMP, 'ramp')}]"
            assert run_script(f"inOrder({both}, {EYE}).map((s) => s.colour)") == ["ramp", "top"]
            under = replace(solid, centre=solid.centre * [1, 1, -1])
            both = f"[{placed(under, 'below')}, {placed(RAMP, 'ramp')}]"
            assert run_script(f"inOrder({both}, {EYE}).map((s) => s.colour)") == ["below", "ramp"]


@needs_node
def test_what_is_beside_each_other_does_not_overlap() -> None:
    ramp, ball = placed(RAMP, "ramp"), placed(Solid(0.1, centre=np.array([0.0, 0, 3.0])), "ball")
    assert run_script(f"overlap({ramp}, {ball}, {EYE})") is False
    near = placed(Solid(0.1, centre=np.array([0.0, 0, 0.2])), "ball")
    assert run_script(f"overlap({ramp}, {near}, {EYE})") is True


@needs_node
def test_terrain_between_its_heights() -> None:
    hills = "{ x: [0, 1, 2], y: [0, 2], z: [0, 1, 1, 0, 1, null] }"
    assert run_script(f"heightAt({hills}, 0.25, 1)") == pytest.approx(0.25)
    assert run_script(f"heightAt({hills}, 1.5, 1)") is None
    assert run_script(f"heightAt({hills}, -1, 1)") is None
    assert run_script(f"mesh({hills}, []).length") == 1
    assert run_script(f"mesh({hills}, [{{ normal: [0, 0, 1], offset: 2 }}]).length") == 0
    assert len(run_script(f"rim({hills})")) == 5


@needs_node
def test_data_of_the_page_holds_every_solid(motion: Trajectory, scene: Scene) -> None:
    data: dict[str, Any] = motion_data(motion, scene, None, 10_000)
    assert [len(body["solids"]) for body in data["bodies"]] == [1, 3]
    assert data["bodies"][1]["solids"][2] == {"radius": 0.1, "centre": [-0.3, 0, 0]}
    assert len(data["fixtures"]) == 2
    assert data["terrain"][0]["z"].count(None) == 17
    json.dumps(data, allow_nan=False)
