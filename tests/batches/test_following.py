"""A batch on an engine: the front follows drivers, starts them again a bounded number of times, and stops them."""

from __future__ import annotations

import json
import shutil
import signal
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fakes.thread_engine import Threads
from tools.waiting import FOREVER, until

from symphys.batches import BatchLimits, BatchResult, following, limits, run_on
from symphys.batches.engines import EngineError, driver, open_engine
from symphys.batches.engines.driver import BEGUN, NOTE, OVER, Board, DriverTask, drive
from symphys.files import FileError
from symphys.runs import Job
from symphys.runs.claim import claimed
from symphys.transcription import transcribe

MakeJob = Callable[..., Job]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, recorder: Any) -> Callable[..., tuple[BatchResult, Threads]]:
    """Run jobs by two drivers of this process; and the engine."""
    monkeypatch.setattr(following, "MIN_POLL_INTERVAL", 0.01)
    monkeypatch.setattr(driver, "POLL_INTERVAL", 0.0)

    def made(jobs: list[Job], engine: Threads | None = None, **how: Any) -> tuple[BatchResult, Threads]:
        engine = engine or Threads()
        monkeypatch.setattr(following, "open_engine", lambda *_: engine)
        made_by = how.pop("transcribe", transcribe)
        return run_on("threads", "", jobs, 2, recorder, made_by, tmp_path / "out", **how), engine

    return made


def boards(folder: Path) -> list[Path]:
    return list((folder / "out").glob(".drivers-*"))


def test_all_is_done_and_reported_once_and_nothing_is_left_behind(
    run: Any, make_job: MakeJob, recorder: Any, tmp_path: Path
) -> None:
    jobs = [make_job(seed) for seed in range(4)] + [make_job(0, does="break")]
    batch, engine = run(jobs)
    assert [result.status for result in batch.results] == ["met"] * 4 + ["failed"]
    assert [result.seed for result in batch.results] == [0, 1, 2, 3, 0]
    assert (recorder.counted("started"), recorder.counted("met"), recorder.counted("failed")) == (5, 4, 1)
    assert engine.closed and engine.started == 2 and boards(tmp_path) == []
    again, engine = run(jobs)
    assert engine.started == 0 and again.results == batch.results
    assert recorder.counted("skipped") == 5


def test_what_is_over_is_done_again_where_that_is_asked_for_and_once(
    run: Any, make_job: MakeJob, recorder: Any
) -> None:
    jobs = [make_job(seed) for seed in range(3)]
    run(jobs)
    batch, _ = run(jobs, rerun="all")
    assert batch.accepted and recorder.counted("started") == 6


def test_a_run_that_fails_is_tried_again_by_its_driver_as_often_as_asked_for(
    run: Any, make_job: MakeJob, recorder: Any
) -> None:
    batch, _ = run([make_job(0, does="break"), make_job(1)], limits=BatchLimits(retries=2))
    assert [result.status for result in batch.results] == ["failed", "met"]
    assert len([note for note in recorder.notes if "tried again" in note]) == 2


def test_drivers_that_end_are_started_again_but_not_for_ever(run: Any, make_job: MakeJob, recorder: Any) -> None:
    batch, engine = run([make_job(seed) for seed in range(3)], Threads(stillborn=3))
    assert batch.accepted and engine.started in (4, 5)
    batch, engine = run([make_job(seed, iterations=4) for seed in range(3)], Threads(stillborn=1000))
    assert not batch.accepted and not batch.interrupted and batch.results == (None,) * 3
    assert engine.started == 2 * (following.MAX_ROUNDS + 1)
    assert "3 of 3 runs are not done; run the same command again" in recorder.notes[-1]
    assert [note for note in recorder.notes if note == "a driver ended: it was born dead"]


def test_ctrl_c_stops_drivers_where_they_can_go_on(run: Any, make_job: MakeJob, recorder: Any, tmp_path: Path) -> None:
    """The run that was at work is kept halfway, the others are not begun, and the same call goes on."""
    jobs = [make_job(seed, iterations=5) for seed in range(3)]
    stopped = threading.Event()

    def slow(problem: Any, exact: bool) -> Any:
        stopped.wait(FOREVER)
        until(lambda: (boards(tmp_path)[0] / "stop").exists())
        return transcribe(problem, exact)

    told = recorder.started

    def press(job: Job, resumed: bool) -> None:
        told(job, resumed)
        signal.raise_signal(signal.SIGINT)
        stopped.set()

    recorder.started = press
    batch, _ = run(jobs, transcribe=slow)
    assert batch.interrupted and sorted(str(each and each.status) for each in batch.results) == [
        "None",
        "None",
        "interrupted",
    ]
    recorder.started, recorder.events = told, []
    rest, _ = run(jobs)
    assert rest.accepted and (recorder.counted("resumed"), recorder.counted("started")) == (1, 2)


