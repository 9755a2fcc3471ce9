"""One run writes every file, is skipped when done, goes on when interrupted, and leaves no remains of another."""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import few

from symphys import files, solvers
from symphys.problem import load_problem
from symphys.runs import Job, Result, execute, make_jobs
from symphys.runs.claim import FolderBusy, claimed
from symphys.runs.execute import TranscriptionCache
from symphys.runs.inspection import inspect_run
from symphys.solvers import Outcome, Status, TraceRow
from symphys.transcription import transcribe

MakeJob = Callable[..., Job]


def silent(row: TraceRow) -> None:
    """Watch nothing."""


def run(job: Job, monitor: Callable[[TraceRow], None] = silent) -> Result:
    return execute(job, monitor, TranscriptionCache(transcribe))


def interrupt_at(iteration: int) -> Callable[[TraceRow], None]:
    def monitor(row: TraceRow) -> None:
        if row.iteration == iteration:
            raise KeyboardInterrupt

    return monitor


@pytest.mark.slow
def test_a_run_leaves_every_file(make_job: MakeJob) -> None:
    job = make_job(examine=True)
    result = run(job)
    names = {path.name for path in job.folder.path.iterdir()}
    assert names == {
        "problem.toml",
        "config.json",
        "result.json",
        "trajectory.npz",
        "scene.json",
        "guess.npz",
        "trace.csv",
        "log.txt",
    }
    assert inspect_run(job).result == result
    assert (job.folder.path / "problem.toml").read_text(encoding="utf-8") == job.problem.text


@pytest.mark.slow
def test_what_a_problem_tells_is_in_the_result_and_along_the_trace(problem_file: Path, tmp_path: Path) -> None:
    """Of the guess, of the best point so far, and of what was found."""
    output = '[[output]]\nname = "ahead"\nvalue = "ball.position[0]"\nunit = "m"\n'
    problem_file.write_text(problem_file.read_text(encoding="utf-8") + output, encoding="utf-8")
    (job,) = make_jobs([load_problem(problem_file)], ["gradient"], [0], {}, tmp_path / "out")
    rows: list[TraceRow] = []
    result = run(job, rows.append)
    assert result.outputs == {"ahead [m]": pytest.approx(0.5, abs=0.01)}
    assert result.guess and result.guess["output: ahead [m]"] == pytest.approx(0.2)
    with (job.folder.path / "trace.csv").open(encoding="utf-8") as file:
        column = [float(row["output: ahead [m]"]) for row in csv.DictReader(file)]
    assert column == [row.outputs["ahead [m]"] for row in rows]
    assert (column[0], column[-1]) == (pytest.approx(0.2), pytest.approx(0.5, abs=0.01))


def test_a_run_need_not_be_examined(make_job: MakeJob) -> None:
    """What is cheap is measured all the same, since the verdict rests on it."""
    result = run(make_job(examine=False))
    assert result.solved
    assert {"gained", "drift", "deepest", "residual", "passed"} <= result.trust.keys()
    assert not {"gradient", "refined", "growth"} & result.trust.keys()


@pytest.mark.slow
def test_what_is_met_by_a_motion_that_cannot_be_is_not_solved(problem_file: Path, tmp_path: Path) -> None:
    """What is varied is where the ball begins, and that is with its centre in the ground; examined or not."""
    text = problem_file.read_text(encoding="utf-8").replace('sets = "ball.velocity"', 'sets = "ball.position"')
    text = text.replace("guess = [1, 0, 0]", "guess = [0, 0, 1]").replace("- [0.5, 0]", "- [2.5, 0]")
    problem_file.write_text(text, encoding="utf-8")
    for examine in (True, False):
        (job,) = make_jobs([load_problem(problem_file)], ["told"], [0], {}, tmp_path / str(examine))
        result = run(replace(job, examine=examine))
        assert all(check.met for check in result.checks)
        assert (result.solved, result.accepted, result.verdict) == (False, False, "doubted")
        assert any("ball-ground" in doubt and "t = 0 s" in doubt for doubt in result.doubts), result.doubts
        assert inspect_run(job).result == result


@pytest.mark.slow
@few(("status", "verdict"), [("budget", "best_found"), ("stalled", "best_found"), ("met", "solved")], 1)
def test_with_nothing_to_meet_only_a_stationary_point_is_solved(
    problem_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: str, verdict: str
) -> None:
    text = problem_file.read_text(encoding="utf-8")
    start, end = text.index("[[target]]"), text.index("[[cost]]")
    problem_file.write_text(text[:start] + text[end:].partition("[objective]")[0], encoding="utf-8")
    told = solvers.SOLVERS["told"]

    def ends(*given: Any, **more: Any) -> Outcome:
        return replace(told.solve(*given, **more), status=Status(status))

    monkeypatch.setitem(solvers.SOLVERS, "told", replace(told, solve=ends))
    (job,) = make_jobs([load_problem(problem_file)], ["told"], [0], {}, tmp_path / "out")
    result = run(job)
    assert (result.verdict, result.solved, result.accepted) == (verdict, verdict == "solved", True)


