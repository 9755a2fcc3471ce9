"""Runs of a batch keep their order, survive failures of others and go on after an interruption, in workers too."""

from __future__ import annotations

import copy
import importlib
import multiprocessing
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from tools.waiting import FOREVER

from symphys.batches import run_batch
from symphys.problem import Problem, load_problem
from symphys.runs import Job, make_jobs
from symphys.runs.choice import chosen
from symphys.runs.execute import JUDGING
from symphys.solvers import TraceRow
from symphys.transcription import transcribe
from symphys.verification.examination import PARTS
from symphys.verification.refinement import FINEST_DT, MORE_SWEEPS, TOLD

MakeJob = Callable[..., Job]

CRASHING = """
import os
from symphys.transcription import transcribe as honest

def transcribe(problem, exact=False):
    if problem.name == "fatal":
        os._exit(7)
    return honest(problem)
"""


def test_results_come_in_the_order_of_the_jobs(make_job: MakeJob, recorder: Any) -> None:
    jobs = [make_job(seed) for seed in range(3)]
    batch = run_batch(jobs, 1, recorder, transcribe)
    assert [result.seed for result in batch.results if result] == [0, 1, 2]
    assert batch.accepted and not batch.interrupted
    again = run_batch(jobs, 1, recorder, transcribe)
    assert again.results == batch.results
    assert [event for event, _ in recorder.events[-3:]] == ["skipped"] * 3


def test_the_judging_of_a_run_is_announced_by_its_parts(make_job: MakeJob, recorder: Any) -> None:
    """Those of an examination, in their order, with one refinement; a run that was done is not judged again."""
    job = make_job(0, examine=True)
    for _ in range(2):
        run_batch([job], 1, recorder, transcribe)
    left_out = [TOLD[what] for what in (FINEST_DT, MORE_SWEEPS)]
    assert recorder.parts == [(job.name, what) for what in (JUDGING, *PARTS) if what not in left_out]


def test_a_failing_run_stops_no_other(make_job: MakeJob, recorder: Any) -> None:
    batch = run_batch([make_job(0, does="break"), make_job(1)], 1, recorder, transcribe)
    assert [result.status for result in batch.results if result] == ["failed", "met"]
    assert not batch.accepted


def test_ctrl_c_stops_in_good_order_and_the_next_command_goes_on(make_job: MakeJob, recorder: Any) -> None:
    jobs = [make_job(seed, iterations=5) for seed in range(3)]
    told = recorder.advanced

    def press(job: Job, row: TraceRow) -> None:
        told(job, row)
        if job.config.seed == 1 and row.iteration == 1:
            signal.raise_signal(signal.SIGINT)

    recorder.advanced = press
    batch = run_batch(jobs, 1, recorder, transcribe)
    assert batch.interrupted and not batch.accepted
    assert [result and result.status for result in batch.results] == ["met", "interrupted", None]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler

    recorder.advanced, recorder.events = told, []
    rest = run_batch(jobs, 1, recorder, transcribe)
    assert rest.accepted
    starts = [event for event, _ in recorder.events if event in {"skipped", "resumed", "started"}]
    assert starts == ["skipped", "resumed", "started"]


def test_a_second_ctrl_c_stops_at_once(make_job: MakeJob, recorder: Any) -> None:
    def press_twice(job: Job, resumed: bool) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    recorder.started = press_twice
    with pytest.raises(KeyboardInterrupt):
        run_batch([make_job()], 1, recorder, transcribe)


@pytest.mark.slow
def test_a_transcription_is_made_once_per_problem(make_job: MakeJob, recorder: Any) -> None:
    made = []

    def counting(problem: Any, exact: bool) -> Any:
        made.append(problem.name)
        return transcribe(problem)

    run_batch([make_job(seed) for seed in range(3)], 1, recorder, counting)
    assert made == ["short_throw"]


