"""Each stage of smoothing is judged exactly, and a run goes on in whatever stage it stopped."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from tools.repeats import few, first

from symphys.batches import run_batch
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.results.result import StageRecord
from symphys.runs import Job, Result, execute, make_jobs, read_result
from symphys.runs.execute import TranscriptionCache
from symphys.solvers import TraceRow
from symphys.transcription import Transcription, transcribe

pytestmark = pytest.mark.slow

SMOOTHINGS = [0.1, 0.01, 0.0]


@cache
def transcribed(smoothing: tuple[float, ...]) -> Transcription:
    """The sled."""
    return transcribe(load_problem(find("sled"), {"simulation.smoothing": list(smoothing)}))


def once(problem: Problem, exact: bool) -> Transcription:
    """A transcription for every run of the same stages."""
    assert exact == (max(problem.simulation.smoothing) == 0)
    return transcribed(problem.simulation.smoothing)


def job(out: Path, smoothing: Any = (0.1, 0.01, 0.0), solver: str = "least_squares", seeds: int = 1) -> list[Job]:
    """Unexamined: stages are judged all the same."""
    settings: dict[str, object] = {"simulation.smoothing": list(smoothing)}
    made = make_jobs([load_problem(find("sled"), settings)], [solver], range(seeds), settings, out)
    return [replace(each, examine=False) for each in made]


def run(asked: Job, monitor: Callable[[TraceRow], None] = lambda row: None) -> Result:
    return execute(asked, monitor, TranscriptionCache(once))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Job, Result]:
    """A run of all stages."""
    (asked,) = job(tmp_path_factory.mktemp("whole"))
    return asked, run(asked)


def without_times(result: Result) -> list[StageRecord]:
    """The stages without what a clock has measured."""
    return [replace(stage, seconds=0.0, equivalents=0.0) for stage in result.stages]


@pytest.mark.slow
def test_each_stage_is_judged_exactly(whole: tuple[Job, Result], tmp_path: Path) -> None:
    (first,) = job(tmp_path, (0.1,))
    part, result = run(first), whole[1]
    assert [stage.smoothing for stage in result.stages] == SMOOTHINGS
    # the first stage alone is a run of its own, and the judge of runs says the same of it
    assert part.objective == part.stages[0].exact_objective == result.stages[0].exact_objective
    assert part.worst == part.stages[0].exact_worst == result.stages[0].exact_worst
    assert not part.solved and not result.stages[0].solved
    assert result.stages[0].exact_objective > 10 * result.stages[0].objective
    last = result.stages[-1]
    assert (last.exact_objective, last.exact_worst, last.solved) == (result.objective, result.worst, True)
    assert last.objective == pytest.approx(last.exact_objective, rel=1e-9)


@pytest.mark.slow
def test_the_work_of_the_stages_is_that_of_the_run(whole: tuple[Job, Result]) -> None:
    result = whole[1]
    for kind, count in result.counts.items():
        assert sum(stage.counts[kind] for stage in result.stages) == count
    assert sum(stage.equivalents for stage in result.stages) == pytest.approx(result.equivalents)
    assert sum(stage.seconds for stage in result.stages) <= result.seconds["solve"]


def test_what_the_guess_is_worth(whole: tuple[Job, Result]) -> None:
    """It does not move: 1.118 m from its place, 111.8 tolerances."""
    assert whole[1].guess == pytest.approx({"objective": 1.25, "worst": 111.8}, rel=1e-3)


def test_files_tell_of_the_stages(whole: tuple[Job, Result]) -> None:
    asked, result = whole
    assert read_result(asked.folder.path / "result.json") == result
    with (asked.folder.path / "trace.csv").open(encoding="utf-8", newline="") as file:
        smoothing = [float(row["smoothing"]) for row in csv.DictReader(file)]
    assert list(dict.fromkeys(smoothing)) == SMOOTHINGS
    log = (asked.folder.path / "log.txt").read_text(encoding="utf-8")
    assert "stage 2 of 3: smoothing 0.01" in log


@pytest.mark.slow
@few("smoothing", SMOOTHINGS, 1)
def test_interrupted_in_any_stage_it_goes_on_to_the_same_end(
    whole: tuple[Job, Result], tmp_path: Path, smoothing: float
) -> None:
    def press(row: TraceRow) -> None:
        if row.smoothing == smoothing:
            raise KeyboardInterrupt

    (broken,) = job(tmp_path)
    stopped, end = run(broken, press), whole[1]
    assert stopped.status == "interrupted"
    assert [stage.smoothing for stage in stopped.stages] == SMOOTHINGS[: SMOOTHINGS.index(smoothing) + 1]
    assert stopped.stages[-1].status == "interrupted"
    rest = run(broken)
    assert (rest.z, rest.counts, rest.iterations) == (end.z, end.counts, end.iterations)
    assert without_times(rest) == without_times(end)


@pytest.mark.slow
@first("seeds", [2, 3])
def test_side_by_side(tmp_path: Path, recorder: Any, seeds: int) -> None:
    alone = run_batch(job(tmp_path / "a", seeds=seeds), 1, recorder, once)
    beside = run_batch(job(tmp_path / "b", seeds=seeds), 1, recorder, once, multi_start=True)
    assert alone.accepted and beside.accepted
    for one, other in zip(alone.results, beside.results, strict=True):
        assert one is not None and other is not None
        assert (one.z, one.counts) == (other.z, other.counts)
        assert without_times(one) == without_times(other)


@pytest.mark.thorough
def test_what_only_the_smoothed_rollout_meets_has_advice(tmp_path: Path) -> None:
    (asked,) = job(tmp_path, (0.1,), "ipopt")
    result = run(asked)
    assert result.status == "met" and not result.solved
    assert "add a stage at 0" in result.advice


def test_the_kernel_has_the_smoothing_where_any_stage_turns_it(tmp_path: Path) -> None:
    assert [job(tmp_path, smoothing)[0].smooth for smoothing in ((0.0,), (0.1, 0.0), (0.1,))] == [False, True, True]
