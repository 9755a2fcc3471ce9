"""What is no recording: messages with file, row and column, and what would be valid; never another exception."""

from __future__ import annotations

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.recorded import BALL, HEIGHT, TABLE, beside, loaded
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from symphys.errors import ProblemError
from symphys.problem import Problem

NAN = float("nan")
BOTH = [{"value": "ball.position", "columns": ["x", "y", "z"]}]
MANY = {"time": [0.0, 0.1] * 2, "z": [1.0] * 4, "k": [0.0, 0, 1, 1]}


def message(*tables: dict[str, Any], **others: Any) -> str:
    """Why that problem is refused."""
    with pytest.raises(ProblemError) as found:
        loaded(*tables, **others)
    return str(found.value)


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({}, ".files: give either files"),
        ({"table": TABLE, "files": "a.csv"}, ".files: give either files"),
        ({"table": {"time": [0.0], "z": [1.0]}}, ".table: table, row 0 (from 0): a recording has 2 rows or more"),
        ({"table": {**TABLE, "z": [1.0]}}, "all columns need as many numbers; there are: time 3, z 1"),
        ({"table": {**TABLE, "z": []}}, ".table.z: must be a list of numbers"),
        (
            {"table": {**TABLE, "time": [0, 0.2, 0.1]}},
            '.time: table, row 2 (from 0), column "time": the time 0.1 s comes',
        ),
        ({"table": {**TABLE, "time": [0, 0.1, 0.1]}}, "the time 0.1 s occurs twice; delete the row"),
        ({"table": {**TABLE, "time": [0, NAN, 0.1]}}, 'row 1 (from 0), column "time": the time is missing'),
        ({"table": {**TABLE, "time": [-0.1, 0, 0.1]}}, "is before the start of the simulation; add offset = 0.1"),
        (
            {"table": {**TABLE, "time": [0, 0.1, 1.1]}},
            ".until: table, rows 0 to 2: samples go on to 1.1 s, and the simulation ends at 1 s; [simulation] needs",
        ),
        ({"table": {**TABLE, "time": [9, 9.1, 9.2]}}, ".clock: table, rows 0 to 2: samples go on to 9.2 s"),
        ({"table": {"t": [0, 0.1], "z": [1.0, 1.0]}}, 'has no column "time"; name it with time = "...", or give rate'),
        ({"table": TABLE, "time": "tme"}, '.time: table has no column "tme"; did you mean "time"'),
        ({"table": TABLE, "rate": 10.0, "time": "time"}, ".rate: stands instead of time"),
        ({"table": TABLE, "until": 0.05}, ".until: table, row 0 (from 0): only 1 samples"),
        ({"table": TABLE, "measured": []}, ".measured: must have 1 or more entries"),
        (
            {"table": TABLE, "measured": [{**HEIGHT, "columns": "zz"}]},
            '.columns: table has no column "zz"; did you mean "z"',
        ),
        ({"table": TABLE, "measured": [{"value": "ball.position", "columns": "z"}]}, "ball.position has 3 numbers"),
        ({"table": TABLE, "measured": [{"value": "ball.pos", "columns": "z"}]}, 'unknown name "ball.pos"'),
        (
            {"table": TABLE, "measured": [{**HEIGHT, "unit": "deg"}]},
            '.unit: ball.position[2] is in m; valid: "m", "cm"',
        ),
        ({"table": TABLE, "measured": [{**HEIGHT, "unit": "yard"}]}, '.unit: must be one of "m"'),
        ({"table": TABLE, "measured": [{**HEIGHT, "unit": "mm", "factor": 2}]}, ".factor: stands instead of unit"),
        ({"table": TABLE, "measured": [{**HEIGHT, "noise": 0}]}, ".noise: must be a number greater than 0"),
        ({"table": TABLE, "measured": [{**HEIGHT, "noise": [1, 2]}]}, ".noise: must be a number, not a list of 2"),
        ({"table": {**TABLE, "z": [NAN] * 3}}, ".columns: no recording has a number of ball.position[2]"),
        ({"table": TABLE, "frame": {"position": [1, 0, 0]}}, ".value: a frame turns whole quantities"),
        ({"table": TABLE, "rows": "k"}, ".rows: is for NPZ files"),
        ({"table": MANY, "split": "j"}, '.split: table has no column "j"'),
        ({"table": {**MANY, "k": [0.0, 0, NAN, 1]}, "split": "k"}, '.split: table, row 2 (from 0), column "k"'),
        ({"table": {**MANY, "k": [0.0, 0, 0, 1]}, "split": "k"}, "comes after 0.1 s"),
        ({"table": MANY, "split": "k", "held_back": 0.3}, ".held_back: 0.3 of 2 recordings is none of them"),
        ({"table": MANY, "split": "k", "held_back": [2]}, "there is no recording 2; they are counted from 0 to 1"),
        ({"table": MANY, "split": "k", "held_back": ["x"]}, '.held_back: there is no recording "x"'),
        ({"table": TABLE, "held_back": 1.5}, ".held_back: must be true, a share from 0 to 1"),
        (
            {"table": TABLE, "start": {"ball.place": "z"}},
            '"ball.place" at the start; valid: ball.position, ball.orientation',
        ),
        ({"table": TABLE, "start": {"ball.position": "z"}}, "ball.position has 3 numbers"),
        ({"table": TABLE, "start": {"ball.position": 3}}, "must be a text or a list of texts"),
        (
            {"table": {**TABLE, "x": [NAN, 0, 0]}, "start": {"ball.velocity": ["x", "x", "x"]}},
            "the first row lacks a number",
        ),
        ({"table": TABLE, "weight": 0}, ".weight: must be greater than 0"),
        ({"table": TABLE, "colour": "red"}, ".colour: unknown key"),
    ],
)
def test_tables(table: dict[str, Any], expected: str) -> None:
    text = message(table)
    assert expected in text and text.startswith('problem.toml: recording "drop"')


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        (
            {"variable": [{"name": "v", "sets": "ball.velocity", "prior": [0, 0]}]},
            ".prior: must be a number greater than 0",
        ),
        (
            {"variable": [{"name": "v", "sets": "ball.velocity", "prior": [[0, 0], 1]}]},
            ".prior: mean and standard deviation",
        ),
        ({"variable": [{"name": "v", "sets": "ball.velocity", "prior": 3}]}, "must be [mean, standard deviation]"),
        (
            {"variable": [{"name": "T", "sets": "simulation.duration", "each": "recording"}]},
            ".each: the duration is the same",
        ),
        ({"variable": [{"name": "v", "sets": "ball.velocity", "each": "toss"}]}, ".each: must be 'recording'"),
        ({"variable": [{"name": "s", "sets": "drop.scale", "lower": -1}]}, "drop.scale must be at least 0"),
        ({"identify": {"loss": "cauchy"}}, "identify.loss: must be 'squares' or 'huber'"),
        ({"cost": [{"name": "c", "value": "drop.offset"}]}, 'unknown name "drop.offset"'),
        ({"body": [{"name": "drop", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0}]}, "is already the name of"),
    ],
)
def test_what_belongs_to_recordings(others: dict[str, Any], expected: str) -> None:
    assert expected in message({"table": TABLE}, **others)


