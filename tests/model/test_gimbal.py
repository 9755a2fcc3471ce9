"""Gimbal lock: chains of joints between two bodies, with frames without mass, that can come to have no inertia."""

from __future__ import annotations

import numpy as np
import pytest
from tools.repeats import few

from symphys.errors import ProblemError
from symphys.model.gimbal import Screw, locks
from symphys.problem import problem_of_tables

X, Y, Z = np.eye(3)
HERE = np.zeros(3)


def hinge(axis: object, at: object = HERE, limit: float = np.inf, carried: bool = False) -> Screw:
    return Screw(np.array(axis, float), np.array(at, float), -limit, limit, carried)


def slide(axis: object) -> Screw:
    return Screw(np.array(axis, float), None)


LOCKING = {
    "three hinges": [hinge(Z), hinge(Y), hinge(X)],
    "another order": [hinge(X), hinge(Z), hinge(Y)],
    "axes that are not square": [hinge(Z), hinge([0, 0.6, 0.8]), hinge(X)],
    "three slides and three hinges": [slide(X), slide(Y), slide(Z), hinge(Z), hinge(Y), hinge(X)],
    "two hinges along one line": [hinge(X), hinge(X)],
    "two slides along one line": [slide(X), slide(X), hinge(Y)],
    "three hinges in a plane, stretched": [hinge(Y), hinge(Y, Z), hinge(Y, 2 * Z)],
    "an armature on the middle hinge alone": [hinge(Z), hinge(Y, carried=True), hinge(X)],
}
FREE = {
    "two hinges": [hinge(X), hinge(Y)],
    "two parallel hinges apart": [hinge(X), hinge(X, Z)],
    "a planar root": [slide(X), slide(Z), hinge(Y)],
    "slides that are not square": [slide(X), slide([0.6, 0, 0.8]), slide(Y), hinge(Y)],
    "an armature on the first hinge": [hinge(Z, carried=True), hinge(Y), hinge(X)],
    "a limit of the middle hinge": [hinge(Z), hinge(Y, limit=1.2), hinge(X)],
}


@pytest.mark.parametrize("name", LOCKING)
def test_a_chain_that_can_lock_is_found(name: str) -> None:
    assert locks(LOCKING[name])


@pytest.mark.parametrize("name", FREE)
def test_a_chain_that_cannot_is_not(name: str) -> None:
    assert not locks(FREE[name])


@pytest.mark.parametrize(("low", "high", "locking"), [(-1.2, 0.0, True), (0.0, 1.2, False)])
def test_the_middle_hinge_locks_where_the_outer_axes_meet(low: float, high: float, locking: bool) -> None:
    """Turned about y by -60 degrees, an axis 30 degrees above x is the first one, z."""
    outer = hinge([np.sqrt(0.75), 0, 0.5])
    assert locks([hinge(Z), Screw(Y, HERE, low, high), outer]) == locking


@few(("wheel", "locking"), [(X, True), (Z, False), (Y, False), ([0.6, 0.8, 0], False)], 2)
def test_a_frame_that_holds_three_joints_locks_where_nothing_beyond_it_answers(wheel: object, locking: bool) -> None:
    """A flywheel on the inner ring answers turns of it about all but one axis, which must be the one that locks."""
    screws = [hinge(Z), hinge(Y), hinge(X), hinge(wheel)]
    assert locks(screws, [[0, 1, 2], [0, 1, 3]]) == locking


def gimbal(**pitch: object) -> dict[str, object]:
    """An arm on three hinges with two frames; keys of the middle one."""
    frames = [{"name": name, "mass": 0, "position": [0, 0, 1]} for name in ("ring_a", "ring_b")]
    arm = {"name": "arm", "mass": 1.0, "inertia": [0.02, 0.03, 0.025], "position": [0, 0, 1]}
    sides = ("world", "ring_a", "ring_b", "arm")
    axes = {"yaw": [0, 0, 1], "pitch": [0, 1, 0], "roll": [1, 0, 0]}
    joints = [
        {"name": name, "between": [*sides[k : k + 2]], "hinge": {"axis": axis}, "point": [0, 0, 1]}
        for k, (name, axis) in enumerate(axes.items())
    ]
    joints[1] |= pitch
    return {
        "simulation": {"duration": 0.1, "dt": 0.01},
        "body": [*frames, arm],
        "joint": joints,
        "variable": [{"name": "twist", "sets": "arm.torque[1]"}],
        "cost": [{"name": "turns", "value": "norm(arm.angular_velocity)"}],
    }


def test_a_file_whose_frames_can_lock_is_refused_with_the_cures() -> None:
    with pytest.raises(ProblemError, match=r"gimbal lock.*limits"):
        problem_of_tables(gimbal())
    problem_of_tables(gimbal(limits=[-1.3, 1.3]))


@pytest.mark.parametrize("wheel", [[1, 0, 0], [0, 1, 0]])
def test_a_flywheel_on_the_inner_ring(wheel: list[float]) -> None:
    tables = gimbal()
    tables["body"] += [{"name": "wheel", "mass": 0.5, "inertia": [0.01, 0.01, 0.01], "position": [0, 0, 1]}]  # type: ignore[operator]
    hub = {"name": "hub", "between": ["ring_b", "wheel"], "hinge": {"axis": wheel}, "point": [0, 0, 1]}
    tables["joint"] += [hub]  # type: ignore[operator]
    if wheel == [0, 1, 0]:
        problem_of_tables(tables)
        return
    with pytest.raises(ProblemError, match="gimbal lock"):
        problem_of_tables(tables)


@pytest.mark.parametrize("turned", [False, True])
def test_a_universal_joint_is_two_of_the_axes(turned: bool) -> None:
    """With a hinge in line with its first or second axis it locks; about the one that a hinge would be it does not."""
    tables = gimbal()
    yaw, _, roll = tables["joint"]  # type: ignore[misc]
    tables["body"] = tables["body"][1:]  # type: ignore[index]
    both = {"name": "cardan", "universal": {"axes": [[0, 1, 0], [1, 0, 0]]}, "point": [0, 0, 1]}
    joints = [{**yaw, "between": ["world", "ring_b"]}, {**both, "between": ["ring_b", "arm"]}]
    if turned:
        both["universal"] = {"axes": [[0, 0, 1], [0, 1, 0]]}
        joints = [{**both, "between": ["world", "ring_b"]}, {**roll, "between": ["ring_b", "arm"]}]
    tables["joint"] = joints
    with pytest.raises(ProblemError, match=r"gimbal lock"):
        problem_of_tables(tables)
    joints[0 if turned else 1]["limits"] = [-1.3, 1.3]
    problem_of_tables(tables)


def test_an_armature_at_either_end_is_a_cure() -> None:
    tables = gimbal()
    tables["joint"][2]["armature"] = 0.002  # type: ignore[index]
    problem_of_tables(tables)
