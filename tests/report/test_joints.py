"""Figures and tables of joints agree with the recorded angles, limits, commands, torques and separations."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.walker import DT, SCENE, STEPS, hinge, motion, write_walker
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from tools.repeats import first

from symphys.report import write_motion, write_run_figures, write_run_report
from symphys.report.charts.palette import BEYOND
from symphys.report.figures import style
from symphys.report.figures.drawing import draw_chart
from symphys.report.pages.motion import limits_sentence, motors_sentence, separation_sentence
from symphys.report.robots.joint_charts import COMMAND, SATURATED, axis_range, joint_charts, make_grid, shown
from symphys.report.robots.joint_use import channels, separation
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory

Load = Callable[..., tuple[Trajectory, Scene]]
KNEE = 3
"""fr_knee among the joints."""


@pytest.fixture(autouse=True)
def _on_paper() -> Iterator[None]:
    with style.paper():
        yield


def worked() -> dict[str, Any]:
    """One knee is at its bounds for 12 of 40 steps, up and down, and just below them for another 8."""
    arrays = motion()
    torque = arrays["joint_torque"][:, KNEE, 0]
    torque[5:11], torque[20:26], torque[30:38] = 30.0, -30.0, 29.9
    return arrays


def panel(axes: list[Axes], title: str) -> Axes:
    (found,) = [each for each in axes if each.get_title(loc="left") == title]
    return found


def test_saturation_is_the_share_of_the_time_at_the_bounds(load: Load) -> None:
    every = channels(*load(worked()))
    assert [channel.share for channel in every] == [0.3 if k == KNEE else 0.0 for k in range(8)]
    assert motors_sentence(every) == "1 of 8 motors is saturated at some time, fr_knee, for 30 % of the time."
    assert motors_sentence(every[:2]) == "No motor is ever saturated: each could give more at all times."
    assert motors_sentence([every[KNEE]]) == "The motor of fr_knee is saturated for 30 % of the time."
    assert motors_sentence(every[:1]) == "The motor is never saturated: it could give more at all times."
    assert motors_sentence([]) == ""


@pytest.mark.slow
def test_saturation_is_marked_where_it_is(load: Load) -> None:
    _, chart = joint_charts(*load(worked()))
    figure = draw_chart(chart)
    axes = panel(figure.axes, "fr_knee [N m]")
    (mark,) = [line.get_xydata() for line in axes.lines if line.get_color() == SATURATED]
    stretches = sorted((*np.round(part[:2, 0], 9).tolist(), float(part[0, 1])) for part in mark.reshape(-1, 3, 2))
    assert np.isnan(mark[2::3, 1]).all()
    assert stretches == [(5 * DT, 11 * DT, 30.0), (20 * DT, 26 * DT, -30.0)]
    assert axes.get_title(loc="right") == "saturated 30 %"
    other = panel(figure.axes, "fl_knee [N m]")
    assert not [line for line in other.lines if line.get_color() == SATURATED]
    assert other.get_title(loc="right") == ""


@pytest.mark.slow
def test_targets_of_servos_are_dashed_and_limits_shaded(load: Load) -> None:
    arrays = motion()
    arrays["joint_command"][:, KNEE, 0] = np.linspace(0, 0.5, STEPS)
    trajectory, scene = load(arrays)
    figure = draw_chart(joint_charts(trajectory, scene)[0])
    axes = panel(figure.axes, "fr_knee [rad]")
    (dashed,) = [line for line in axes.lines if line.get_color() == COMMAND]
    assert dashed.get_linestyle() == "--"
    assert np.allclose(dashed.get_ydata()[:-1], arrays["joint_command"][:, KNEE, 0])
    shades = sorted(patch.get_y() for patch in axes.patches if to_hex(patch.get_facecolor()) == BEYOND)
    low, high = axes.get_ylim()
    assert shades == pytest.approx([low, 2.0])
    assert low < -1 < 2 < high


def test_a_record_without_commands_has_no_targets(load: Load) -> None:
    arrays = motion()
    del arrays["joint_command"]
    assert [channel.target for channel in channels(*load(arrays))] == [None] * 8
    lines = [line for chart in joint_charts(*load(arrays)) for panel in chart.panels if panel for line in panel.lines]
    assert lines and not any(line.has("dashed") for line in lines)
    driven = {**SCENE, "joints": [{**j, "motor": {"kind": "torque", "torque": 3}} for j in SCENE["joints"]]}
    assert [channel.target for channel in channels(*load(motion(), driven))] == [None] * 8


def test_joints_stand_in_the_column_of_their_leg(load: Load) -> None:
    trajectory, scene = load(motion())
    grid = make_grid(channels(trajectory, scene), trajectory, scene)
    assert [[channel and channel.name for channel in row] for row in grid] == [
        ["fl_hip", "fr_hip", "hl_hip", "hr_hip"],
        ["fl_knee", "fr_knee", "hl_knee", "hr_knee"],
    ]


def test_few_joints_have_a_row_each_with_the_torque_beside_it(load: Load) -> None:
    arm = {
        **SCENE,
        "joints": [hinge("pivot", "torso", None, ([0, 0, 0], [0, 0, 0.65]), motor=None), SCENE["joints"][0]],
    }
    arrays = {**motion(), "joint_names": np.array(["pivot", "fl_hip"])}
    keys = [key for key in arrays if key.startswith("joint_") and key != "joint_names"]
    (chart,) = joint_charts(*load({**arrays, **{key: arrays[key][:, :2] for key in keys}}, arm))
    titles = [axes.get_title(loc="left") for axes in draw_chart(chart).axes]
    assert titles == ["pivot: angle [rad]", "", "fl_hip: angle [rad]", "fl_hip: torque [N m]"]


def test_of_many_coordinates_those_that_move_most_are_drawn(load: Load) -> None:
    channel = channels(*load(motion()))[0]
    many = [type(channel)(**{**vars(channel), "name": str(k), "value": np.array([0.0, k])}) for k in range(40)]
    assert [each.name for each in shown(many)] == [str(k) for k in range(16, 40)]
    assert shown(many[:5]) == many[:5]


def test_separation_names_the_worst(load: Load) -> None:
    arrays = motion()
    arrays["joint_separation"][10, KNEE] = 0.041
    trajectory, _ = load(arrays)
    found = separation(trajectory)
    assert found is not None
    assert found.rms == pytest.approx(0.041 / np.sqrt(41 * 8))
    assert separation_sentence(trajectory) == (
        "Joints come apart by 0.0023 m (root mean square) and 0.041 m at most (fr_knee at t = 0.5 s)."
    )


def test_limits_that_are_reached_are_named(load: Load) -> None:
    arrays = motion()
    arrays["joint_value"] = arrays["joint_value"].copy()
    assert limits_sentence(channels(*load(arrays))) == ""
    arrays["joint_value"][7, [0, KNEE], 0] = [-1.0, 1.9995]
    arrays["joint_value"][8, 1, 0] = 1.99
    assert limits_sentence(channels(*load(arrays))) == "fl_hip and fr_knee come to a limit."


def test_an_axis_shows_limits_that_are_near_and_no_noise_at_large() -> None:
    low, high = axis_range(np.array([-1e-6, 1e-6]), [-np.inf, 0.6], 0.1)
    assert low < -0.05
    assert 0.6 < high < 0.8
    assert axis_range(np.array([0.0, 1.0]), [100.0], 0.1)[1] < 1.2


@pytest.mark.slow
def test_the_page_has_joints_gait_and_strip(run_dir: Path) -> None:
    arrays = worked()
    arrays["contact_force"][:10, 1, 2] = 50.0
    write_walker(run_dir, arrays)
    np.savez(run_dir / "guess.npz", **arrays)
    text = write_run_report(run_dir).read_text(encoding="utf-8")
    words = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text))
    assert {"joints", "motors", "gait"} <= set(re.findall(r'data-name="(\w+)"', text))
    drawn = {path.name for path in write_run_figures(run_dir, run_dir / "figures")}
    assert {"strip.svg", "joints.svg", "motors.svg", "gait.svg"} <= drawn
    assert "1 of 8 motors is saturated" in words
    assert "fr_knee hinge 0 to 0 rad −1 to 2 servo, 30 N m, 8 rad/s 30 N m ! 30 %" in words  # noqa: RUF001
    assert 'href="#joints"' in text
    assert 'href="#gait"' in text


@pytest.mark.slow
def test_a_page_without_joints_has_none_of_it(run_dir: Path, edit: Callable[..., None]) -> None:
    def body(page: Path) -> bytes:
        return page.read_bytes().partition(b"<body>")[2]

    first = body(write_run_report(run_dir))
    assert not {"strip.svg", "joints.svg", "motors.svg", "gait.svg"} & {
        path.name for path in write_run_figures(run_dir, run_dir / "figures")
    }
    assert b'id="joints"' not in first
    assert b'id="gait"' not in first
    content = json.loads((run_dir / "scene.json").read_text())
    bodies = [{**body, "mass": 1.0} for body in content["bodies"]]
    edit(run_dir / "scene.json", joints=[], gravity=[0, 0, -9.81], bodies=bodies)
    assert body(write_run_report(run_dir)) == first


@pytest.mark.parametrize(
    "broken",
    [
        {"name": ""},
        {"first": None},
        {"sockets": []},
        {"sockets": [{"point": [0, 0, "nan"], "orientation": [1, 0, 0, 0]}] * 2},
        {"sockets": [{"point": [0, 0, 0], "orientation": [0, 0, 0, 0]}] * 2},
    ],
)
def test_joints_that_cannot_be_read_are_left_out(load: Load, broken: dict[str, Any]) -> None:
    joints = [{**SCENE["joints"][0], **broken}, 3, SCENE["joints"][1]]
    assert [joint.name for joint in load(motion(), {**SCENE, "joints": joints})[1].joints] == ["fl_knee"]


@pytest.mark.slow
@first("scene", [{"joints": SCENE["joints"][:1]}, {}, {"joints": None}, {**SCENE, "bodies": []}])
def test_any_scene_of_a_motion_with_joints_can_be_drawn(tmp_path: Path, scene: dict[str, Any]) -> None:
    folder = write_walker(tmp_path, worked(), scene)
    page = write_motion(folder / "trajectory.npz", folder / "scene.json", folder / "motion.html")
    assert 'id="joints"' in page.read_text(encoding="utf-8")