def test_without_recordings() -> None:
    own = [{"name": "v", "sets": "ball.velocity", "each": "recording"}]
    text = message(variable=own, identify={})
    assert "identify: there is no [[recording]]" in text
    assert 'variable "v".each: there is no [[recording]]' in text


def test_one_start_for_all_is_no_start_of_each() -> None:
    table = {"table": {**TABLE, "x": [0.0] * 3}, "start": {"ball.velocity": ["x", "x", "x"]}}
    text = message(table, variable=[{"name": "v", "sets": "ball.velocity[0]"}])
    assert 'variable "v".sets: recording drop sets ball.velocity at the start; with each = "recording"' in text


def test_the_duration_that_the_longest_recording_needs() -> None:
    """In whole steps; with it, the problem is one."""
    table = {"time": [0, 1.2, 0, 1.404, 0, 0.5], "z": [1.0] * 6, "k": [0.0, 0, 1, 1, 2, 2]}
    text = message({"table": table, "split": "k"})
    assert "rows 2 to 3: samples go on to 1.404 s (as do 1 others)" in text
    assert "needs duration = 1.41, or leave later ones out with until = 1" in text
    found = loaded({"table": table, "split": "k"}, simulation={"duration": 1.41, "dt": 0.01}).recordings
    assert max(each.time[-1] for each in found) == 1.404