def test_the_result_is_that_of_the_exact_rollout(make_job: MakeJob) -> None:
    result = run(make_job())
    assert result.solved and result.status == "met"
    assert result.objective == pytest.approx(6.25e-4, abs=1e-9)
    assert result.costs == pytest.approx({"speed": 6.25e-4})
    assert result.checks[0].error == pytest.approx(0, abs=1e-9)
    assert result.z["throw"].to_json()["value"] == [2.5, 0, 0]
    assert result.z["throw"].to_json()["lower"] == [-10, -10, 0]
    assert result.z["throw"].to_json()["upper"] == [None] * 3
    assert result.counts == {"rollouts": 3, "gradients": 3, "jacobians": 0, "hessians": 0}
    assert result.price["gradient"] > 0
    assert result.equivalents == pytest.approx(3 + 3 * result.price["gradient"])


def test_motions_are_recorded(make_job: MakeJob) -> None:
    job = make_job()
    run(job)
    with np.load(job.folder.path / "trajectory.npz", allow_pickle=False) as motion:
        assert motion["position"].shape == (11, 1, 3)
        assert motion["position"][-1, 0, 0] == pytest.approx(0.5)
    with np.load(job.folder.path / "guess.npz", allow_pickle=False) as motion:
        assert motion["position"][-1, 0, 0] == pytest.approx(0.2)
    scene = files.read_json(job.folder.path / "scene.json")
    assert scene["bodies"] == [
        {"name": "ball", "mass": 1.0, "shapes": [{"kind": "sphere", "radius": 0.1, "centre": [0.0, 0.0, 0.0]}]}
    ]
    assert scene["planes"] == [{"name": "ground", "normal": [0.0, 0.0, 1.0], "offset": 0.0}]


def test_the_trace_has_a_row_per_iteration_with_its_work(make_job: MakeJob) -> None:
    job = make_job(iterations=4)
    result = run(job)
    with (job.folder.path / "trace.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["iteration"]) for row in rows] == [0, 1, 2, 3]
    assert float(rows[-1]["equivalents"]) == result.equivalents
    assert rows[0]["gradient_norm"] == "nan"


def test_what_a_solver_loads_is_no_part_of_its_time(make_job: MakeJob, monkeypatch: pytest.MonkeyPatch) -> None:
    prepared: list[float] = []
    honest = time.perf_counter
    monkeypatch.setattr(time, "perf_counter", lambda: honest() + sum(prepared))

    def prepare() -> None:
        prepared.append(1e6)

    monkeypatch.setitem(solvers.SOLVERS, "told", replace(solvers.SOLVERS["told"], prepare=prepare))
    result = run(make_job())
    assert len(prepared) == 1
    assert sum(result.seconds.values()) < 1e5


def test_a_run_that_misses_is_not_solved(make_job: MakeJob) -> None:
    result = run(make_job(does="miss"))
    assert not result.solved
    assert result.status == "budget"
    assert result.worst == pytest.approx(30)


def test_a_done_run_is_not_done_again(make_job: MakeJob) -> None:
    job = make_job()
    first = run(job)
    before = (job.folder.path / "result.json").stat().st_mtime_ns
    assert run(job, interrupt_at(0)) == first
    assert (job.folder.path / "result.json").stat().st_mtime_ns == before


def test_another_configuration_is_another_run(make_job: MakeJob) -> None:
    first = make_job()
    run(first)
    result = run(replace(make_job(iterations=7), folder=first.folder))
    assert result.iterations == 6


def test_an_interrupted_run_goes_on_where_it_stopped(make_job: MakeJob) -> None:
    job = make_job(iterations=6)
    stopped = run(job, interrupt_at(2))
    assert stopped.status == "interrupted" and not stopped.solved
    assert (job.folder.path / "checkpoint.json").exists()
    seen: list[int] = []
    result = run(job, lambda row: seen.append(row.iteration))
    assert seen == [3, 4, 5]
    assert result.solved
    assert not (job.folder.path / "checkpoint.json").exists()
    lines = (job.folder.path / "log.txt").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if not line.startswith("evaluated by")] == [
        "told to solve from 0",
        "told to solve from 3",
    ]
    assert result.seconds["solve"] > stopped.seconds["solve"]


def test_a_checkpoint_of_another_configuration_is_not_used(make_job: MakeJob) -> None:
    """Even where it lies in the same folder, as after the file was changed."""
    first = make_job(iterations=6)
    run(first, interrupt_at(2))
    seen: list[int] = []
    run(replace(make_job(iterations=5), folder=first.folder), lambda row: seen.append(row.iteration))
    assert seen == [0, 1, 2, 3, 4]


def throw(problem_file: Path, out: Path, **options: object) -> Job:
    """A job of gradient descent."""
    settings: dict[str, object] = {f"solver.gradient.{key}": value for key, value in options.items()}
    return make_jobs([load_problem(problem_file, settings)], ["gradient"], [0], settings, out)[0]


