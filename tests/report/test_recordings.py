"""Trajectories on disk are read with the shapes of their fields; older files without some arrays are read too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symphys.results.text_files import ReportError
from symphys.results.trajectories import read_trajectory

BODIES = {"time": np.linspace(0, 0.3, 4), "body_names": np.array(["arm"]), "position": np.zeros((4, 1, 3))}
VALUE = np.arange(16.0).reshape(4, 2, 2)
JOINTS = {
    "joint_names": np.array(["hip", "knee"]),
    "joint_value": VALUE,
    "joint_rate": -VALUE,
    "joint_torque": VALUE[1:],
    "joint_command": 2 * VALUE[1:],
    "joint_separation": np.full((4, 2), 1e-6),
}


def test_joints_are_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "trajectory.npz", **BODIES, **JOINTS)
    motion = read_trajectory(tmp_path / "trajectory.npz")
    assert motion.joint_names == ("hip", "knee")
    assert np.array_equal(motion.joint_value, VALUE)
    assert np.array_equal(motion.joint_rate, -VALUE)
    assert np.array_equal(motion.joint_torque, VALUE[1:])
    assert np.array_equal(motion.joint_command, 2 * VALUE[1:])
    assert motion.joint_separation.shape == (4, 2)


def test_commands_that_are_not_recorded_are_not_known(tmp_path: Path) -> None:
    np.savez(
        tmp_path / "trajectory.npz", **BODIES, **{key: part for key, part in JOINTS.items() if key != "joint_command"}
    )
    assert np.isnan(read_trajectory(tmp_path / "trajectory.npz").joint_command).all()


def test_records_without_joints_are_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "trajectory.npz", **BODIES)
    motion = read_trajectory(tmp_path / "trajectory.npz")
    assert motion.joint_names == ()
    assert (motion.joint_value.shape, motion.joint_torque.shape) == ((4, 0, 0), (3, 0, 0))


def test_what_is_not_finite_is_cut_off(tmp_path: Path) -> None:
    position = BODIES["position"].copy()
    position[2] = np.nan
    np.savez(tmp_path / "trajectory.npz", **{**BODIES, "position": position}, **JOINTS)
    motion = read_trajectory(tmp_path / "trajectory.npz")
    assert np.array_equal(motion.joint_value, VALUE[:2])
    assert np.array_equal(motion.joint_torque, VALUE[1:2])
    assert np.array_equal(motion.joint_command, 2 * VALUE[1:2])


def test_joints_that_do_not_fit_are_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "trajectory.npz", **BODIES, **{**JOINTS, "joint_rate": VALUE[:3]})
    with pytest.raises(ReportError, match="joint_rate has shape"):
        read_trajectory(tmp_path / "trajectory.npz")