@pytest.mark.parametrize(("factor", "unit"), [(1000, "mm"), (100, "cm")])
def test_other_units_are_told(factor: float, unit: str) -> None:
    """Where the start does not vary, by it; where it does, by the size of the world and the way of a fall."""
    table = {**TABLE, "z": [factor * z for z in TABLE["z"]]}
    text = message({"table": table})
    assert f"{factor:g} times the start of the simulation, 1 m" in text
    assert f'metres are wanted; are these {"milli" if unit == "mm" else "centi"}metres? unit = "{unit}"' in text
    free = [{"name": "z", "sets": "ball.position[2]", "each": "recording"}]
    if unit == "mm":
        text = message({"table": table}, variable=free)
        assert "are 161 times lengths in this world, up to about 5.91 m; metres are wanted; are these milli" in text
    assert loaded({"table": table, "measured": [{**HEIGHT, "unit": unit}]}).recordings


@pytest.mark.parametrize(
    ("arrays", "expected"),
    [
        ({"time": [0, 0.1], "z": [1.0, 1.0, 1.0]}, "a.npz: all arrays need as many rows; there are: time 2, z 3"),
        ({"time": [0, 0.1], "z": ["a", "b"]}, 'a.npz, array "z": must be numbers, a row for each time, not <U1'),
        ({"time": [0, 0.1], "z": np.ones((2, 1, 1))}, 'array "z": must be numbers, a row for each time'),
        (
            {"time": [0, 0.1], "z": np.array([1.0, None])},
            'a.npz cannot be read: "z" holds objects of Python, not numbers',
        ),
        ({"time": [0, 0.1], "z": [1.0, np.inf]}, 'array "z", row 1 (from 0): is not finite'),
        ({"time": [], "z": []}, "a.npz has no row of numbers"),
        ({"time": [0, 0.1], "height": [1.0, 1.0]}, 'a.npz has no column "z"'),
        (
            {"time": [0, 0.1], "z": [[1.0, 2.0]] * 2},
            'a.npz: "z" have 2 numbers in each row; the formula has one number',
        ),
    ],
)
def test_npz_files(arrays: dict[str, Any], expected: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **{name: np.asarray(value) for name, value in arrays.items()})
    with pytest.raises(ProblemError) as found:
        beside(tmp_path, {"files": "a.npz"})
    assert expected in str(found.value)


