"""Trajectories on disk are read with the shapes of their fields; older files without some arrays are read too."""

from __future__ import annotations

import io
import zipfile
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
    with pytest.raises(ReportError, match="joint_rate"):
        read_trajectory(tmp_path / "trajectory.npz")


def declaring(path: Path, **arrays: tuple[tuple[int, ...], str]) -> None:
    """An archive of the bodies and of arrays that have a header, with a shape and a type, and no numbers."""
    np.savez_compressed(path, **BODIES)
    with zipfile.ZipFile(path, "a") as archive:
        for name, (shape, kind) in arrays.items():
            head = io.BytesIO()
            np.lib.format.write_array_header_1_0(head, {"shape": shape, "fortran_order": False, "descr": kind})
            archive.writestr(f"{name}.npy", head.getvalue())


@pytest.mark.parametrize(
    ("shape", "kind", "size"),
    [
        ((4, 2**26, 3), "<f8", "6 GiB"),
        ((2**29,), "|b1", "4 GiB"),
        ((2**28,), "<U0", "25 GiB"),
        ((10**12, 10**12), "<f8", "GiB"),
    ],
)
def test_what_takes_too_much_memory_is_refused_before_it_is_unpacked(
    tmp_path: Path, shape: tuple[int, ...], kind: str, size: str
) -> None:
    declaring(tmp_path / "trajectory.npz", velocity=(shape, kind))
    with pytest.raises(ReportError, match=rf"trajectory.npz: velocity .*{size}.* 1 GiB"):
        read_trajectory(tmp_path / "trajectory.npz")


def test_what_takes_too_much_together_is_refused(tmp_path: Path) -> None:
    torque = (3, 14 * 2**20, 3), "|i1"
    declaring(tmp_path / "guess.npz", velocity=((4, 2**23, 2), "<f8"), torque=torque)
    with pytest.raises(ReportError, match=r"torque .*0.984 GiB.* 1.48 GiB"):
        read_trajectory(tmp_path / "guess.npz")


def test_quantities_that_are_absent_are_not_made_up_beyond_memory(tmp_path: Path) -> None:
    names = np.array(["c"] * 10_000)
    many = {"time": np.zeros(10_000), "position": np.zeros((10_000, 1, 3)), "contact_names": names}
    np.savez_compressed(tmp_path / "guess.npz", **many)
    with pytest.raises(ReportError, match=r"10000 times.* 10000 contacts"):
        read_trajectory(tmp_path / "guess.npz")
