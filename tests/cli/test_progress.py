"""The share that is done and the time that is left: of a run, of a batch, and of work whose parts are known."""

from __future__ import annotations

import io
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from rich.console import Console
from tools.waiting import until

from symphys.cli.watching import heartbeat as heartbeats
from symphys.cli.watching import observers as plain_lines
from symphys.cli.watching import progress as batch_progress
from symphys.cli.watching import watch, working
from symphys.cli.watching.heartbeat import heartbeat
from symphys.cli.watching.observers import Plain
from symphys.cli.watching.progress import BatchShare, StepProgress
from symphys.cli.wording import batch_words, percent, step_words, time_words, use_words
from symphys.solvers import CmaOptions, TraceRow
from symphys.solvers.core.budget import BudgetUse


class Job:
    """As much of a job as progress needs."""

    options = CmaOptions(evaluations=400)
    examine = False

    class problem:
        class simulation:
            smoothing = (0.0,)

    def __init__(self, seed: int = 0) -> None:
        self.name = f"throw cma seed {seed}"


class Clock:
    """A time that a test moves on."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    for module in (plain_lines, batch_progress):
        monkeypatch.setattr(module, "monotonic", made)
    return made


def row(iteration: int, rollouts: int, seconds: float, outputs: dict[str, float] | None = None) -> TraceRow:
    nan = math.nan
    return TraceRow(iteration, rollouts, 0, 0, 0, seconds, 2.0, 1.0, 0.5, nan, nan, 0.0, outputs or {})


def test_times_to_wait_are_rounded_up() -> None:
    assert [time_words(s) for s in (0, 0.2, 99.5, 101, 6000, 9000)] == [
        "0 s",
        "1 s",
        "100 s",
        "2 min",
        "100 min",
        "2.5 h",
    ]


def test_nothing_is_called_done_that_is_not() -> None:
    assert [percent(share) for share in (0, 0.29, 0.999, 1)] == ["0 %", "29 %", "99 %", "100 %"]


def test_a_run_says_its_share_and_the_time_left_at_most() -> None:
    use = BudgetUse(CmaOptions(evaluations=400), (0.0,))
    assert use_words(use) == "0 % of its budget"
    use.add(row(0, 40, 1.0))
    use.add(row(2, 120, 5.0))
    assert use_words(use) == "30 % of its budget, at most 14 s of solving left"
    assert use_words(BudgetUse(object(), (0.0,))) == ""


def test_a_batch_counts_the_shares_of_runs_in_work_and_no_time_for_what_was_done(clock: Clock) -> None:
    batch, jobs = BatchShare(5), [Job(k) for k in range(5)]
    batch.ended(jobs[0], skipped=True)  # type: ignore[arg-type]
    assert batch_words(batch) == "1 of 5 runs done, 20 % of all"
    batch.started(jobs[1])  # type: ignore[arg-type]
    clock.now += 10
    batch.ended(jobs[1], skipped=False)  # type: ignore[arg-type]
    assert batch_words(batch) == "2 of 5 runs done, 40 % of all, about 30 s left"
    batch.advanced(jobs[2], row(0, 200, 5.0))  # type: ignore[arg-type]
    clock.now += 5
    assert batch_words(batch) == "2 of 5 runs done, 50 % of all, about 25 s left"


def test_solving_and_judging_of_an_examined_run_are_halves() -> None:
    batch, job = BatchShare(2), Job()
    job.examine = True
    batch.advanced(job, row(0, 200, 5.0))  # type: ignore[arg-type]
    assert batch.share == 0.125
    batch.judging(job, "rolling it out exactly")  # type: ignore[arg-type]
    assert batch.share == 0.25
    steps = batch.judging(job, "comparing the gradient with differences")  # type: ignore[arg-type]
    assert 0 < steps.share < 0.1 and batch.share == 0.25 + steps.share / 4


def test_runs_without_news_say_what_they_are_at(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    plain, job = Plain(5.0), Job()
    plain.started(job, resumed=False)  # type: ignore[arg-type]
    clock.now += 3
    plain.beat()
    clock.now += 4
    plain.beat()
    plain.advanced(job, row(0, 40, 1.0))  # type: ignore[arg-type]
    clock.now += 6
    plain.beat()
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "throw cma seed 0: begins"
    assert lines[1] == "throw cma seed 0: building and compiling for 7 s"
    assert lines[2] == "throw cma seed 0: no new iteration for 6 s; iteration 0, objective 1 (now 2), worst 0.5"
    assert len(lines) == 3


def test_judging_says_its_parts_and_their_share(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    plain, job = Plain(5.0), Job()
    plain.advanced(job, row(0, 40, 1.0))  # type: ignore[arg-type]
    plain.judging(job, "rolling it out exactly")  # type: ignore[arg-type]
    plain.judging(job, "simulating")  # type: ignore[arg-type]
    clock.now += 6
    plain.beat()
    plain.judging(job, "comparing the gradient with differences")  # type: ignore[arg-type]
    clock.now += 6
    plain.beat()
    plain.batch.ended(job, skipped=False)  # type: ignore[arg-type]
    clock.now += 6
    plain.beat()
    lines = capsys.readouterr().err.splitlines()
    judging = "throw cma seed 0: judging what it found"
    assert lines[0] == f"{judging}: simulating: 0 % done"
    assert lines[1].startswith(f"{judging}: comparing the gradient with differences: 5 % done, about ")
    assert len(lines) == 2


def test_plain_lines_say_share_and_time(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    plain, job = Plain(0.0, runs=2), Job()
    plain.advanced(job, row(0, 40, 1.0))  # type: ignore[arg-type]
    plain.advanced(job, row(2, 120, 5.0))  # type: ignore[arg-type]
    line = capsys.readouterr().err.splitlines()[1]
    assert line == (
        "throw cma seed 0: iteration 2, objective 1 (now 2), worst 0.5; 30 % of its budget, at most 14 s of solving "
        "left; 0 of 2 runs done, 15 % of all"
    )


def test_live_lines_are_wrapped_and_not_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    buffer = io.StringIO()

    def console(**given: Any) -> Console:
        return Console(file=buffer, force_terminal=True, width=80, color_system=None)

    monkeypatch.setattr("symphys.cli.watching.observers.Console", console)
    outputs = {"height of the hand [m]": 1.25, "speed of the ball [m/s]": 12.5}
    with watch(1) as live:
        live.started(Job(), resumed=False)  # type: ignore[arg-type]
        live.advanced(Job(), row(0, 40, 1.0))  # type: ignore[arg-type]
        live.advanced(Job(), row(2, 120, 5.0, outputs))  # type: ignore[arg-type]
        live.progress.refresh()
    shown = " ".join(buffer.getvalue().split())
    assert "…" not in shown and "at most 14 s of solving left" in shown
    assert "speed of the ball 12.5 m/s" in shown.replace("━", "").replace("  ", " ")


def test_steps_say_what_is_done_and_the_time_at_the_pace_so_far(clock: Clock) -> None:
    steps = StepProgress({"one": 1.0, "two": 3.0, "three": 4.0})
    steps.tell("one")
    assert step_words(steps) == "one: 0 % done"
    clock.now += 2
    steps.tell("two")
    assert step_words(steps) == "two: 12 % done, about 14 s left"
    clock.now += 5
    assert step_words(steps) == "two: 12 % done, about 9 s left"
    clock.now += 5
    assert step_words(steps) == "two: 12 % done, about 8 s left", "no less than the parts that are not begun take"
    steps.tell("words of no part")
    assert steps.share == 1 / 8
    steps.tell("three")
    assert steps.share == 4 / 8 and steps.seconds_left == 12.0


def test_a_heartbeat_ends_with_its_body() -> None:
    beats: list[threading.Thread] = []
    with heartbeat(lambda: beats.append(threading.current_thread()), 0.01):
        until(lambda: len(beats) >= 3)
    assert len(set(beats)) == 1 and not beats[0].is_alive()


def test_work_without_a_terminal_says_now_and_then_where_it_is(
    clock: Clock, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It beats when the test does."""
    beats: list[Callable[[], None]] = []

    @contextmanager
    def by_hand(beat: Callable[[], None], every: float) -> Iterator[None]:
        beats.append(beat)
        yield

    monkeypatch.setattr(heartbeats, "heartbeat", by_hand)
    with working("check throw", {"one": 1.0, "two": 1.0}) as tell:
        tell("one")
        clock.now += 5
        tell("two")
        beats[0]()
    assert capsys.readouterr().err == "check throw: two: 50 % done, about 5 s left\n"
