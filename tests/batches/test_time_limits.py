"""A limit of time ends a run whatever it is at, and leaves what it has found; the same command goes on with it.

No test waits for a time: the clock of the limits counts how often it is read, and jumps once the run has come to where
it hangs for ever.
"""

from __future__ import annotations

import importlib
import itertools
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from tools.waiting import assert_gone, wait_for

from symphys.batches import BatchLimits, limits, pool, run_batch
from symphys.batches.pool import end_tree
from symphys.problem import load_problem
from symphys.results.result import Result, read_result
from symphys.results.trace import read_trace
from symphys.runs import Job, make_jobs

LONG = 1e6
"""[s]"""
HANGING = """
import os, re, subprocess, sys
from dataclasses import replace
from pathlib import Path
import symphys.runs
from symphys.solvers.core.driver import Driver
from symphys.transcription import transcribe as honest

MARK = Path(__file__).with_name("hangs")
# a checkpoint of each iteration, however long that takes
sys.modules["symphys.runs.execute"].MIN_CHECKPOINT_SPACING = 0

def hang(*_):
    # a call of compiled code that keeps the interpreter's lock, as casadi's do
    MARK.touch()
    re.match("(a+)+$", "a" * 64 + "b")

def compile_for_ever():
    shell = "sleep 100000 & echo $! > %s; touch %s; wait" % (MARK.with_name("compiler"), MARK)
    subprocess.run(["sh", "-c", shell], start_new_session=True)

def transcribe(problem, exact=False):
    at = os.environ.get("HANGS_AT")
    if at == "building":
        hang()
    if at == "compiling":
        compile_for_ever()
    if at == "solving":
        honestly = Driver.commit
        def commit(self, iteration):
            honestly(self, iteration)
            if self.rows == 3:
                hang()
        Driver.commit = commit
    if at == "judging":
        sys.modules["symphys.runs.execute"].judge = hang
    return honest(problem, backend="casadi")
"""


@pytest.fixture
def hanging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Transcribes, in this process and in workers, so that a run hangs where $HANGS_AT says; then time is up."""
    folder = tmp_path / "hanging"
    folder.mkdir()
    (folder / "hanging_transcription.py").write_text(HANGING, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    importlib.invalidate_caches()
    found = importlib.reload(importlib.import_module("hanging_transcription"))

    readings = itertools.count()

    def monotonic() -> float:
        return next(readings) + 10 * LONG * found.MARK.exists()

    monkeypatch.setattr(pool, "time", SimpleNamespace(monotonic=monotonic, sleep=time.sleep))
    monkeypatch.setattr(limits, "monotonic", monotonic)
    return found


@pytest.fixture
def job(problem_file: Path, tmp_path: Path) -> Job:
    """Takes some ten iterations."""
    return make_jobs([load_problem(problem_file)], ["gradient"], [0], {}, tmp_path / "out", examine=False)[0]


def limited(job: Job, recorder: Any, transcription: Callable[..., Any], bounds: BatchLimits) -> Result:
    """What comes of one run."""
    (result,) = run_batch([job], 1, recorder, transcription, limits=bounds).results
    assert result is not None
    return result


@few("at", ["building", "solving", "judging"], 1)
def test_a_run_that_hangs_for_ever_ends_with_its_best_point_and_goes_on(
    hanging: ModuleType, job: Job, recorder: Any, monkeypatch: pytest.MonkeyPatch, at: str
) -> None:
    """To the same answer, to the bit, as if nothing had been."""
    monkeypatch.setenv("HANGS_AT", at)
    ended = limited(job, recorder, hanging.transcribe, BatchLimits(timeout=LONG))
    assert (ended.status, ended.verdict, ended.again) == ("interrupted", "interrupted", False)
    assert "1e+06 s, its timeout; the same command goes on" in ended.advice
    kept = read_result(job.folder.path / "result.json")
    assert kept.interrupted and np.isnan(kept.objective)
    hanging.MARK.unlink()
    monkeypatch.delenv("HANGS_AT")
    whole = limited(job, recorder, hanging.transcribe, BatchLimits())
    (alone,) = make_jobs([job.problem], ["gradient"], [0], {}, job.folder.path / "alone", examine=False)
    (reference,) = run_batch([alone], 1, recorder, hanging.transcribe).results
    assert whole.solved and reference and whole.objective == reference.objective
    whole = read_result(job.folder.path / "result.json")
    assert (whole.z, whole.counts) == tuple(
        getattr(read_result(alone.folder.path / "result.json"), key) for key in ("z", "counts")
    )
    assert recorder.counted("resumed") == (at != "building")
    if at == "building":
        assert not kept.z
    if at == "solving":
        assert len(kept.z["throw"].value) == 3 and kept.iterations == 2
        assert not np.array_equal(kept.z["throw"].value, kept.z["throw"].guess), "the best point, not the first"
    if at == "judging":
        assert kept.z == whole.z


@pytest.mark.slow
def test_the_iterations_of_a_run_that_was_killed_are_kept(
    hanging: ModuleType, job: Job, recorder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HANGS_AT", "solving")
    ended = limited(job, recorder, hanging.transcribe, BatchLimits(budget=LONG))
    assert ended.interrupted and "1e+06 s of the batch" in ended.advice and "solving" in ended.advice
    trace = read_trace(job.folder.path / "trace.csv", [])
    assert trace["iteration"].tolist() == [0, 1, 2] and np.isfinite(trace["objective"]).all()


def test_compilers_end_with_the_run_that_they_are_for(
    hanging: ModuleType, job: Job, recorder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They lead groups of their own, and start processes themselves."""
    monkeypatch.setenv("HANGS_AT", "compiling")
    ended = limited(job, recorder, hanging.transcribe, BatchLimits(timeout=LONG))
    assert ended.interrupted and "building and compiling" in ended.advice
    assert_gone(hanging.MARK.with_name("compiler"))


@pytest.mark.skipif(sys.platform == "win32", reason="processes are ended, their descendants are not known")
def test_a_tree_of_processes_ends_to_its_leaves(tmp_path: Path) -> None:
    shell = f"setsid sh -c 'sleep 100000 & echo $! > {tmp_path}/leaf; wait' & wait"
    with subprocess.Popen(["sh", "-c", shell]) as root:
        leaf = tmp_path / "leaf"
        wait_for(leaf)
        end_tree(root.pid)
        assert root.wait() == -signal.SIGKILL
    assert_gone(leaf)
