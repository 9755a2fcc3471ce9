"""Data profiles and running times of solves that are known, one judge for all smoothings, and a small table whole."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bench import main
from profile_runs import (
    WORST,
    Budget,
    Cases,
    Profiles,
    RecordedSolve,
    RecordingEvaluator,
    advice,
    append,
    costs,
    ratios,
    read,
    read_lines,
    running_times,
)

from symphys.errors import SymphysError
from symphys.problem import load_problem
from symphys.problems import find
from symphys.shooting import Values
from symphys.transcription import transcribe

PROBLEMS, METHODS = ("bounce_cycle", "free_kick", "push_and_fly"), ("gradient", "least_squares", "cma")
BUDGET = Budget(300, 1000.0)


def recorded(method: str, instance: int, trace: list[tuple[float, ...]], ended: float = 100.0) -> RecordedSolve:
    """Of a problem whose merit is 10 at the start and 0 at best; seconds are a tenth of the work."""
    rows = np.array([(work, work / 10, merit, met) for work, merit, met in trace], float).reshape(-1, 4)
    return RecordedSolve("p", "all", method, instance, True, 10.0, rows, {"work": ended, "seconds": ended / 10})


def profiles() -> Profiles:
    """One method that succeeds twice, at 10 and at 30; one that succeeds once, and ends at 100 without the other."""
    quick = [recorded("a", 0, [(0, 10, 0), (10, 0, 1)], 20), recorded("a", 1, [(0, 10, 0), (30, 0.5, 1)], 40)]
    slow = [recorded("b", 0, [(0, 10, 0), (50, 0.005, 1)], 60), recorded("b", 1, [(0, 10, 0), (70, 2, 0)], 100)]
    return Profiles((*quick, *slow), {}, Budget(200, 20))


def test_a_solve_has_converged_where_its_fall_is_that_share_of_the_largest() -> None:
    """At 0.1 from 10 to 1 at most, at 0.001 to 0.01."""
    assert {k: v.tolist() for k, v in costs(profiles(), 1e-1, "work").items()} == {"a": [10, 30], "b": [50, math.inf]}
    assert costs(profiles(), 1e-3, "work")["a"].tolist() == [10, math.inf]
    assert costs(profiles(), 1e-3, "seconds")["b"].tolist() == [5, math.inf]
    assert costs(profiles(), 1e-5, "work")["b"].tolist() == [math.inf, math.inf]


def test_expected_running_time_is_all_work_over_successes() -> None:
    times = running_times(profiles(), "work")
    assert times == {"p": {"a": (10 + 30) / 2, "b": (50 + 100) / 1}}
    assert running_times(profiles(), "seconds")["p"]["b"] == 15
    assert ratios(times, ["p"]) == pytest.approx({"a": 1.0, "b": 7.5})
    both = {"p": {"a": 1.0, "b": 4.0}, "q": {"a": math.inf, "b": 2.0}, "nobody": {"a": math.inf, "b": math.inf}}
    assert ratios(both, both) == pytest.approx({"a": math.sqrt(WORST), "b": 2.0})
    assert advice(profiles()) == ["all (1): take a (50 %, 1 times the best)"]
    slow = tuple(replace(each, method="slow") for each in profiles().solves if each.method == "b")
    sure = (*slow[:1], replace(slow[0], instance=1))
    both = replace(profiles(), solves=(*profiles().solves[:2], *sure))
    assert advice(both) == [
        "all (1): take slow (100 %, 2.5 times the best); quicker where it succeeds: a (50 %, 1 times the best)"
    ]


class Smoothed:
    """Merit (z - smoothing)^2, met where z is within 0.1 of 0 exactly."""

    def value(self, Z: Any, smoothing: float) -> Values:
        merit = (Z[:, 0] - smoothing) ** 2
        return Values(merit, merit, np.abs(Z[:, :1] - smoothing) / 0.1)


def test_points_of_all_smoothings_count_by_their_exact_value() -> None:
    """The best point of a smoothed stage is not that of the exact problem, and counts by what it is there."""
    problem: Any = SimpleNamespace(met=lambda errors: bool((errors <= 1).all()))
    recorder, row = RecordingEvaluator(Smoothed(), problem), SimpleNamespace()  # type: ignore[arg-type]
    found = recorder.value(np.array([[0.5], [0.3]]), 0.5)
    assert found.merit.tolist() == pytest.approx([0, 0.04])
    recorder.row(row, 1.0)  # type: ignore[arg-type]
    recorder.value(np.array([[2.0], [0.05]]), 0.0)
    recorder.row(row, 2.0)  # type: ignore[arg-type]
    judged = [(seconds, merit, met) for _, seconds, merit, met in recorder.judged([row, row])]  # type: ignore[list-item]
    assert judged == [(1.0, pytest.approx(0.25), False), (2.0, pytest.approx(0.0025), True)]


def test_a_line_that_is_not_whole_is_dropped_and_the_rest_stays(tmp_path: Path) -> None:
    file = tmp_path / "p.jsonl"
    append(file, {"problem": "p"})
    append(file, {"method": "a"})
    whole = file.read_bytes()
    file.write_bytes(whole + b'{"method": "b", "trace": [[0')
    assert read_lines(file) == [{"problem": "p"}, {"method": "a"}]
    assert file.read_bytes() == whole


@pytest.mark.thorough
def test_a_small_table_is_whole_goes_on_where_it_was_and_has_the_judges_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The budget of work ends the solves, on whatever machine."""
    asked = ["profiles", f"--folder={tmp_path}", "--methods", *METHODS]
    asked += [f"--seconds={BUDGET.seconds}", f"--work={BUDGET.work:g}"]
    assert main([*asked, "--problems", "free_kick", "--instances=1"]) == 0
    file = tmp_path / "free_kick.jsonl"
    first = file.read_bytes()
    file.write_bytes(first[:-40])  # as a process that was killed leaves it
    assert main([*asked, "--problems", *PROBLEMS, "--instances=2", f"--out={tmp_path / 'rows.json'}"]) == 0
    assert file.read_bytes().startswith(first[: first.rfind(b"\n", 0, -1) + 1])
    found = read(tmp_path)
    cases = {(each.problem, each.method, each.instance) for each in found.solves}
    assert cases == {(problem, method, instance) for problem in PROBLEMS for method in METHODS for instance in (0, 1)}
    assert "take " in capsys.readouterr().out
    rows = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))["rows"]
    assert {(row["problem"], row["method"]) for row in rows if row["problem"]} == {case[:2] for case in cases}
    made = transcribe(load_problem(find("free_kick")), backend="casadi")
    lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    for line in lines[1:]:
        start = made.judge(made.shooting.start(line["instance"]))
        assert line["start"] == pytest.approx(start.objective, rel=1e-9)
        assert line["solved"] and line["trace"][-1][2] == pytest.approx(line["objective"], rel=1e-6, abs=1e-12)
    with pytest.raises(SymphysError, match="another budget"):
        Cases("free_kick", tmp_path, Budget(2000, 1000.0)).run(1)
