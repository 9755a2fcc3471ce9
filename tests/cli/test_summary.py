"""The table after the runs: medians over seeds, no number cut, advice once, the worst miss first; times count once."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from rich.progress import Progress

from symphys import files
from symphys.cli.solve import time_line
from symphys.cli.summary import MAX_ANSWERS, advice, answer, answers, fitting_table, missed, table
from symphys.cli.watching.observers import Live, Notes, Plain
from symphys.results.result import CheckRecord, VariableRecord
from symphys.runs import Result
from symphys.solvers import CmaOptions, TraceRow

NAN = float("nan")
ROW = TraceRow(3, 4, 4, 0, 0, 0.1, 2.0, 1.0, 0.5, NAN, NAN, 0.0)


class Job:
    """The attributes of a job that progress reads."""

    name = "throw cma seed 0"
    options = CmaOptions(evaluations=8)
    examine = False

    class folder:
        path = "out/throw/cma-seed0"

    class problem:
        class simulation:
            smoothing = (0.0,)


def result(**changes: Any) -> Result:
    given = {"solver": "cma", "seed": 0, "solved": True, "status": "met", "advice": "", "seconds": {"solve": 1.5}}
    given["verdict"] = "solved" if changes.get("solved", True) else "not_solved"
    given |= {"objective": 0.5, "iterations": 7, "equivalents": 1234.5}
    return Result(problem="throw", title="A throw", **(given | changes))


def test_seeds_share_a_row_of_medians() -> None:
    group = [result(iterations=1), result(iterations=9), result(iterations=4, solved=False, status="budget")]
    shown = io.StringIO()
    Console(file=shown, width=120).print(table({("throw", "cma"): group, ("throw", "ipopt"): []}))
    rows = [line.split() for line in shown.getvalue().splitlines() if line.strip().startswith("throw")]
    assert rows[0][:8] == ["throw", "cma", "2/3", "0.5", "-", "4", "1,234", "1.5"]
    assert rows[1] == ["throw", "ipopt", "0/0", "-", "-", "-", "-", "-"]


def test_below_the_table_only_columns_that_are_there_are_explained() -> None:
    group = {("throw", "cma"): [result(), result(seed=1)]}
    whole, narrow = table(group), table(group, ["solved", "worst"])
    assert str(whole.caption).split("; ")[1:] == ["work in rollouts", "time of the solve", "medians over the seeds"]
    assert "worst" in str(narrow.caption) and "work" not in str(narrow.caption)


def test_a_doubted_run_does_not_count_as_solved() -> None:
    doubted = result(solved=False, verdict="doubted", doubts=("a goes through b", "5 J too many"))
    shown = io.StringIO()
    Console(file=shown, width=140).print(table({("throw", "cma"): [doubted]}))
    assert "0/1" in shown.getvalue()
    (line,) = advice({("throw", "cma"): [doubted]})
    assert all(doubt in line for doubt in doubted.doubts)


def test_advice_is_given_once_and_for_unsolved_runs_only() -> None:
    group = [result(solved=False, advice="try more"), result(solved=False, advice="try more"), result(advice="fine")]
    (line,) = advice({("throw", "cma"): group})
    assert line.endswith("try more")


@pytest.mark.parametrize(("width", "gone"), [(120, ()), (80, ("work", "iterations")), (44, ("seconds", "ended"))])
def test_a_narrow_table_loses_columns_and_cuts_no_number(width: int, gone: tuple[str, ...]) -> None:
    """Columns go in the order of their importance; only names are wrapped."""
    results = {
        ("a_rather_long_name", solver): [result(solver=solver, objective=0.000183, equivalents=12345.0)]
        for solver in ("least_squares", "gradient")
    }
    buffer = io.StringIO()
    Console(file=buffer, width=width).print(fitting_table(results, width))
    text = buffer.getvalue()
    assert "…" not in text and max(map(len, text.splitlines())) <= width
    assert [name for name in (*gone, "solved", "worst") if name in text.splitlines()[1]] == ["solved", "worst"]
    assert ("12,345" in text) == (width == 120)


def test_what_is_missed_is_named_the_worst_first() -> None:
    checks = [CheckRecord("target", name, ratio / 10, 0.1, ratio, ratio <= 1, "m") for name, ratio in
              (("near", 0.5), ("far", 7.0), ("farther", 9.0), ("off", 2.0), ("just", 1.5))]  # fmt: skip
    found = missed(result(solved=False, checks=tuple(checks)))
    assert 0 < found.index('"farther" by 0.9 m') < found.index('"far" by 0.7 m') < found.index('"off" by 0.2 m')
    assert "near" not in found and "just" not in found
    assert missed(result(checks=tuple(checks[:1]))) == ""


def test_the_time_of_a_command_counts_once_what_is_built_once() -> None:
    """A run that was done before does not count."""
    notes = Notes()
    for skipped in (False, False, True):
        notes.new(result(seconds={"build": 1.0, "compile": 2.0, "solve": 3.0, "judge": 4.0}), skipped)
    assert notes.seconds == {"build": 1.0, "compile": 2.0, "solve": 6.0, "judge": 8.0}


def test_live_progress_opens_and_closes_its_lines() -> None:
    job: Any = Job()
    with Progress(console=Console(file=io.StringIO(), force_terminal=True, width=100)) as progress:
        live = Live(progress, 1)
        live.started(job, resumed=False)
        assert len(progress.tasks) == 2
        live.ended(job, result(), skipped=False)
        assert len(progress.tasks) == 1


@pytest.mark.parametrize(("every", "lines"), [(0.0, 3), (1000.0, 0)])
def test_without_a_terminal_lines_keep_their_distance(
    every: float, lines: int, capsys: pytest.CaptureFixture[str]
) -> None:
    plain, job = Plain(every), Job()
    for _ in range(3):
        plain.advanced(job, ROW)  # type: ignore[arg-type]
    assert capsys.readouterr().err.count(job.name) == lines


def found(name: str, value: Any, unit: str = "", sets: str = "ball.velocity") -> VariableRecord:
    numbers = np.atleast_2d(np.array(value, float)).T
    return VariableRecord(name, (sets,), numbers, 0 * numbers, numbers, numbers, unit)


def test_an_answer_has_its_numbers_unit_and_guess() -> None:
    assert (
        answer(found("throw", [12.0943, 0, 1.2], "m/s")) == "found throw = 12.09 0 1.2 m/s, guess 0 0 0 (ball.velocity)"
    )
    assert answer(found("grip", 0.4, sets="ground.friction")) == "found grip = 0.4, guess 0 (ground.friction)"


def test_of_many_numbers_the_range_is_said() -> None:
    knots = np.linspace(-1, 2, 41)[None]
    twist = VariableRecord("twist", ("elbow.command",), knots, 0 * knots, knots, knots, "N m")
    assert answer(twist) == "found twist: 41 knots from -1 to 2 N m (elbow.command)"
    assert (
        answer(found("brain", np.arange(1000), sets="brain.weights"))
        == "found brain: 1,000 numbers from 0 to 999 (brain.weights)"
    )


def test_answers_are_of_accepted_runs_and_of_few(tmp_path: Path) -> None:
    """What a batch keeps of a result has no variables, so they are read; a folder that is gone is passed over."""
    whole = result(z={"throw": found("throw", [1, 2, 3], "m/s")})
    files.write_json(tmp_path / "result.json", files.strict(whole.to_json()))
    job: Any = SimpleNamespace(name="throw cma seed 0", folder=SimpleNamespace(path=tmp_path))
    gone: Any = SimpleNamespace(name="throw cma seed 1", folder=SimpleNamespace(path=tmp_path / "gone"))
    assert answers([job], [result()]) == [answer(whole.z["throw"])]
    assert answers([job, gone], [result(), result()]) == [f"throw cma: {answer(whole.z['throw'])}"]
    assert answers([job], [None]) == answers([job], [result(solved=False)]) == []
    assert answers([job] * (MAX_ANSWERS + 1), [result()] * (MAX_ANSWERS + 1)) == []


@pytest.mark.parametrize(
    ("total", "parts", "said"),
    [
        (40.0, {"build": 0.1, "compile": 30.0, "solve": 1.0}, "the next command takes less"),
        (40.0, {"build": 0.1, "compile": 1.0, "solve": 1.0, "judge": 30.0}, "--unexamined"),
        (40.0, {"build": 0.1, "compile": 1.0, "solve": 1.0}, "--no-report"),
        (40.0, {"build": 0.1, "compile": 1.0, "solve": 30.0}, ""),
        (8.0, {"build": 0.1, "compile": 7.0, "solve": 0.1}, ""),
        (40.0, {}, ""),
    ],
)
def test_how_to_shorten_most_of_a_long_time_is_said(total: float, parts: dict[str, float], said: str) -> None:
    line = time_line(total, parts)
    assert line.startswith(f"time: {total:g} s in all") and said in line
    assert bool(said) == (line.count(";") > 1)
