"""Batches on real engines: the same results to the bit, and a worker that is killed costs its own run only."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.waiting import FOREVER

from symphys.batches import BatchLimits, following, run_batch, run_on
from symphys.problem import load_problem
from symphys.results.result import read_result
from symphys.runs import Job, make_jobs
from symphys.transcription import transcribe

MARKING = """
import os, signal
from pathlib import Path
from symphys.transcription import transcribe as honest

FOLDER = Path(__file__).parent

def transcribe(problem, exact=False):
    (FOLDER / f"{problem.name}.{os.getpid()}").touch()
    if problem.name.startswith("killed"):
        if len(list(FOLDER.glob(f"{problem.name}.*"))) <= int(problem.name.removeprefix("killed")):
            os.kill(os.getpid(), signal.SIGKILL)
    return honest(problem)
"""
"""Leaves a mark for each process that builds a problem; kills it the first N times for a problem killedN."""


@pytest.fixture
def marking(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    folder = tmp_path / "marking"
    folder.mkdir()
    (folder / "marking_transcription.py").write_text(MARKING, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(folder), os.environ.get("PYTHONPATH", ""))))
    importlib.invalidate_caches()
    return importlib.reload(importlib.import_module("marking_transcription"))


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drivers are waited for, however long they take to start and to end."""
    monkeypatch.setattr(following, "GRACE_TIME", FOREVER)
    if find_spec("distributed"):
        monkeypatch.setattr("symphys.batches.engines.dask.TIMEOUT", FOREVER)


@pytest.fixture
def make(problem_file: Path, tmp_path: Path) -> Callable[..., list[Job]]:
    """Jobs of least squares, a seed each, for problems of these names."""

    def jobs(*names: str, out: str = "out") -> list[Job]:
        for name in names:
            problem_file.with_name(f"{name}.toml").write_text(problem_file.read_text(encoding="utf-8"), "utf-8")
        problems = [load_problem(problem_file.with_name(f"{name}.toml")) for name in names]
        return make_jobs(problems, ["least_squares"], [1], {}, tmp_path / out, examine=False)

    return jobs


def marks(folder: Path, name: str) -> int:
    """How many processes built the problem."""
    return len(list((folder / "marking").glob(f"{name}.*")))


def check_same(one: Job, other: Job) -> None:
    """The results and the motions of two runs are equal to the bit."""
    first, second = (read_result(job.folder.path / "result.json") for job in (one, other))
    assert (first.z, first.counts, first.iterations) == (second.z, second.counts, second.iterations)
    motions = [np.load(job.folder.path / "trajectory.npz") for job in (one, other)]
    assert motions[0].files == motions[1].files
    assert all(motions[0][name].tobytes() == motions[1][name].tobytes() for name in motions[0].files)


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_a_killed_dask_worker_costs_its_own_run_only(marking: Any, make: Any, recorder: Any, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    names = ["one", "two", "killed1", "three"]
    jobs = make(*names)
    batch = run_on("dask", "", jobs, 2, recorder, marking.transcribe, tmp_path / "out")
    assert batch.accepted
    assert [marks(tmp_path, name) for name in names] == [1, 1, 2, 1]
    assert "a driver ended: its dask worker died" in recorder.notes
    here = make(*names, out="here")
    assert run_batch(here, 1, recorder, transcribe).accepted
    for one, other in zip(jobs, here, strict=True):
        check_same(one, other)


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_runs_with_a_timeout_are_possible_on_dask(marking: Any, make: Any, recorder: Any, tmp_path: Path) -> None:
    """A run with a timeout has a process of its own, which workers of a local cluster may start."""
    pytest.importorskip("distributed")
    limits = BatchLimits(timeout=1e6)
    batch = run_on("dask", "", make("fine"), 1, recorder, marking.transcribe, tmp_path / "out", limits)
    assert batch.accepted and marks(tmp_path, "fine") == 1


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_submitted_jobs_give_the_same_results(marking: Any, make: Any, recorder: Any, tmp_path: Path) -> None:
    pytest.importorskip("submitit")
    jobs, here = make("one", "killed1"), make("one", "killed1", out="here")
    batch = run_on("slurm", "local", jobs, 2, recorder, marking.transcribe, tmp_path / "out")
    assert batch.accepted and [marks(tmp_path, name) for name in ("one", "killed1")] == [1, 2]
    assert run_batch(here, 1, recorder, transcribe).accepted
    for one, other in zip(jobs, here, strict=True):
        check_same(one, other)


@pytest.mark.parametrize(
    ("scheduler", "said"),
    [
        ("partitoin=short", 'did you mean "partition"'),
        ("short", "write local, or KEY=VALUE"),
        ("local,timeout_min=soon", "timeout_min is a number"),
    ],
)
def test_what_slurm_cannot_be_asked_for_is_named(scheduler: str, said: str) -> None:
    pytest.importorskip("submitit")
    from symphys.batches.engines.slurm import read_request

    with pytest.raises(Exception, match=said):
        read_request(scheduler)


def test_what_slurm_is_asked_for_has_types() -> None:
    pytest.importorskip("submitit")
    from symphys.batches.engines.slurm import read_request

    asked = {"partition": "short", "timeout_min": 60, "mem_gb": 4.0}
    assert read_request("partition=short, timeout_min=60,mem_gb=4") == (False, asked)
    assert read_request("local") == (True, {})


def test_a_machine_without_slurm_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("submitit")
    from symphys.batches.engines import EngineError, open_engine

    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(EngineError, match="sbatch"):
        open_engine("slurm", "", 1, tmp_path)


def test_slurm_is_asked_for_what_was_said(monkeypatch: pytest.MonkeyPatch, make: Any, tmp_path: Path) -> None:
    """A stand-in for Slurm keeps the script of the job, and what is cancelled at the end."""
    pytest.importorskip("submitit")
    from symphys.batches.engines import EngineError, open_engine
    from symphys.batches.engines.driver import Board, DriverTask

    tools = {"sbatch": 'cp "$1" ../asked; echo Submitted batch job 7', "scancel": 'echo "$@" > CANCELLED', "srun": ""}
    for name, does in tools.items():
        does = does.replace("../asked", f"{tmp_path}/asked").replace("CANCELLED", f"{tmp_path}/cancelled")
        (tmp_path / name).write_text(f"#!/bin/sh\n{does}\n", "utf-8")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", os.pathsep.join((str(tmp_path), os.environ["PATH"])))
    engine = open_engine("slurm", "partition=short,mem_gb=4,timeout_min=90", 1, tmp_path / "out")
    task = DriverTask(Board.create(tmp_path / "out"), tuple(make("one")), transcribe, BatchLimits())
    engine.start(task)
    script = (tmp_path / "asked").read_text("utf-8")
    wanted = ("--partition=short", "--mem=4GB", "--time=90", "--job-name=symphys", "--cpus-per-task=1")
    assert [each for each in wanted if each not in script] == []
    engine.close()
    assert "7" in (tmp_path / "cancelled").read_text("utf-8")
    (tmp_path / "sbatch").write_text("#!/bin/sh\necho 'invalid partition' >&2; exit 1\n", "utf-8")
    with pytest.raises(EngineError, match=r"Slurm .*invalid partition"):
        engine.start(task)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    from symphys.batches.engines import EngineError, dask, open_engine

    monkeypatch.setattr(dask, "TIMEOUT", 0.2)
    with pytest.raises(EngineError, match=r"tcp://127\.0\.0\.1:1"):
        open_engine("dask", "tcp://127.0.0.1:1", 1, tmp_path)
