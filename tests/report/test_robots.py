"""Kinematic branches, joint positions, poses over time and gaits are those of the recorded motion."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from data.walker import DT, LEGS, NAMES, SCENE, STEPS, TURNED, hinge, motion
from tools.page_scripts import NODE, plays_to_the_end, run_script
from tools.repeats import few

from symphys.report.charts import palette
from symphys.report.figures import style
from symphys.report.figures.drawing import draw_chart
from symphys.report.pages.motion import steps_sentence
from symphys.report.robots.branches import branches, colours, keys, traced
from symphys.report.robots.gait import gait_chart, spans, stances, weight
from symphys.report.robots.joint_positions import axes_of, bones, on_side, position
from symphys.report.robots.poses import extents, spaced
from symphys.report.robots.strip import draw_strip, make_strip
from symphys.report.scene.animation import NUMBERS, motion_data
from symphys.report.scene.motion import draw_motion
from symphys.report.scene.views import SIDE_XZ, TOP
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory

Load = Callable[..., tuple[Trajectory, Scene]]


def trotting() -> dict[str, Any]:
    """Front left and hind right carry for steps 0 to 9 and 20 to 29; front right hardly; a shin lies for 5 steps."""
    arrays = motion()
    force = arrays["contact_force"]
    for start in (0, 20):
        force[start : start + 10, [1, 7], 2] = 50.0
    force[:, 3, 2] = 1.9
    force[10:15, 4, 2], force[10:15, 5, 0] = 1.5, 1.5
    return arrays


def test_runs_of_a_mask() -> None:
    assert spans(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert spans(np.array([False, False])) == []


def test_a_body_stands_while_it_carries_a_share_of_the_weight(load: Load) -> None:
    """All its points together: 1.5 N up and 1.5 N along are more than 2 N, a fiftieth of 100 N; 1.9 N are not."""
    trajectory, scene = load(trotting())
    assert weight(trajectory, scene) == pytest.approx(100)
    found = {NAMES[stance.body]: stance for stance in stances(trajectory, scene)}
    assert list(found) == ["fl_shin", "hl_shin", "hr_shin"]
    assert spans(found["fl_shin"].stands) == [(0, 10), (20, 30)]
    assert [found[name].duty for name in found] == [0.5, 0.125, 0.5]
    assert steps_sentence(trajectory, scene) == (
        "2 bodies at most stand at once, 1.1 on average; for 38 % of the time none does."
    )


def test_bars_of_the_gait(load: Load) -> None:
    trajectory, scene = load(trotting())
    chart = gait_chart(trajectory, scene)
    assert chart is not None
    figure = draw_chart(chart)
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["fl_shin", "hl_shin", "hr_shin"]
    bars = [[np.array(path.vertices) for path in row.get_paths()] for row in axes.collections]
    spread = [[(b[:, 0].min(), b[:, 0].max()) for b in row] for row in bars]
    assert np.allclose(spread[0], [(0, 10 * DT), (20 * DT, 30 * DT)])
    assert np.allclose(spread[1], [(10 * DT, 15 * DT)])
    assert [text.get_text() for text in axes.texts] == ["50 %", "12 %", "50 %"]


def test_no_gait_where_none_is(load: Load) -> None:
    standing = motion()
    standing["contact_force"][:, 1::2, 2] = 25.0
    assert gait_chart(*load(standing)) is None
    assert gait_chart(*load(motion())) is None
    assert gait_chart(*load(trotting(), {**SCENE, "joints": []})) is None
    assert gait_chart(*load(trotting(), {key: part for key, part in SCENE.items() if key != "gravity"})) is None
    light = [{key: part for key, part in body.items() if key != "mass"} for body in SCENE["bodies"]]
    assert gait_chart(*load(trotting(), {**SCENE, "bodies": light})) is None


def test_branches_are_what_joints_connect_to_the_base(load: Load) -> None:
    trajectory, scene = load(motion())
    assert [branch.name for branch in branches(trajectory, scene)] == ["torso", *LEGS]
    assert [branch.bodies for branch in branches(trajectory, scene)] == [(0,), (1, 2), (3, 4), (5, 6), (7, 8)]
    of_body = colours(trajectory, scene)
    assert of_body[1] == of_body[2] != of_body[3]
    assert [name for name, _ in keys(trajectory, scene)] == ["torso", *LEGS]
    assert traced(trajectory, scene) == ("torso", "fl_shin", "fr_shin", "hl_shin", "hr_shin")


def test_few_bodies_keep_their_own_colours(load: Load) -> None:
    trajectory, scene = load(motion(), {**SCENE, "joints": SCENE["joints"][:2]})
    assert colours(trajectory, scene) == tuple(palette.BODIES[k % 7] for k in range(9))
    assert traced(trajectory, scene) == tuple(NAMES)


def test_the_body_that_the_world_holds_is_the_trunk(load: Load) -> None:
    held = hinge("base", "hr_shin", None, ([0, 0, -0.15], [-0.3, -0.2, 0.05]))
    trajectory, scene = load(motion(), {**SCENE, "joints": [*SCENE["joints"], held]})
    assert [branch.name for branch in branches(trajectory, scene) if branch.is_base] == ["hr_shin"]


def turned_leg() -> dict[str, Any]:
    """The first thigh lies: turned by 90 degrees about y, about its hip."""
    arrays = motion()
    arrays["orientation"][:, 1] = [np.sqrt(0.5), 0, np.sqrt(0.5), 0]
    arrays["position"][:, 1] = [0.15, 0.2, 0.65]
    return arrays


def test_pivots_and_axes_go_with_the_bodies(load: Load) -> None:
    trajectory, scene = load(turned_leg())
    hip, knee = scene.joints[:2]
    assert np.allclose(position(trajectory, hip, 0), [0.3, 0.2, 0.65])
    assert np.allclose(on_side(trajectory, knee, 1, knee.frames[1].point, 0, True), [0, 0.2, 0.65])
    (side, axis), *more = axes_of(hip)
    assert more == []
    assert np.allclose(on_side(trajectory, hip, side, axis, 0, False), [0, 1, 0])
    lines = [line for body, line in bones(trajectory, scene, 0) if body == 1]
    assert np.allclose(lines, [[[0.15, 0.2, 0.65], [0.3, 0.2, 0.65]], [[0.15, 0.2, 0.65], [0, 0.2, 0.65]]])
    _, (start, foot) = [line for body, line in bones(trajectory, scene, 0) if body == 2]
    assert np.allclose([start, foot], [[0.3, 0.2, 0.2], [0.3, 0.2, 0.05]])


def test_a_universal_joint_has_two_axes_and_the_world_stands_still(load: Load) -> None:
    joint = hinge("base", "torso", None, ([0, 0, 0], [1, 2, 3]), kind="universal")
    trajectory, scene = load(turned_leg(), {**SCENE, "joints": [joint]})
    (base,) = scene.joints
    assert np.allclose(on_side(trajectory, base, 1, base.frames[1].point, 0, True), [1, 2, 3])
    found = [on_side(trajectory, base, side, axis, 0, False) for side, axis in axes_of(base)]
    assert np.allclose(found, [[-1, 0, 0], [0, 1, 0]])
    assert base.frames[0].orientation.tolist() == TURNED


def test_poses_of_a_whole_robot_hardly_cover_each_other(load: Load) -> None:
    trajectory, scene = load(motion(speed=3.0))
    shots = spaced(trajectory, scene, SIDE_XZ)
    places = trajectory.position[shots, 0, 0]
    low, high = extents(trajectory, scene, SIDE_XZ, range(9))
    assert (np.diff(places) > 0.7 * (high - low)[0, 0]).all()
    assert len(shots) == 9
    assert (shots[0], shots[-1]) == (0, STEPS)
    assert spaced(*load(motion()), SIDE_XZ) == [STEPS]


def test_extents_are_those_of_the_surfaces(load: Load) -> None:
    low, high = extents(*load(motion()), SIDE_XZ, range(9))
    assert np.allclose(low[0], [-0.35, 0])
    assert np.allclose(high[0], [0.35, 0.75])


@pytest.mark.parametrize("speed", [0.0, 5.0])
def test_a_strip_goes_with_the_robot_and_shows_all_of_it(load: Load, speed: float) -> None:
    trajectory, scene = load(motion(speed))
    for view in (SIDE_XZ, TOP):
        shots = [0, 13, 27, 40]
        strip = make_strip(view, trajectory, scene, shots)
        low, high = extents(trajectory, scene, view, range(9))
        assert (strip.low <= low[shots]).all()
        assert (strip.low + strip.size >= high[shots]).all()
        assert np.ptp(strip.low[:, 1]) == 0
        assert np.ptp(strip.low[:, 0]) == pytest.approx(10 if speed else 0)
        assert strip.size[0] < 1


def test_a_strip_does_not_go_up_or_down_since_only_its_first_picture_has_numbers_there(load: Load) -> None:
    arrays = motion()
    arrays["position"][..., 2] -= 5 * arrays["time"][:, None] ** 2
    strip = make_strip(SIDE_XZ, *load(arrays), [0, 20, 40])
    assert np.ptp(strip.low[:, 1]) == 0
    assert strip.size[1] > 20


@pytest.mark.slow
def test_numbers_below_a_strip_do_not_meet(load: Load) -> None:
    with style.paper():
        figure = draw_strip(*load(motion(speed=5.0)))
        assert figure is not None
        figure.draw_without_rendering()
        labels = [label for axes in figure.axes for label in axes.get_xticklabels() if label.get_visible()]
        boxes = [label.get_window_extent() for label in labels if label.get_text()]
    assert len(boxes) > 4
    assert not [1 for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]


def test_a_robot_is_drawn_with_its_branches_in_the_legend(load: Load) -> None:
    figure = draw_motion(*load(motion(speed=3.0)))
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["torso", *LEGS]


def data_of(load: Load, arrays: dict[str, Any], scene: dict[str, Any] = SCENE) -> dict[str, Any]:
    return json.loads(json.dumps(motion_data(*load(arrays, scene), None, NUMBERS)))


@pytest.mark.slow
def test_the_camera_goes_along_only_with_what_travels_far(load: Load) -> None:
    assert data_of(load, motion())["follow"] is None
    assert data_of(load, motion(speed=1.0))["follow"] is None
    follow = data_of(load, motion(speed=5.0))["follow"]
    assert follow["bodies"] == list(range(9))
    assert 0.5 < follow["radius"] < 1.2
    assert [body["path"] for body in data_of(load, motion())["bodies"]] == [True, *[False, True] * 4]


@NODE
@few("speed", [0.0, 5.0], 1)
def test_script_plays_a_robot_to_the_end(load: Load, speed: float) -> None:
    plays_to_the_end(data_of(load, motion(speed)))


@pytest.mark.slow
@NODE
def test_script_and_figures_have_the_same_pivots(load: Load) -> None:
    trajectory, scene = load(turned_leg())
    data = data_of(load, turned_leg())
    places, turns = trajectory.position[0].tolist(), trajectory.orientation[0].tolist()
    poses = [{"p": p, "q": q} for p, q in zip(places, turns, strict=True)]
    for joint, told in zip(scene.joints, data["joints"], strict=True):
        side = json.dumps(told["sides"][0])
        found = run_script(f"carried({side}, {told['sides'][0]['point']}, {json.dumps(poses)}, true)", "joints.js")
        assert np.allclose(found, position(trajectory, joint, 0), atol=1e-5)
    assert run_script("carried({ body: -1 }, [1, 2, 3], [], true)", "joints.js") == [1, 2, 3]