def test_the_time_of_a_batch_ends_it(
    run: Any, make_job: MakeJob, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time is up as soon as a run has begun."""
    begun: list[object] = []
    monkeypatch.setattr(limits, "monotonic", lambda: len(begun))

    def slow(problem: Any, exact: bool) -> Any:
        begun.append(problem)
        until(lambda: (boards(tmp_path)[0] / "stop").exists())
        return transcribe(problem, exact)

    jobs = [make_job(seed, iterations=5) for seed in range(2)]
    batch, _ = run(jobs, transcribe=slow, limits=BatchLimits(budget=0.5))
    assert (batch.spent, batch.interrupted) == (True, False)
    (halfway,) = [result for result in batch.results if result]
    assert halfway.interrupted and "0.5 s of the batch are used up" in halfway.advice


def test_a_run_that_kills_its_drivers_is_given_up_and_the_same_command_tries_it_again(
    run: Any, make_job: MakeJob, recorder: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Claims of two processes that have died are seen on it; no third driver takes it up."""
    jobs = [make_job(seed) for seed in range(2)]
    deaths = iter(("first", "second"))
    folder = jobs[0].folder.path
    folder.mkdir(parents=True)

    class Dying(Threads):
        def work(self, task: DriverTask, stillborn: bool) -> None:
            death = next(deaths, None)
            if death is None:
                drive(task)
                return
            index = [job.folder.path for job in task.jobs].index(folder)
            claim = {"host": "far", "machine": "another", "process": 7, "token": death}
            shutil.rmtree(folder / ".claim", ignore_errors=True)
            (folder / ".claim" / death).mkdir(parents=True)
            (folder / ".claim" / death / "owner").write_text(json.dumps(claim), "utf-8")
            task.board.tell(BEGUN, index, death)

    monkeypatch.setattr(following, "is_over", lambda path, owner: owner.token == "second")
    batch, _ = run(jobs[:1], Dying())
    (lost,) = batch.results
    assert lost.status == "failed" and lost.again and "process 7 on far died" in lost.advice
    shutil.rmtree(folder / ".claim")
    batch, _ = run(jobs)
    assert batch.accepted


def test_a_machine_that_does_not_see_the_folder_says_so(make_job: MakeJob, tmp_path: Path) -> None:
    board = Board.create(tmp_path / "out")
    task = DriverTask(board, (make_job(0),), transcribe, BatchLimits())
    shutil.rmtree(tmp_path / "out")
    with pytest.raises(FileError, match="out: "):
        drive(task)


def test_a_driver_that_begins_when_all_is_over_does_nothing(make_job: MakeJob, tmp_path: Path) -> None:
    job = make_job(0)
    board = Board.create(tmp_path / "out")
    board.remove()
    drive(DriverTask(board, (job,), transcribe, BatchLimits()))
    assert not job.folder.path.exists()


def test_a_run_of_another_command_is_waited_for(run: Any, make_job: MakeJob, recorder: Any) -> None:
    """It is released when the other run has ended."""
    jobs = [make_job(seed) for seed in range(2)]
    told = recorder.ended
    with ExitStack() as held:
        held.enter_context(claimed(jobs[0].folder.path))

        def ended(*news: Any, **more: Any) -> None:
            told(*news, **more)
            held.close()

        recorder.ended = ended
        batch, _ = run(jobs)
    assert batch.accepted and [each for each in recorder.events if each[0] == "met"] == [
        ("met", job.name) for job in reversed(jobs)
    ]


def test_news_come_once_and_damage_is_passed_over(tmp_path: Path) -> None:
    board = Board.create(tmp_path)
    board.tell(OVER, 3)
    board.tell(BEGUN, 3, "me")
    board.note("something")
    (board.path / "over.three").touch()
    found = [(news.what, news.index, news.by + news.text) for news in board.news()]
    assert found == [(NOTE, -1, "something"), (BEGUN, 3, "me"), (OVER, 3, "")]
    assert board.news() == []
    assert board.is_over(3) and not board.is_over(4)
    board.clear_done(3)
    assert not board.is_over(3) and not board.stopped
    board.stop("late")
    assert board.stopped and board.reason == "late"
    board.remove()
    assert board.stopped and board.news() == []


def test_a_driver_leaves_out_what_another_has_ended(make_job: MakeJob, tmp_path: Path) -> None:
    """Also a run that would be done again: one that was stopped after its timeout, say."""
    jobs = tuple(replace(make_job(seed)) for seed in range(3))
    board = Board.create(tmp_path / "out")
    board.tell(OVER, 1)
    drive(DriverTask(board, jobs, transcribe, BatchLimits(), first=2))
    assert [job.folder.path.exists() for job in jobs] == [True, False, True]


def test_engines_that_are_none_are_named(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=r"'dusk'.*dask"):
        open_engine("dusk", "", 1, tmp_path)


def test_a_package_that_is_missing_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(__import__("sys").modules, "symphys.batches.engines.dask", None)

    def missing(name: str) -> None:
        raise ModuleNotFoundError("No module named 'dask'", name="dask")

    monkeypatch.setattr("symphys.batches.engines.import_module", missing)
    with pytest.raises(EngineError, match=r"pip install '\.\[dask\]'"):
        open_engine("dask", "", 1, tmp_path)
