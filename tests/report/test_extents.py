"""A page for everything that can be simulated: no surface, one point, one step, huge and tiny extents."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from tools.repeats import few

from symphys.report.charts.motion import motion_charts
from symphys.report.figures import style
from symphys.report.figures.run import draw_figures
from symphys.report.robots.strip import draw_strip
from symphys.report.scene.animation import animation
from symphys.report.scene.motion import draw_motion
from symphys.report.scene.panel import make_panel
from symphys.report.scene.views import SIDE_XZ
from symphys.results.scene import Scene, read_scene
from symphys.results.trajectories import make_trajectory
from symphys.trajectory import Trajectory

UP, ALONG = (0, 0, 1), (1, 2, 3)


def motion(
    start: float = 0.0,
    extent: float = 0.0,
    steps: int = 2,
    dt: float = 0.02,
    bodies: int = 1,
    towards: tuple[int, int, int] = ALONG,
) -> Trajectory:
    """Bodies at one height that go the same way, ``extent`` [m] in all."""
    share = np.linspace(0, 1, steps + 1)[:, None, None]
    position = start * np.array(UP) + extent * share * np.array(towards) + np.zeros((1, bodies, 1))
    moving = {key: np.full((steps + 1, bodies, 3), extent) for key in ("velocity", "angular_velocity")}
    acting = {key: np.full((steps, bodies, 3), extent) for key in ("force", "torque")}
    names = np.array([f"b{k}" for k in range(bodies)])
    return make_trajectory(
        {"time": dt * np.arange(steps + 1), "body_names": names, "position": position, **moving, **acting}
    )


def scene(folder: Path, bodies: int = 1, radius: float = 0.0, joint: bool = False, ground: bool = False) -> Scene:
    """Balls, or bodies without a surface, with a hinge at their centres that the world holds."""
    names = [f"b{k}" for k in range(bodies)]
    shapes = [{"kind": "sphere", "radius": radius, "centre": [0, 0, 0]}] if radius else []
    side = {"point": [0, 0, 0], "orientation": [1, 0, 0, 0]}
    turning = {"kind": "hinge", "sockets": [side, side], "coordinates": [{"name": "angle", "turns": True}]}
    value: dict[str, Any] = {
        "bodies": [{"name": name, "shapes": shapes} for name in names],
        "planes": [{"name": "ground", "normal": [0, 0, 1], "offset": 0.0}] if ground else [],
        "joints": [{"name": f"j{name}", "first": name, "second": None, **turning} for name in names] if joint else [],
    }
    (folder / "scene.json").write_text(json.dumps(value), "utf-8")
    found = read_scene(folder / "scene.json")
    assert len(found.joints) == bodies * joint
    return found


MOTIONS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "a pendulum at rest, without a surface": ({"start": -0.5}, {"joint": True}),
    "a point that is nowhere else": ({}, {}),
    "one state": ({"start": 1e-300, "steps": 0}, {"joint": True}),
    "one step of no time": ({"extent": 1.0, "steps": 1, "dt": 0.0}, {"joint": True, "ground": True}),
    "nine in one place far away": ({"start": 1e12, "bodies": 9}, {"bodies": 9, "joint": True}),
    "points that go far": ({"extent": 1e6, "bodies": 9}, {"bodies": 9, "joint": True}),
    "points that go nowhere else": ({"extent": 1e-20, "bodies": 9}, {"bodies": 9, "joint": True, "ground": True}),
    "a small way, far away": ({"start": 1e12, "extent": 1e-9}, {"radius": 1e-60, "ground": True}),
    "tiny": ({"start": 1e-60, "extent": 1e-60}, {"radius": 1e-60, "joint": True}),
    "huge": ({"extent": 1e49, "dt": 1e40}, {"radius": 1e49, "joint": True}),
    "a grain that goes far": ({"extent": 1e9, "towards": (0, 0, 1)}, {"radius": 1e-9, "joint": True}),
}


@few("name", MOTIONS, 4)
def test_whatever_its_extent_a_motion_is_drawn(tmp_path: Path, name: str) -> None:
    moved, seen = MOTIONS[name]
    trajectory, world = motion(**moved), scene(tmp_path, **seen)
    with style.paper():
        assert style.svg_text(draw_motion(trajectory, world, trajectory)).endswith("</svg>\n")
        if strip := draw_strip(trajectory, world):
            assert style.svg_text(strip).endswith("</svg>\n")
    assert animation(trajectory, world, trajectory)
    panel = make_panel(SIDE_XZ, trajectory, world, None)
    places = SIDE_XZ.flat(trajectory.position)
    size = np.abs([panel.low, panel.high]).max()
    assert (panel.low < places.min(axis=(0, 1))).all() and (panel.high > places.max(axis=(0, 1))).all()
    assert panel.span.max() > 1e-10 * size, "an axis has room for numbers"


def test_a_motion_without_any_extent_has_all_its_figures(tmp_path: Path) -> None:
    still, hinged = motion(start=-0.5), scene(tmp_path, joint=True)
    found = {picture.name for picture in draw_figures(motion_charts(still, hinged), still, hinged)}
    assert {"motion", "strip", "states"} <= found


def test_axes_see_a_point_as_a_box_about_it_and_leave_all_else() -> None:
    low, high = style.apart(np.array([0.0, -0.5]), np.array([0.0, -0.5]))
    assert np.allclose((low + high) / 2, [0, -0.5]) and np.allclose(high - low, 0.1)
    low, high = style.apart(np.zeros(2), np.zeros(2))
    assert (low == -0.5).all() and (high == 0.5).all()
    kept = np.array([1e6, 0.0]), np.array([1e6 + 1e-2, 0.0])
    assert style.apart(*kept) == kept
