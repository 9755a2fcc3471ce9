"""A run comes out the same again, to the bit, from what its folder has; what is not the same is named."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import symphys
from symphys import files, problems
from symphys.problem import load_problem
from symphys.results.config import read_config
from symphys.results.file_names import CONFIG, PROBLEM, RESULT, TRAJECTORY
from symphys.runs import make_jobs
from symphys.runs.replay import ReplayError, compare_arrays, compare_numbers, replay

TABLES = {
    "simulation": {"duration": 0.2, "dt": 0.02},
    "body": [{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "position": [0, 0, 0.15]}],
    "ground": {"friction": 0.3, "restitution": 0.5},
    "variable": [{"name": "throw", "sets": "ball.velocity", "guess": [1, 0, -2]}],
    "target": [{"name": "there", "value": "ball.position[0:2] - [0.31, 0]", "tolerance": 0.01}],
    "output": [{"name": "speed", "value": "norm(ball.velocity)", "unit": "m/s"}],
}


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with an impact, made under settings."""
    out = tmp_path_factory.mktemp("replay")
    problem = symphys.load(TABLES).set({"ground.friction": 0.7, "simulation.dt": 0.01})
    return symphys.solve(problem, "least_squares", folder=out, backend="casadi").folder


@pytest.fixture
def folder(solved: Path, tmp_path: Path) -> Path:
    """A copy of it that may be damaged."""
    return Path(shutil.copytree(solved, tmp_path / "run"))


@pytest.mark.slow
def test_a_run_is_the_same_to_the_bit(folder: Path) -> None:
    found = replay(folder)
    assert found.same and found.instants == 21 and not found.elsewhere
    assert str(found).endswith(f"the same, to the bit ({found.quantities} quantities, 21 instants)")
    assert symphys.read(folder).replay().same
    assert read_config(folder / CONFIG).settings == {"ground.friction": 0.7, "simulation.dt": 0.01}


def test_one_bit_is_found_and_named_with_its_place(folder: Path) -> None:
    with np.load(folder / TRAJECTORY) as archive:
        arrays = dict(archive)
    arrays["position"][7, 0, 2] = np.nextafter(arrays["position"][7, 0, 2], 9.0)
    files.write_npz(folder / TRAJECTORY, arrays)
    found = replay(folder)
    (difference,) = found.differences
    assert (difference.name, difference.unit, difference.time) == ("ball.position", "m", pytest.approx(0.07))
    assert 0 < difference.size < 1e-15 and not found.same
    assert "versions, processor and platform are those of then" in str(found)


def test_what_an_older_file_lacks_is_not_compared(folder: Path) -> None:
    with np.load(folder / TRAJECTORY) as archive:
        arrays = {name: array for name, array in archive.items() if name not in ("velocity", "paradox")}
    files.write_npz(folder / TRAJECTORY, arrays)
    found = replay(folder)
    assert found.same and found.lacking == ("velocity", "paradox")
    assert str(found).splitlines()[1] == "  not in trajectory.npz, and not compared: velocity, paradox"


def test_another_setting_is_another_motion(folder: Path) -> None:
    """So the folder's settings are what is rolled out."""
    config = files.read_json(folder / CONFIG)
    files.write_json(folder / CONFIG, {**config, "settings": {**config["settings"], "ground.friction": 0.1}})
    names = [each.name for each in replay(folder).differences]
    assert "ball.velocity" in names and "output: speed [m/s]" in names and "there" in str(names)


def test_numbers_and_versions_that_are_not_those_of_then_are_named(folder: Path) -> None:
    result = files.read_json(folder / RESULT)
    result["outputs"]["speed [m/s]"] += 1.0
    result["versions"]["casadi"] = "3.0"
    result["provenance"]["processor"] = "another"
    result["provenance"]["host"] = "elsewhere"
    files.write_json(folder / RESULT, result)
    found = replay(folder)
    assert [each.name for each in found.differences] == ["output: speed [m/s]"]
    assert found.differences[0].size == pytest.approx(1.0)
    assert set(found.elsewhere) == {"casadi", "processor"} and "casadi: 3.0 then" in str(found)


