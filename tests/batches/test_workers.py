"""Workers that die, hang or do not start cost the run that they are at, at most, and that is tried again."""

from __future__ import annotations

import importlib
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from tools.waiting import FOREVER

from symphys.batches import BatchLimits, limits, run_batch
from symphys.batches import pool as pools
from symphys.problem import load_problem
from symphys.results.result import read_result
from symphys.runs import Job, make_jobs
from symphys.runs.claim import claimed
from symphys.runs.execute import TranscriptionCache, with_claim
from symphys.transcription import transcribe

HURT = """
import os, signal
from pathlib import Path
from symphys.transcription import transcribe as honest

FOLDER = Path(__file__).parent

def transcribe(problem, exact=False):
    if problem.name.startswith("killed"):
        mark = FOLDER / f"{problem.name}.{os.getpid()}"
        mark.touch()
        if len(list(FOLDER.glob(f"{problem.name}.*"))) <= int(problem.name.removeprefix("killed")):
            os.kill(os.getpid(), signal.SIGKILL)
    return honest(problem)

def serve(*_):
    os._exit(3)
"""
"""Kills its process the first N times that a problem killedN is built."""


@pytest.fixture
def hurt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    folder = tmp_path / "hurt"
    folder.mkdir()
    (folder / "hurt_transcription.py").write_text(HURT, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    importlib.invalidate_caches()
    return importlib.reload(importlib.import_module("hurt_transcription"))


@pytest.fixture
def make(problem_file: Path, tmp_path: Path) -> Callable[..., list[Job]]:
    """Unexamined jobs of least squares for problems of these names."""

    def jobs(*names: str, seeds: int = 1) -> list[Job]:
        for name in names:
            problem_file.with_name(f"{name}.toml").write_text(problem_file.read_text(encoding="utf-8"), "utf-8")
        problems = [load_problem(problem_file.with_name(f"{name}.toml")) for name in names]
        return make_jobs(problems, ["least_squares"], range(seeds), {}, tmp_path / "out", examine=False)

    return jobs


@pytest.mark.slow
def test_one_that_kills_its_process_each_time_fails_and_the_same_command_tries_it_again(
    hurt: ModuleType, make: Any, recorder: Any
) -> None:
    """Every run that was asked for is in the result; the other problem's are done."""
    jobs = make("killed3", "fine", seeds=2)
    batch = run_batch(jobs, 2, recorder, hurt.transcribe)
    assert [result and result.problem for result in batch.results] == ["killed3", "killed3", "fine", "fine"]
    lost = [result for result in batch.results if result and result.status == "failed"]
    assert len(lost) == 1 and lost[0].again and "SIGKILL" in lost[0].advice
    kept = read_result(jobs[lost[0].seed].folder.path / "result.json")
    assert (kept.status, kept.again) == ("failed", True)
    assert run_batch(jobs, 2, recorder, hurt.transcribe).accepted


@pytest.mark.slow
def test_retries_are_as_many_as_asked_for(hurt: ModuleType, make: Any, recorder: Any) -> None:
    batch = run_batch(make("killed3", "fine"), 2, recorder, hurt.transcribe, limits=BatchLimits(retries=3))
    assert batch.accepted
    assert len([note for note in recorder.notes if "tried again, as its process died of SIGKILL" in note]) == 3


def test_a_run_that_fails_by_itself_is_tried_again_only_where_that_is_asked_for(
    make_job: Callable[..., Job], recorder: Any
) -> None:
    job = make_job(0, does="break")
    run_batch([job], 1, recorder, transcribe)
    assert recorder.counted("started") == 1
    run_batch([job], 1, recorder, transcribe)
    assert recorder.counted("started") == 1
    run_batch([job], 1, recorder, transcribe, rerun="failed")
    assert recorder.counted("started") == 2
    run_batch([job], 1, recorder, transcribe, limits=BatchLimits(retries=2), rerun="failed")
    assert recorder.counted("started") == 5


def test_everything_is_done_again_where_that_is_asked_for_and_once(make_job: Callable[..., Job], recorder: Any) -> None:
    jobs = [make_job(seed) for seed in range(2)]
    run_batch(jobs, 1, recorder, transcribe)
    batch = run_batch(jobs, 1, recorder, transcribe, rerun="all")
    assert batch.accepted and recorder.counted("started") == 4


@pytest.mark.slow
def test_workers_that_do_not_start_leave_the_work_to_this_process(
    hurt: ModuleType, make: Any, recorder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools, "serve", hurt.serve)
    batch = run_batch(make("one", "two"), 2, recorder, transcribe)
    assert batch.accepted
    assert len([note for note in recorder.notes if "do not start: the last died with exit code 3" in note]) == 1


def test_the_time_of_a_batch_ends_it_in_good_order(
    make_job: Callable[..., Job], recorder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where its runs are in this process, after an iteration; the clock goes on by one second with each."""
    jobs = [make_job(seed, iterations=5) for seed in range(2)]
    seconds: list[object] = []
    monkeypatch.setattr(limits, "monotonic", lambda: len(seconds))
    recorder.advanced = lambda *row: seconds.append(row)
    batch = run_batch(jobs, 1, recorder, transcribe, multi_start=True, limits=BatchLimits(budget=1.5))
    assert (batch.spent, batch.interrupted, batch.accepted) == (True, False, False)
    first, second = batch.results
    assert first and first.interrupted and "1.5 s of the batch" in first.advice and second is None
    del recorder.advanced
    assert run_batch(jobs, 1, recorder, transcribe).accepted


def test_a_folder_that_cannot_be_written_fails_its_run_alone(make_job: Callable[..., Job], recorder: Any) -> None:
    jobs = [make_job(seed) for seed in range(2)]
    jobs[0].folder.path.parent.mkdir(parents=True)
    jobs[0].folder.path.write_text("in the way", "utf-8")
    batch = run_batch(jobs, 1, recorder, transcribe)
    assert [result and result.status for result in batch.results] == ["failed", "met"]
    assert batch.results[0] and "cannot make the folder" in batch.results[0].advice


KILLED = """
import os, pickle, signal, sys
from symphys.batches import Observer, run_batch
from symphys.transcription import transcribe
import symphys.runs
execution = sys.modules["symphys.runs.execute"]
execution.CHECKPOINT_INTERVAL = execution.MIN_CHECKPOINT_SPACING = 0

class Killer(Observer):
    def advanced(self, job, row):
        if row.iteration == 1:
            os.kill(os.getpid(), signal.SIGKILL)

run_batch([pickle.loads(sys.stdin.buffer.read())], 1, Killer(), transcribe)
"""


@pytest.mark.slow
def test_a_killed_run_goes_on_from_its_checkpoint(make: Any, recorder: Any) -> None:
    """To the same end, to the bit, as if nothing had been."""
    (whole,), (job,) = make("whole"), make("broken")
    run_batch([whole], 1, recorder, transcribe)
    killed = subprocess.run([sys.executable, "-c", KILLED], input=pickle.dumps(job), check=False)
    assert killed.returncode == -signal.SIGKILL
    assert not (job.folder.path / "result.json").exists()
    (job.folder.path / ".trajectory.npz.4711-abc").write_bytes(b"half")
    recorder.events.clear()
    assert run_batch([job], 1, recorder, transcribe).accepted
    assert recorder.counted("resumed") == 1 and recorder.counted("started") == 0
    first, second = (read_result(each.folder.path / "result.json") for each in (whole, job))
    assert (first.z, first.counts, first.iterations) == (second.z, second.counts, second.iterations)
    assert not [path.name for path in job.folder.path.iterdir() if path.name.startswith(".")]


ORPHAN = """
import multiprocessing, pickle, sys
from symphys.batches.worker import Worker
from symphys.runs.execute import TranscriptionCache
from symphys.transcription import transcribe

ours, theirs = multiprocessing.Pipe()
ours.close()
Worker(theirs, TranscriptionCache(transcribe)).work(pickle.loads(sys.stdin.buffer.read()))
"""


def test_a_worker_whose_parent_has_gone_ends_and_calls_its_run_no_failure(make: Any) -> None:
    """The broken pipe is seen in the middle of the solver; the run is to be done by the next command."""
    (job,) = make("orphan")
    ended = subprocess.run([sys.executable, "-c", ORPHAN], input=pickle.dumps(job), capture_output=True, check=False)
    assert (ended.returncode, ended.stderr) == (1, b"")
    assert not (job.folder.path / "result.json").exists()


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2])
def test_runs_that_another_command_is_at_are_waited_for_and_taken_from_there(
    make: Any, recorder: Any, processes: int
) -> None:
    """It is said whom the command waits for; what it did not compute it has all the same."""
    jobs = make("ours", "theirs")
    other = type(recorder)()

    def work() -> None:
        with claimed(jobs[1].folder.path) as claim:
            held.set()
            waited.wait(FOREVER)
            with_claim(jobs[1], claim, lambda row: None, TranscriptionCache(transcribe))

    held, waited = threading.Event(), threading.Event()
    thread = threading.Thread(target=work)
    thread.start()
    held.wait(FOREVER)
    recorder.note = lambda text: (other.notes.append(text), waited.set())
    batch = run_batch(jobs, processes, recorder, transcribe)
    thread.join()
    assert batch.accepted
    assert other.notes[0].startswith("waiting for a run of another command: theirs least_squares seed 0 (process ")
    assert ("started", jobs[0].name) in recorder.events and ("skipped", jobs[1].name) in recorder.events
