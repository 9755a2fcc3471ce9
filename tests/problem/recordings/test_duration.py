"""Without a duration the simulation goes up to the last recorded sample."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.recorded import HEIGHT, TABLE

import symphys
from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem, problem_of_tables

BALL = {"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "position": [0, 0, 1]}


def loaded(*recordings: dict[str, Any], **simulation: float) -> Problem:
    named = [{"name": f"drop{k}", "measured": [HEIGHT], **each} for k, each in enumerate(recordings)]
    return problem_of_tables({"simulation": {"dt": 0.01, **simulation}, "body": [BALL], "recording": named})


@pytest.mark.parametrize(
    ("last", "expected"), [(0.2, 0.2), (0.301, 0.31), (0.3, 0.3), (0.1 + 0.2, 0.3), (0.1000001, 0.11)]
)
def test_it_is_whole_steps_up_to_the_last_sample(last: float, expected: float) -> None:
    long = {"time": [0.0, 0.05, last], "z": [1.0, 1.0, 0.9]}
    problem = loaded({"table": {"time": [0.0, 0.01], "z": [1.0, 1.0]}}, {"table": long})
    assert problem.simulation.duration == pytest.approx(expected)
    assert problem.recordings[1].time[-1] == pytest.approx(last)


def test_one_that_is_stated_holds() -> None:
    assert loaded({"table": TABLE}, duration=0.7).simulation.duration == 0.7


def test_until_offset_clock_and_files_count(tmp_path: Path) -> None:
    late = {"time": [5.0, 5.1, 5.2, 5.4], "z": [1.0, 1.0, 1.0, 1.0]}
    assert loaded({"table": late, "clock": "first row"}).simulation.duration == pytest.approx(0.4)
    assert loaded({"table": late, "offset": -4.9, "until": 0.35}).simulation.duration == pytest.approx(0.3)
    (tmp_path / "drop.csv").write_text("time,z\n0,1\n100,1\n230,0.9\n")
    (tmp_path / "drop.toml").write_text(
        '[simulation]\ndt = 0.01\n[[body]]\nname = "ball"\nshape = { sphere = { radius = 0.1 } }\nmass = 1.0\n'
        'position = [0, 0, 1]\n[[recording]]\nname = "drop"\nfiles = "drop.csv"\ntime_factor = 0.001\n'
        'measured = [{ value = "ball.position[2]", columns = "z" }]\n'
    )
    problem = load_problem(tmp_path / "drop.toml")
    assert problem.simulation.duration == pytest.approx(0.23)
    (tmp_path / "drop.csv").unlink()
    (tmp_path / "again.toml").write_text(problem.text)
    assert load_problem(tmp_path / "again.toml").simulation.duration == pytest.approx(0.23), "kept in the text"


def test_without_recordings_it_is_missing() -> None:
    with pytest.raises(ProblemError, match=r"simulation.duration: .*required"):
        problem_of_tables({"simulation": {"dt": 0.01}, "body": [BALL]})


def test_times_that_no_simulation_takes_are_refused_with_what_may_be_wrong() -> None:
    epoch = {"time": [1.7e9, 1.7e9 + 0.1], "z": [1.0, 1.0]}
    with pytest.raises(ProblemError, match=r"recording.* 1.7e\+09 s, 1.7e\+11 steps"):
        loaded({"table": epoch})
    with pytest.raises(ProblemError, match='"time"'):
        loaded({"table": {"t": [0.0, 0.1], "z": [1.0, 1.0]}})


@pytest.mark.slow
def test_it_can_be_identified() -> None:
    time = np.arange(0, 0.3, 0.01)
    table = {"time": time.tolist(), "z": (1 - 9.81 / 2 * time**2 + 0.2 * time).tolist()}
    recording = {"name": "drop", "table": table, "measured": [{**HEIGHT, "noise": 0.001}]}
    throw = {"name": "throw", "sets": "ball.velocity[2]"}
    tables = {"simulation": {"dt": 0.01}, "body": [BALL], "recording": [recording], "variable": [throw]}
    assert symphys.identify(tables, threads=1)["throw"].value == pytest.approx(0.2, abs=1e-3)