def test_what_cannot_be_rolled_out_is_said_with_the_file(folder: Path) -> None:
    with pytest.raises(ReplayError, match="no such folder"):
        replay(folder / "nothing")
    whole = (folder / TRAJECTORY).read_bytes()
    (folder / TRAJECTORY).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ReplayError, match=r"trajectory\.npz: .*archive"):
        replay(folder)
    (folder / TRAJECTORY).unlink()
    with pytest.raises(ReplayError, match=r"trajectory\.npz"):
        replay(folder)
    (folder / TRAJECTORY).write_bytes(whole)
    result = files.read_json(folder / RESULT)
    result["z"]["throw"] = {**result["z"]["throw"], "value": [1.0], "shape": [1, 1]}
    files.write_json(folder / RESULT, result)
    with pytest.raises(ReplayError, match=r"result\.json .*1 .*'throw'.*3"):
        replay(folder)
    files.write_json(folder / RESULT, {**result, "z": None, "advice": "no memory"})
    with pytest.raises(ReplayError, match="no memory"):
        replay(folder)
    (folder / RESULT).write_text("{", encoding="utf-8")
    with pytest.raises(ReplayError, match=r"result\.json: .*JSON"):
        replay(folder)


def test_a_motion_of_other_things_is_refused(folder: Path) -> None:
    text = (folder / PROBLEM).read_text(encoding="utf-8")
    (folder / PROBLEM).write_text(text.replace("duration = 0.2", "duration = 0.1"), encoding="utf-8")
    with pytest.raises(ReplayError, match="time, 21 and 11"):
        replay(folder)


def test_arrays_are_compared_by_their_bits() -> None:
    time = np.array([0.0, 0.1])
    same = np.array([[np.nan, 1.0], [np.inf, -0.0]])
    assert list(compare_arrays("x", "m", time, same, same.copy())) == []
    (sign,) = compare_arrays("x", "m", time, same, np.abs(same))
    assert (sign.size, sign.time, str(sign.recorded), str(sign.again)) == (0.0, 0.1, "-0.0", "0.0")
    (lost,) = compare_arrays("x", "m", time, same, np.array([[0.0, 1.0], [np.inf, -0.0]]))
    assert (lost.size, lost.time) == (np.inf, 0.0)
    (shape,) = compare_arrays("x", "m", time, same, same[:1])
    assert shape.size == np.inf
    assert list(compare_numbers({"a": 1.0, "b": np.nan}, {"a": 1.0})) == []
    assert [each.name for each in compare_numbers({"a": 1.0}, {"a": 1.0, "b": 2.0})] == ["b"]


@pytest.mark.parametrize("name", ["ball_throw", "cart_pole"])
def test_the_problem_in_a_folder_with_its_settings_is_the_one_that_was_solved(name: str, tmp_path: Path) -> None:
    """By the key, which is of all that decides a result; the second problem includes a robot and a task."""
    settings: dict[str, object] = {"simulation.dt": 0.0125, "solver.gradient.iterations": 3}
    problem = load_problem(problems.catalogue()[name], settings)
    (job,) = make_jobs([problem], ["gradient"], [2], settings, tmp_path)
    job.folder.begin(job.config, job.problem.text)
    asked = read_config(job.folder.path / CONFIG)
    read = load_problem(job.folder.path / PROBLEM, asked.settings)
    (again,) = make_jobs([read], [asked.solver], [asked.seed], dict(asked.settings), tmp_path)
    assert again.config.key == asked.key == job.config.key
    assert json.dumps(files.strict(again.config.options)) == json.dumps(files.strict(asked.options))
    changed = (job.folder.path / PROBLEM).read_text(encoding="utf-8") + "\n"
    (job.folder.path / PROBLEM).write_text(changed, encoding="utf-8")
    other = load_problem(job.folder.path / PROBLEM, asked.settings)
    (another,) = make_jobs([other], [asked.solver], [asked.seed], dict(asked.settings), tmp_path)
    assert another.config.key != asked.key
