"""Values typed are read as TOML means them; results are worded in one line."""

from __future__ import annotations

import io
import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console
from rich.progress import Progress

from symphys.cli.arguments import UsageFault, read_settings
from symphys.cli.solve import time_line
from symphys.cli.summary import advice, fitting_table, missed, table
from symphys.cli.watching.live import Live
from symphys.cli.watching.plain import Notes, Plain
from symphys.cli.watching.words import at
from symphys.cli.wording import brief, duration, many_pairs, number, whole
from symphys.problem.reading.value_texts import read_value
from symphys.results.result import CheckRecord
from symphys.runs import Result
from symphys.solvers import CmaOptions, TraceRow

NAN = float("nan")


def result(**changes: Any) -> Result:
    given = {"solver": "cma", "seed": 0, "solved": True, "status": "met", "advice": "", "seconds": {"solve": 1.5}}
    given["verdict"] = "solved" if changes.get("solved", True) else "not_solved"
    given |= {"objective": 0.5, "iterations": 7, "equivalents": 1234.5}
    return Result(problem="throw", title="A throw", **(given | changes))


class Job:
    """As much of a job as messages need."""

    name = "throw cma seed 0"

    class folder:
        path = "out/throw/cma-seed0"

    options = CmaOptions(evaluations=8)
    examine = False

    class problem:
        class simulation:
            smoothing = (0.0,)


@settings(deadline=None)
@given(st.recursive(st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False), st.lists, max_leaves=5))
def test_a_toml_value_is_read_as_such(value: object) -> None:
    assert read_value(json.dumps(value).replace("Infinity", "inf")) == value


@settings(deadline=None)
@given(st.text())
def test_anything_else_is_text(text: str) -> None:
    assert read_value(f"no {text}") == f"no {text}"


@pytest.mark.parametrize("text", ["1\nb = 2", "[" * 100_000, "2020-01-01", "", "1 2"])
def test_odd_values_are_text(text: str) -> None:
    assert read_value(text) == text


def test_settings_keep_their_keys() -> None:
    assert read_settings(["a.b=1.5", " c = x=y"]) == {"a.b": 1.5, "c": "x=y"}


@pytest.mark.parametrize("assignment", ["a", "=1", ""])
def test_a_setting_needs_key_and_value(assignment: str) -> None:
    with pytest.raises(UsageFault, match="KEY=VALUE"):
        read_settings([assignment])


def test_numbers_are_short_and_unknown_ones_are_dashes() -> None:
    assert [number(x) for x in (None, NAN, 0.000123456, float("inf"))] == ["-", "-", "0.000123", "inf"]
    assert [whole(x) for x in (None, NAN, 1234.6)] == ["-", "-", "1,235"]
    assert [duration(x) for x in (None, 0.01234, 104.2, 4000.0)] == ["-", "0.0123", "104", "4,000"]


def test_a_run_in_a_line() -> None:
    job: Any = Job()
    assert brief(job, result(), skipped=False) == "solved, objective 0.5, 7 iterations, 1.5 s"
    assert brief(job, result(), skipped=True) == "done before (solved)"
    failed = result(solved=False, status="failed", advice="broken\nin two")
    assert brief(job, failed, skipped=False) == "failed: broken"
    assert brief(job, failed, skipped=True) == "failed before: broken (--rerun failed tries again)"


def test_seeds_share_a_row_of_medians() -> None:
    group = [result(iterations=1), result(iterations=9), result(iterations=4, solved=False, status="budget")]
    shown = io.StringIO()
    Console(file=shown, width=120).print(table({("throw", "cma"): group, ("throw", "ipopt"): []}))
    rows = [line.split() for line in shown.getvalue().splitlines() if line.strip().startswith("throw")]
    assert rows[0] == ["throw", "cma", "2/3", "0.5", "-", "4", "1,234", "1.5", "met", "2,", "budget", "1"]
    assert rows[1] == ["throw", "ipopt", "0/0", "-", "-", "-", "-", "-"]
    assert "medians over the seeds" in shown.getvalue()


def test_advice_is_given_once_and_for_unsolved_runs_only() -> None:
    group = [result(solved=False, advice="try more"), result(solved=False, advice="try more"), result(advice="fine")]
    assert advice({("throw", "cma"): group}) == ["throw cma: try more"]


