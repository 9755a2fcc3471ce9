"""Trajectories that are given: scipy's interpolation, in formulas of every kind, and faults by file, row and column."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem
from symphys.problem.references import ReferenceTrajectory
from symphys.transcription import transcribe

TIMES = np.array([0, 0.1, 0.25, 0.4, 0.5])
CSV = "time,x,z\n0,0,1\n0.1,0.2,1.1\n0.25,0.3,0.9\n0.4,0.8,0.5\n0.5,1.0,0.2\n"
BALL = """
[simulation]
duration = 0.5
dt = 0.01
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 0.5
position = [0, 0, 1]
[[reference]]
name = "path"
file = "path.csv"
interpolation = "cubic"
[[force]]
name = "pull"
on = "ball.force[0]"
value = "path.x - ball.position[0]"
[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 0.5, 0.2]
[[variable]]
name = "push"
sets = "ball.force[2]"
knots = 3
guess = [5, 4, 5]
[[cost]]
name = "off the path"
at = "always"
squares = "[ball.position[0], ball.position[2]] - [path.x, path.z]"
[[cost]]
name = "the reference alone"
at = "always"
value = "path.z"
[[target]]
name = "there"
value = "ball.position[0] - end.path.x + 0 * integral(path.z)"
tolerance = 0.01
"""


def load(tmp_path: Path, text: str = BALL, table: str = CSV) -> Problem:
    (tmp_path / "path.csv").write_text(table, encoding="utf-8")
    path = tmp_path / "ball.toml"
    path.write_text(text, encoding="utf-8")
    return load_problem(path)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_between_the_rows_it_is_scipys_interpolation_and_beyond_them_it_stays(kind: str) -> None:
    y = np.array([0, 0.2, 0.3, 0.8, 1.0])
    made = ReferenceTrajectory("path", TIMES, {"x": y}, kind)  # type: ignore[arg-type]
    t = ca.SX.sym("t")
    value = made.at(t)["path.x"]
    found = ca.Function("path", [t], [value, ca.gradient(value, t)])
    now = np.concatenate([np.linspace(-0.1, 0.6, 141), TIMES])
    values, slopes = (np.array(part).ravel() for part in found.map(now.size)(now))
    inside = np.clip(now, 0, 0.5)
    assert np.isfinite(slopes).all()
    if kind == "linear":
        assert values == pytest.approx(np.interp(now, TIMES, y), abs=1e-14)
        return
    spline = CubicSpline(TIMES, y)
    assert values == pytest.approx(spline(inside), abs=1e-14)
    within = (now > 0) & (now < 0.5)
    assert slopes[within] == pytest.approx(spline(now[within], 1), abs=1e-12)


def test_a_formula_of_it_is_its_interpolation_over_time(tmp_path: Path) -> None:
    made = transcribe(load(tmp_path), backend="casadi")
    spline = CubicSpline(TIMES, [1, 1.1, 0.9, 0.5, 0.2])
    samples = spline(np.linspace(0, 0.5, 51))
    expected = 0.01 * (samples[:-1] + samples[1:]).sum() / 2
    assert made.judge(made.shooting.start(0)).costs["the reference alone"] == pytest.approx(expected, rel=1e-12)


def test_the_problem_keeps_the_numbers_of_its_file(tmp_path: Path) -> None:
    problem = load(tmp_path)
    (tmp_path / "path.csv").unlink()
    (tmp_path / "kept.toml").write_text(problem.text, encoding="utf-8")
    again = load_problem(tmp_path / "kept.toml")
    assert again.references[0].columns["z"] == pytest.approx(problem.references[0].columns["z"])
    assert again.text == problem.text


def test_npz_files_and_tables_hold_the_same(tmp_path: Path) -> None:
    columns = {"time": TIMES, "x": TIMES**2, "z": 1 - TIMES / 3}
    np.savez(tmp_path / "path.npz", **columns)
    table = ", ".join(f"{name} = {column.tolist()}" for name, column in columns.items())
    one = load(tmp_path, BALL.replace("path.csv", "path.npz")).references[0]
    other = load(tmp_path, BALL.replace('file = "path.csv"', f"table = {{ {table} }}")).references[0]
    for name in ("x", "z"):
        assert np.array_equal(one.columns[name], columns[name])
        assert np.array_equal(other.columns[name], columns[name])


@pytest.mark.parametrize(
    ("found", "given", "message"),
    [
        ("0.1,0.2,1.1", "0.1,0.2,fast", r'reference "path".file: path.csv, row 3, column "z": "fast" is no number'),
        ("0.1,0.2,1.1", "0.1,nan,1.1", r'row 3, column "x": "nan" is not finite'),
        ("0.1,0.2,1.1", "0.1,0.2", r"row 3: 2 numbers, but the header has 3 columns"),
        ("0.25,0.3", "0.1,0.3", r"row 4: the time 0.1 does not come after 0.1"),
        ("time,x,z", "t,x,z", r"row 1: the columns are t, x, z; one time"),
        ("time,x,z", "time,x,1z", r'row 1: "1z" is no name of a column'),
    ],
)
def test_what_is_wrong_with_a_file_is_said_by_row_and_column(
    tmp_path: Path, found: str, given: str, message: str
) -> None:
    with pytest.raises(ProblemError, match=message):
        load(tmp_path, table=CSV.replace(found, given))


@pytest.mark.parametrize(
    ("found", "given", "message"),
    [
        ('"path.csv"', '"way.csv"', r'reference "path".file: .*way.csv: there is no such file'),
        ('"path.csv"', '"way.npz"', r'reference "path".file: .*way.npz cannot be read'),
        ('file = "path.csv"', "", r'reference "path".file: give either file .* or table'),
        ('file = "path.csv"', "table = { time = [0, 1], x = [1] }", r"as many numbers; there are: time 2, x 1"),
        ("path.x - ball", "path.y - ball", r'unknown name "path.y"; did you mean "path'),
        ('name = "path"', 'name = "ball"', r'"ball" is already the name'),
    ],
)
def test_what_cannot_be_names_table_and_key(tmp_path: Path, found: str, given: str, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        load(tmp_path, BALL.replace(found, given, 1))


def test_a_termination_is_of_the_state_alone(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r'margin: .*"path.x"'):
        load(tmp_path, f'{BALL}\n[termination]\nmargin = "path.x"\n')