@pytest.mark.slow
def test_a_run_whose_time_is_up_is_over(problem_file: Path, tmp_path: Path) -> None:
    """As one whose iterations are used up: it is not done again, and one with more time begins afresh."""
    job = throw(problem_file, tmp_path / "out", max_seconds=1e-9)
    first = run(job)
    assert (first.status, first.verdict, first.iterations) == ("budget", "not_solved", 0)
    assert first.advice == "the time is used up: raise `max_seconds`"
    assert not (job.folder.path / "checkpoint.json").exists()
    assert "max_seconds" in (job.folder.path / "log.txt").read_text(encoding="utf-8")
    assert run(job, interrupt_at(0)) == first
    assert run(throw(problem_file, tmp_path / "out", max_seconds=1e6)).solved


@pytest.mark.slow
def test_an_interrupted_run_with_a_time_goes_on(problem_file: Path, tmp_path: Path) -> None:
    job = throw(problem_file, tmp_path / "out", max_seconds=1e6)
    stopped = run(job, interrupt_at(1))
    assert (stopped.status, stopped.iterations) == ("interrupted", 1)
    seen: list[int] = []
    assert run(job, lambda row: seen.append(row.iteration)).solved
    assert seen[0] == 2


@pytest.mark.slow
def test_what_an_interrupted_run_has_met_is_judged(problem_file: Path, tmp_path: Path) -> None:
    """It is solved as far as it got, and the same command goes on to the optimum."""
    settings: dict[str, object] = {"objective.stop": "converged"}
    problem = load_problem(problem_file, settings)
    job = make_jobs([problem], ["gradient"], [0], settings, tmp_path / "out")[0]

    def stop(row: TraceRow) -> None:
        if row.max_violation < 1:
            raise KeyboardInterrupt

    stopped = run(job, stop)
    assert (stopped.status, stopped.verdict) == ("interrupted", "solved")
    assert stopped.trust["refined"]
    after = run(job)
    assert (after.status, after.verdict) == ("converged", "solved")
    assert after.objective <= stopped.objective


def test_an_expected_failure_is_a_result_with_the_message(make_job: MakeJob) -> None:
    job = make_job(does="refuse")
    result = run(job)
    assert (result.status, result.solved, result.advice) == ("failed", False, "cannot do that")
    assert "Traceback" not in (job.folder.path / "log.txt").read_text(encoding="utf-8")
    assert inspect_run(job).result == result


def test_an_unexpected_failure_puts_its_traceback_into_the_log_only(make_job: MakeJob) -> None:
    job = make_job(does="break")
    result = run(job)
    assert result.status == "failed"
    assert "ZeroDivisionError" in result.advice and "Traceback" not in result.advice
    assert "Traceback" in (job.folder.path / "log.txt").read_text(encoding="utf-8")


def test_a_failure_leaves_nothing_of_an_earlier_success(make_job: MakeJob) -> None:
    job = make_job()
    run(job)
    run(replace(make_job(does="refuse"), folder=job.folder))
    assert {path.name for path in job.folder.path.iterdir()} == {
        "problem.toml",
        "config.json",
        "result.json",
        "log.txt",
    }


def test_a_folder_in_use_is_left_alone(make_job: MakeJob) -> None:
    job = make_job()
    with claimed(job.folder.path) as claim:
        with pytest.raises(FolderBusy, match=f"process {os.getpid()} on .* is working in"):
            run(job)
        assert list(job.folder.path.iterdir()) == [claim.path.parent]
    assert run(job).solved


@few("name", ["result.json", "config.json", "checkpoint.json"], 1)
def test_damaged_files_mean_a_fresh_start(make_job: MakeJob, name: str) -> None:
    job = make_job(iterations=4)
    run(job, interrupt_at(1))
    (job.folder.path / name).write_bytes(b"\x00junk")
    seen: list[int] = []
    assert run(job, lambda row: seen.append(row.iteration)).solved
    assert seen == [0, 1, 2, 3]


def test_a_folder_that_cannot_be_written_fails_its_run_and_nothing_else(make_job: MakeJob, tmp_path: Path) -> None:
    """The run is not over: it is done as soon as the folder can be written."""
    (tmp_path / "out").write_text("in the way")
    result = run(make_job())
    assert (result.status, result.again) == ("failed", True)
    assert "cannot make the folder" in result.advice
    (tmp_path / "out").unlink()
    assert run(make_job()).solved


def test_the_files_of_a_run_wait_for_the_disk_where_that_is_asked_for(
    make_job: MakeJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Contents before their names: what is done survives a power cut."""
    waited: list[int] = []
    whole = os.fsync

    def fsync(descriptor: int) -> None:
        waited.append(os.fstat(descriptor).st_ino)
        whole(descriptor)

    monkeypatch.setenv("SYMPHYS_FSYNC", "1")
    monkeypatch.setattr(os, "fsync", fsync)
    job = make_job()
    run(job)
    folder = job.folder.path
    for file in folder.iterdir():
        assert not file.is_file() or file.stat().st_ino in waited, file.name
    result = waited.index((folder / "result.json").stat().st_ino)
    assert folder.stat().st_ino in waited[result:], "the name of the result"