def test_a_file_says_which_solvers_it_is_for(problem_file: Path, tmp_path: Path) -> None:
    """Where none is asked for; twice is once, in the file's order."""
    everything = make_jobs([load_problem(problem_file)], None, [0], {}, tmp_path)
    assert [job.config.solver for job in everything] == [each.solver for each in chosen(load_problem(problem_file))]
    assert all(job.chosen for job in everything)
    text = problem_file.read_text(encoding="utf-8")
    problem_file.write_text('solvers = ["gradient", "cma", "gradient"]\n' + text, encoding="utf-8")
    problem = load_problem(problem_file)
    assert [job.config.solver for job in make_jobs([problem], None, [0], {}, tmp_path)] == ["gradient", "cma"]
    named = make_jobs([problem], ["ipopt"], [0], {}, tmp_path)
    assert [(job.config.solver, job.chosen) for job in named] == [("ipopt", "")]


@pytest.mark.slow
def test_workers_do_what_one_process_does(problem_file: Path, tmp_path: Path, recorder: Any) -> None:
    problem = load_problem(problem_file)
    here = make_jobs([problem], ["gradient", "least_squares"], [0], {}, tmp_path / "here")
    there = make_jobs([problem], ["gradient", "least_squares"], [0], {}, tmp_path / "there")
    alone = run_batch(here, 1, recorder, transcribe)
    recorder.events.clear()
    together = run_batch(there, 2, recorder, transcribe)
    for a, b in zip(alone.results, together.results, strict=True):
        assert a is not None and b is not None
        assert (a.solver, a.status, a.z, a.counts) == (b.solver, b.status, b.z, b.counts)
    names = {job.name for job in there}
    assert {name for event, name in recorder.events if event == "started"} == names


@pytest.mark.slow
def test_a_job_survives_the_way_to_a_new_process_and_back(problem: Problem, tmp_path: Path) -> None:
    (job,) = make_jobs([problem], ["gradient"], [3], {"simulation.dt": 0.02}, tmp_path)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        back = pool.submit(copy.copy, job).result(FOREVER)
    assert (back.name, back.config, back.options, back.folder) == (job.name, job.config, job.options, job.folder)
    assert back.problem.targets == job.problem.targets
    z = np.array([1.0, 2.0, 3.0])
    values, expected = (transcribe(each.problem).shooting.evaluator.value(z[None], 0).errors for each in (back, job))
    assert np.array_equal(values, expected)


def test_a_process_that_dies_fails_its_own_run_only(
    problem_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recorder: Any
) -> None:
    (tmp_path / "crashing_transcription.py").write_text(CRASHING, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    crashing = importlib.import_module("crashing_transcription")
    fatal = problem_file.with_name("fatal.toml")
    fatal.write_text(problem_file.read_text(encoding="utf-8"), encoding="utf-8")
    problems = [load_problem(path) for path in (problem_file, fatal)]
    made = make_jobs(problems, ["least_squares"], [0, 1], {}, tmp_path / "out")
    jobs = [replace(job, examine=False) for job in made]
    batch = run_batch(jobs, 2, recorder, crashing.transcribe)
    ends = [(result.problem, result.status) for result in batch.results if result]
    assert ends == [("short_throw", "met")] * 2 + [("fatal", "failed")] * 2
    assert all("died" in result.advice for result in batch.results[2:] if result)


@pytest.mark.slow
@few("name", ["gradient", "least_squares", "ipopt", "cma"], 1)
def test_every_solver_goes_on_from_its_file_as_if_nothing_had_been(
    problem_file: Path, tmp_path: Path, recorder: Any, name: str
) -> None:
    problem = load_problem(problem_file)
    (whole,) = run_batch(make_jobs([problem], [name], [0], {}, tmp_path / "whole"), 1, recorder, transcribe).results
    jobs = make_jobs([problem], [name], [0], {}, tmp_path / "broken")
    told = recorder.advanced

    def press(job: Job, row: TraceRow) -> None:
        if row.iteration == 1:
            signal.raise_signal(signal.SIGINT)

    recorder.advanced = press
    assert run_batch(jobs, 1, recorder, transcribe).interrupted
    recorder.advanced = told
    (continued,) = run_batch(jobs, 1, recorder, transcribe).results
    assert whole is not None and continued is not None
    assert continued.solved
    if name != "ipopt":  # IPOPT starts anew from its best point
        assert (continued.z, continued.counts) == (whole.z, whole.counts)
