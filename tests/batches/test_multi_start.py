"""Seeds solved side by side are the runs that they would be alone."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from symphys.batches import run_batch
from symphys.batches.batch import groups
from symphys.problem import load_problem
from symphys.runs import Job, make_jobs
from symphys.solvers import TraceRow
from symphys.transcription import transcribe

SOLVERS = ("gradient", "least_squares", "cma")


def jobs_of(problem_file: Path, out: Path, seeds: int = 4) -> list[Job]:
    settings = {"variable.0.spread": 0.2}
    return make_jobs([load_problem(problem_file, settings)], SOLVERS, range(seeds), settings, out)


@pytest.mark.slow
def test_results_are_those_of_one_after_another(problem_file: Path, tmp_path: Path, recorder: Any) -> None:
    alone = run_batch(jobs_of(problem_file, tmp_path / "a"), 1, recorder, transcribe)
    beside = run_batch(jobs_of(problem_file, tmp_path / "b"), 1, recorder, transcribe, multi_start=True)
    assert alone.accepted and beside.accepted
    for one, other in zip(alone.results, beside.results, strict=True):
        assert one is not None and other is not None
        assert (one.seed, one.solver, one.z, one.counts) == (other.seed, other.solver, other.z, other.counts)
    log = (tmp_path / "b" / "short_throw@variable.0.spread=0.2" / "gradient-seed1" / "log.txt").read_text(
        encoding="utf-8"
    )
    assert "side by side" in log


def test_only_fresh_seeds_of_one_threaded_solver_form_a_group(problem_file: Path, tmp_path: Path) -> None:
    jobs = dict(enumerate(jobs_of(problem_file, tmp_path)))
    assert groups(jobs, halfway=()) == [[0, 1, 2, 3], [4, 5, 6, 7], [8], [9], [10], [11]]
    assert groups(jobs, halfway={1}) == [[0], [1], [2, 3], [4, 5, 6, 7], [8], [9], [10], [11]]


@pytest.mark.slow
def test_ctrl_c_loses_nothing(problem_file: Path, tmp_path: Path, recorder: Any) -> None:
    whole = run_batch(jobs_of(problem_file, tmp_path / "whole"), 1, recorder, transcribe)
    told = recorder.advanced

    def press(job: Job, row: TraceRow) -> None:
        if row.iteration == 1:
            os.kill(os.getpid(), signal.SIGINT)

    recorder.advanced = press
    broken = run_batch(jobs_of(problem_file, tmp_path / "broken"), 1, recorder, transcribe, multi_start=True)
    assert broken.interrupted
    recorder.advanced = told
    rest = run_batch(jobs_of(problem_file, tmp_path / "broken"), 1, recorder, transcribe, multi_start=True)
    assert rest.accepted
    for one, other in zip(whole.results, rest.results, strict=True):
        assert one is not None and other is not None
        assert (one.z, one.counts) == (other.z, other.counts)


@pytest.mark.slow
def test_one_that_fails_spoils_no_other(
    problem_file: Path, tmp_path: Path, recorder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any) -> Any:
        raise RuntimeError("out of order")

    monkeypatch.setattr("symphys.batches.batch.solve_multi_start", broken)
    batch = run_batch(jobs_of(problem_file, tmp_path), 1, recorder, transcribe, multi_start=True)
    assert batch.accepted
