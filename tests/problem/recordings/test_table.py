"""[[recording]]: which numbers become which motions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.recorded import HEIGHT, TABLE, beside, loaded

from symphys.problem.recordings import Recording

POSITION = {"value": "ball.position", "columns": ["x", "y", "z"]}
TURN = {"value": "ball.orientation", "columns": "q"}
QUARTER = [float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5))]
"""A quarter of a turn about z, w x y z."""


def arrays(folder: Path, name: str = "a.npz", **columns: Any) -> None:
    """An NPZ file."""
    np.savez(folder / name, **{key: np.asarray(value) for key, value in columns.items()})


def values(recording: Recording, which: int = 0) -> list[list[float]]:
    """The samples of one quantity."""
    return recording.measured[which].values.tolist()


def test_a_table_in_the_file() -> None:
    (found,) = loaded(
        {"table": {**TABLE, "z": [1.0, float("nan"), 0.8]}, "measured": [{**HEIGHT, "noise": 0.01}]}
    ).recordings
    (height,) = found.measured
    assert (found.name, found.time.tolist(), found.held_back, found.weight) == ("drop", [0, 0.1, 0.2], False, 1)
    assert (height.name, height.columns, height.missing, height.orientation) == ("ball.position[2]", ("z",), 1, False)
    np.testing.assert_array_equal(height.values, [[1.0], [np.nan], [0.8]])
    assert height.noise is not None and height.noise.tolist() == [0.01]
    assert height.value.evaluate({"ball.position": [1, 2, 3]}) == 3


def test_units_are_converted() -> None:
    given = {"table": {"time": [0, 100, 200], "z": [1000.0, 950.0, 800.0]}, "time_factor": 0.001}
    (found,) = loaded({**given, "measured": [{**HEIGHT, "unit": "mm", "offset": 0.1}]}).recordings
    np.testing.assert_allclose(found.measured[0].values.ravel(), [1.1, 1.05, 0.9], rtol=1e-15)
    np.testing.assert_allclose(found.time, [0, 0.1, 0.2], rtol=1e-15)
    (same,) = loaded({**given, "measured": [{**HEIGHT, "factor": 0.001, "offset": 0.1}]}).recordings
    np.testing.assert_array_equal(same.measured[0].values, found.measured[0].values)


def test_a_frame_moves_points_and_turns_vectors(tmp_path: Path) -> None:
    """As the rotation matrix does it: x of the camera is y of the world, and its origin is at (1, 2, 3)."""
    arrays(tmp_path, time=[0, 0.1], p=[[1, 0, 0], [0, 1, 0.5]], v=[[0, 2, 0]] * 2, q=[[1, 0, 0, 0], QUARTER])
    measured = [
        {"value": "ball.position", "columns": "p"},
        {"value": "ball.velocity", "columns": "v"},
        TURN,
    ]
    (found,) = beside(
        tmp_path,
        {"files": "a.npz", "measured": measured, "frame": {"position": [1, 2, 3], "orientation": {"yaw_deg": 90.0}}},
    ).recordings
    np.testing.assert_allclose(found.measured[0].values, [[1, 3, 3], [0, 2, 3.5]], atol=1e-15)
    np.testing.assert_allclose(found.measured[1].values, [[-2, 0, 0]] * 2, atol=1e-15)
    np.testing.assert_allclose(found.measured[2].values, [QUARTER, [0, 0, 0, 1]], atol=1e-15)
    assert found.measured[2].orientation


def test_the_order_of_quaternions(tmp_path: Path) -> None:
    """Lengths that are a little off become 1, and a missing number makes the whole row missing."""
    arrays(tmp_path, time=[0, 0.1, 0.2], q=[[0.1, 0.2, 0.3, 0.9273618], [0.001, 0, 0, 1.003], [np.nan, 0, 0, 1]])
    turn = {**TURN, "quaternion": "xyzw", "noise": [0.1, 0.2, 0.3]}
    (found,) = beside(tmp_path, {"files": "a.npz", "measured": [turn]}).recordings
    numbers = found.measured[0].values
    np.testing.assert_allclose(numbers[0], [0.9273618, 0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(numbers[:2], axis=1), 1, rtol=1e-15)
    assert np.isnan(numbers[2]).all() and found.measured[0].missing == 1


@pytest.mark.parametrize("way", ["rows", "split", "files"])
def test_many_recordings(way: str, tmp_path: Path) -> None:
    """From one NPZ file with first rows, from a column that changes, and from a pattern of files: the same motions."""
    time, z, toss = [0, 0.1, 0.2, 5, 5.1, 0, 0.1, 0.2], np.arange(8) / 10, [7, 7, 7, 3, 3, 4, 4, 4]
    if way == "rows":
        arrays(tmp_path, time=time, z=z, start=[0, 3, 5, 8])
        found = beside(tmp_path, {"files": "a.npz", "rows": "start"}).recordings
        names = ["drop/0000", "drop/0001", "drop/0002"]
    elif way == "split":
        lines = [f"{a},{b},{c}" for a, b, c in zip(time, z, toss, strict=True)]
        (tmp_path / "all.csv").write_text("\n".join(["time,z,toss", *lines]))
        found = beside(tmp_path, {"files": "all.csv", "split": "toss"}).recordings
        names = ["drop/0000", "drop/0001", "drop/0002"]
    else:
        (tmp_path / "tosses").mkdir()
        for name, first, last in (("t2", 0, 3), ("t9", 3, 5), ("t10", 5, 8)):
            lines = [f"{a},{b}" for a, b in zip(time[first:last], z[first:last], strict=True)]
            (tmp_path / "tosses" / f"{name}.csv").write_text("\n".join(["time,z", *lines]))
        found = beside(tmp_path, {"files": "tosses/*.csv", "clock": "first row"}).recordings
        names = ["drop/t2", "drop/t9", "drop/t10"]
    assert [each.name for each in found] == names and {each.table for each in found} == {"drop"}
    for each, first, last in zip(found, (0, 3, 5), (3, 5, 8), strict=True):
        np.testing.assert_allclose(each.time, np.arange(last - first) * 0.1, atol=1e-12)
        assert each.measured[0].values.ravel().tolist() == z[first:last].tolist()
    assert (
        "rows 3 to 4" in found[1].source
        if way == "rows"
        else "t9.csv, rows 2 to 3" in found[1].source or way == "split"
    )


def test_times_from_a_rate_and_a_shifted_clock() -> None:
    """``until`` leaves out what comes later, with its samples."""
    (found,) = loaded({"table": {"z": [1.0, 0.9, 0.8, 0.7]}, "rate": 4.0, "offset": 0.1, "until": 0.7}).recordings
    np.testing.assert_allclose(found.time, [0.1, 0.35, 0.6], rtol=1e-15)
    assert values(found) == [[1.0], [0.9], [0.8]] and found.samples == 3


@pytest.mark.parametrize(
    ("held", "which"),
    [
        (True, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        (False, []),
        (0.3, [3, 6, 9]),
        (0.5, [1, 3, 5, 7, 9]),
        (1.0, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ([0, 4], [0, 4]),
        (["0002", "drop/0007"], [2, 7]),
    ],
)
def test_which_are_held_back(held: Any, which: list[int]) -> None:
    """A share is spread evenly over the recordings."""
    table = {"time": [0.0, 0.1] * 10, "z": [1.0, 0.9] * 10, "k": np.repeat(np.arange(10), 2).tolist()}
    found = loaded({"table": table, "split": "k", "held_back": held}).recordings
    assert [k for k, each in enumerate(found) if each.held_back] == which


def test_the_first_row_sets_the_start(tmp_path: Path) -> None:
    """In the units of the same columns, in the frame of the world; variables with a value for each may begin there."""
    arrays(tmp_path, time=[3.0, 3.1], p=[[100, 200, 1000], [0, 0, 900]], v=[[1, 0, 0], [2, 0, 0]])
    table = {
        "files": "a.npz",
        "measured": [{"value": "ball.position", "columns": "p", "unit": "mm"}],
        "start": {"ball.position": "p", "ball": {"velocity": {"columns": "v", "factor": 2.0}}},
        "frame": {"orientation": QUARTER},
    }
    own = {"name": "v", "sets": "ball.velocity[0]", "each": "recording"}
    problem = beside(tmp_path, table, variable=[own])
    (found,) = problem.recordings
    assert found.time.tolist() == pytest.approx([0, 0.1])
    assert set(found.start) == {"ball.position", "ball.velocity"}
    np.testing.assert_allclose(found.start["ball.position"], [-0.2, 0.1, 1], atol=1e-15)
    np.testing.assert_allclose(found.start["ball.velocity"], [0, 2, 0], atol=1e-15)
    assert problem.variables[0].each


def test_what_variables_may_set() -> None:
    """The clock and the scale of recordings; a prior has a mean and a standard deviation for each component."""
    variables = [
        {"name": "clock", "sets": "drop.offset", "each": "recording", "prior": [0, 0.01]},
        {"name": "scale", "sets": "drop.scale", "lower": 0.9},
        {"name": "v", "sets": "ball.velocity", "prior": [[1, 2, 3], 0.5]},
    ]
    clock, scale, v = loaded({"table": TABLE}, variable=variables).variables
    assert (clock.kind, clock.guess.tolist(), clock.each, clock.scale.tolist()) == ("recording", [0], True, [0.01])
    assert (scale.kind, scale.guess.tolist(), scale.each, scale.lower.tolist()) == ("recording", [1], False, [0.9])
    assert v.prior is not None and [part.tolist() for part in v.prior] == [[1, 2, 3], [0.5, 0.5, 0.5]]


def test_settings_of_identification() -> None:
    problem = loaded({"table": TABLE}, identify={"loss": "huber", "bootstrap": 100})
    assert (problem.identify.loss, problem.identify.threshold, problem.identify.bootstrap) == ("huber", 3.0, 100)
    assert problem.set("identify.threshold", 2.0).identify.threshold == 2
    assert loaded({"table": TABLE}).identify.loss == "squares"


def test_solvers_leave_clocks_and_scales_alone() -> None:
    """The motion does not depend on them."""
    from symphys.transcription import transcribe

    variables = [{"name": "v", "sets": "ball.velocity[0]"}, {"name": "clock", "sets": "drop.offset"}]
    target = {"name": "there", "value": "ball.position[0] - 1", "tolerance": 0.1}
    made = transcribe(loaded({"table": TABLE}, variable=variables, target=[target]), backend="casadi")
    slopes = made.shooting.evaluator.gradient(np.array([[0.5, 0.0]]), 0.0).gradient.ravel()
    assert slopes[0] != 0 and slopes[1] == 0