def test_a_verdict_that_is_neither_solved_nor_unsolved_is_said_in_words() -> None:
    job: Any = Job()
    checks = (CheckRecord("target", "there", 0.0, 1.0, 0.0, met=True),)
    doubted = result(solved=False, verdict="doubted", doubts=("a goes through b", "5 J too many"), checks=checks)
    best = result(solved=False, verdict="best_found", status="budget", advice="raise it")
    assert brief(job, doubted, skipped=False).startswith("met, but not to be trusted, objective")
    assert brief(job, best, skipped=False).startswith("best found, budget ended, objective")
    groups = {("throw", "cma"): [doubted], ("walk", "cma"): [best]}
    assert advice(groups) == [
        "throw cma: not to be trusted: a goes through b; 5 J too many",
        "walk cma: raise it",
    ]
    shown = io.StringIO()
    Console(file=shown, width=140).print(table(groups))
    rows = [line for line in shown.getvalue().splitlines() if " cma " in line]
    assert "0/1" in rows[0] and rows[0].rstrip().endswith("met, but not to be trusted")
    assert rows[1].rstrip().endswith("best found, budget ended")


def test_live_progress_opens_and_closes_its_lines() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=100)
    job: Any = Job()
    with Progress(console=console) as progress:
        live = Live(progress, 1)
        live.started(job, resumed=False)
        assert len(progress.tasks) == 2
        live.ended(job, result(), skipped=False)
        assert [task.description for task in progress.tasks] == ["1 of 1 runs done"]


def test_a_world_with_many_pairs_says_what_it_costs_and_what_to_do() -> None:
    assert many_pairs("break", 11) == ""
    said = many_pairs("heap", 400)
    assert "400 pairs" in said and "120 s" in said and "collides_with" in said


def test_what_is_told_is_shown_while_it_works() -> None:
    row = TraceRow(3, 4, 4, 0, 0, 0.1, 2.0, 1.0, 0.5, NAN, NAN, 0.0, {"speed [m/s]": 1.25, "lasting": 0.875})
    assert at(row) == "iteration 3, objective 1, worst 0.5, speed 1.25 m/s, lasting 0.875"


@pytest.mark.parametrize(("every", "lines"), [(0.0, 3), (1000.0, 0)])
def test_without_a_terminal_a_long_run_says_now_and_then_where_it_is(
    every: float, lines: int, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = Plain(every)
    for k in range(3):
        plain.advanced(Job(), TraceRow(k, 4, 4, 0, 0, 0.1, 2.0, 1.0, 0.5, NAN, NAN, 0.0))  # type: ignore[arg-type]
    assert capsys.readouterr().err.count("throw cma seed 0: iteration") == lines


@pytest.mark.parametrize(("width", "gone"), [(120, ()), (80, ("work", "iterations")), (44, ("seconds", "ended"))])
def test_a_narrow_table_loses_columns_and_cuts_no_number(width: int, gone: tuple[str, ...]) -> None:
    """The least important first; only names are wrapped."""
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
    checks = [CheckRecord("target", name, ratio / 10, 0.1, ratio, ratio <= 1) for name, ratio in
              (("near", 0.5), ("far", 7.0), ("farther", 9.0), ("off", 2.0), ("just", 1.5))]  # fmt: skip
    found = missed(result(solved=False, checks=tuple(checks)))
    assert found == 'missed: "farther" by 0.9 (tolerance 0.1), "far" by 0.7 (tolerance 0.1), "off" by 0.2 ' + (
        "(tolerance 0.1) and 1 more"
    )
    assert missed(result(checks=tuple(checks[:1]))) == ""
    metres = CheckRecord("target", "there", 0.7, 0.1, 7.0, False, "m")
    assert missed(result(solved=False, checks=(metres,))) == 'missed: "there" by 0.7 m (tolerance 0.1 m)'


def test_the_time_of_a_command_is_told_by_its_parts() -> None:
    """What is built once for several runs counts once; what was done before does not count."""
    notes = Notes()
    seconds = {"build": 1.0, "compile": 2.0, "solve": 3.0}
    for skipped in (False, False, True):
        notes.new(result(seconds=seconds), skipped)
    assert notes.seconds == {"build": 1.0, "compile": 2.0, "solve": 6.0}
    assert time_line(10.0, notes.seconds) == (
        "time: 10 s in all; building 1, compiling 2, solving 6, judging and reports 1"
    )
    assert time_line(0.5, {}) == "time: 0.5 s in all"