def test_npz_files_that_are_cut_pickled_or_empty(tmp_path: Path) -> None:
    """Nothing that is pickled is run; each message names the file and what was expected."""
    np.savez(tmp_path / "whole.npz", time=[0, 0.1], z=[1.0, 1.0])
    whole, run = (tmp_path / "whole.npz").read_bytes(), tmp_path / "run"
    contents = {"cut": whole[: len(whole) // 2], "pickled": pickle.dumps(Touches(run)), "empty": b""}
    contents["array"] = (lambda out: (np.save(out, [1.0, 2.0]), out.getvalue())[1])(io.BytesIO())
    for name, content in contents.items():
        (tmp_path / f"{name}.npz").write_bytes(content)
        expected = "it holds one array" if name == "array" else "it is no NPZ file of numbers"
        with pytest.raises(ProblemError, match=f"{name}.npz.*{expected}"):
            beside(tmp_path, {"files": f"{name}.npz"})
    np.savez(tmp_path / "objects.npz", time=[0, 0.1], z=np.array([Touches(run), 1.0], object))
    with pytest.raises(ProblemError, match=r"objects\.npz"):
        beside(tmp_path, {"files": "objects.npz"})
    assert not run.exists()


class Touches:
    """Makes a file where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        (
            {"table": {**TABLE, "z": [1.0, 1e300, 1.0]}},
            "row 1 (from 0): the number 1e+300 is no measurement; a missing",
        ),
        (
            {"table": TABLE, "measured": [{**HEIGHT, "noise": 1e-200}]},
            "noise: must be from 1e-30 to 1e+30, not [1e-200]",
        ),
        ({"table": TABLE, "measured": [{**HEIGHT, "noise": 1e200}]}, "noise: must be from 1e-30 to 1e+30"),
    ],
)
def test_numbers_without_finite_squares(table: dict[str, Any], expected: str) -> None:
    assert expected in message(table)


@pytest.mark.parametrize("rows", [[0, 3, 2], [0.5, 2], [0, 5], [1], [-1, 2], [[0, 1]]])
def test_first_rows(rows: list[Any], tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", time=[0, 0.1, 0.2, 0.3], z=np.ones(4), start=np.array(rows))
    with pytest.raises(ProblemError, match=r'recording "drop".rows: a.npz: '):
        beside(tmp_path, {"files": "a.npz", "rows": "start"})


@pytest.mark.parametrize("q", [[2, 0, 0, 0], [0, 0, 0, 0], [0.5, 0.5, 0.5, 0.6]])
def test_quaternions_have_length_one(q: list[float], tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", time=[0, 0.1], q=[[1, 0, 0, 0], q])
    with pytest.raises(ProblemError, match=r"a.npz, row 1 .*quaternion"):
        beside(tmp_path, {"files": "a.npz", "measured": [{"value": "ball.orientation", "columns": "q"}]})


CELL = st.sampled_from(["", "nan", "0", "1", "-1", "1000", "1e5", "1e300", "x", "1,5", " 2", '"', "inf", "\x00", "é"])
LINES = st.lists(st.lists(CELL, min_size=1, max_size=4).map(",".join), max_size=8)
TIMES = st.lists(st.sampled_from([0.0, 0.1, 0.2, 0.3, 5.0, -1.0, NAN, 1e300]), max_size=6)


def survives(folder: Path, table: dict[str, Any], **simulation: float) -> Problem | None:
    """The problem, or None where a ProblemError names what is wrong."""
    try:
        return beside(folder, table, simulation=simulation or BALL["simulation"])
    except ProblemError as error:
        assert "recording" in str(error)
        return None


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    header=st.sampled_from(["time,z", "time;z", "z,time", "time", "t,z", "time,z,z", ""]),
    lines=LINES,
    keys=st.fixed_dictionaries(
        {},
        optional={
            "rate": st.sampled_from([1.0, 1e9]),
            "clock": st.sampled_from(["file", "first row"]),
            "offset": st.sampled_from([-1e300, -0.1, 0.1]),
            "until": st.sampled_from([1e-9, 0.15]),
            "split": st.sampled_from(["z", "time"]),
            "held_back": st.sampled_from([True, 0.5, [0], ["a"]]),
            "time_factor": st.sampled_from([1e-300, 0.001, 1e300]),
        },
    ),
)
def test_any_csv_file_is_a_problem_or_a_message(
    header: str, lines: list[str], keys: dict[str, Any], tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text("\n".join([header, *lines]), encoding="utf-8")
    problem = survives(tmp_path, {"files": "a.csv", **keys})
    free = survives(tmp_path, {"files": "a.csv", **keys}, dt=0.01)
    assert free is None or free.simulation.duration >= max(each.time[-1] for each in free.recordings) - 1e-9
    assert problem is None or free is not None
    for each in problem.recordings if problem else ():
        assert np.all(np.diff(each.time) > 0) and each.time[0] >= 0 and each.time[-1] <= 1
        assert not np.isinf(each.measured[0].values).any() and len(each.measured[0].values) == len(each.time)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=100), cut=st.integers(0, 600), broken=st.integers(0, 255))
def test_any_npz_file_is_a_problem_or_a_message(content: bytes, cut: int, broken: int, tmp_path: Path) -> None:
    """Cut, with a byte that changed, or of anything."""
    np.savez(tmp_path / "a.npz", time=[0, 0.1], z=[1.0, 0.9])
    raw = bytearray((tmp_path / "a.npz").read_bytes())
    raw[cut % len(raw)] = broken
    for each in (bytes(raw), bytes(raw[: cut % len(raw)]), content):
        (tmp_path / "a.npz").write_bytes(each)
        survives(tmp_path, {"files": "a.npz"})
