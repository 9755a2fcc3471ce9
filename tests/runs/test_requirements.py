"""What a machine lacks is refused before anything is built, by its name, and tried again by the same command."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fakes.compilers import fake

from symphys import solvers
from symphys.batches import run_batch
from symphys.cli import main
from symphys.codegen import KernelUnavailable
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.problem import load_problem
from symphys.runs import Job, Result, execute, make_jobs, read_result
from symphys.runs.execute import TranscriptionCache
from symphys.solvers import TraceRow
from symphys.transcription import Transcription, transcribe

Patch = pytest.MonkeyPatch
MASSES = '[[scenario]]\nname = "masses"\nsets = "ball.mass"\nfactor = 0.1\n'


@contextmanager
def without_compiler(folder: Path) -> Iterator[None]:
    """A machine that has none, as far as this process can tell."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", str(folder / "nothing"))
        patch.delenv("CC", raising=False)
        patch.setattr("importlib.util.find_spec", lambda name: None)
        yield


@pytest.fixture
def compiler() -> None:
    try:
        find_compiler()
    except KernelUnavailable as error:
        pytest.skip(str(error))


@pytest.fixture
def varied(problem_file: Path, tmp_path: Path, monkeypatch: Patch) -> Path:
    """The short throw with masses that differ; the told solver draws samples of them."""
    monkeypatch.setitem(solvers.SOLVERS, "told", replace(solvers.SOLVERS["told"], scenarios=True))
    path = tmp_path / "varied.toml"
    path.write_text(problem_file.read_text("utf-8") + MASSES, "utf-8")
    return path


def job_of(path: Path, tmp_path: Path, backend: str = "auto") -> Job:
    (job,) = make_jobs([load_problem(path)], ["told"], [0], {}, tmp_path / "out", "", backend, examine=False)
    return job


def silent(row: TraceRow) -> None:
    """Watch nothing."""


def unbuilt(job: Job) -> Transcription:
    raise AssertionError("something was built")


def run(job: Job, transcriptions: Callable[[Job], Transcription] | None = None) -> Result:
    return execute(job, silent, transcriptions or TranscriptionCache(transcribe))


def lacks(result: Result) -> bool:
    return (result.status, result.again, result.accepted) == ("failed", True, False)


def test_without_a_compiler_samples_are_refused_before_anything_is_built(varied: Path, tmp_path: Path) -> None:
    with without_compiler(tmp_path):
        job = job_of(varied, tmp_path)
        result = run(job, unbuilt)
    assert lacks(result)
    assert "no C compiler was found: install gcc or clang (or `pip install ziglang`)" in result.advice
    assert "samples of [[scenario]] tables" in result.advice
    assert read_result(job.folder.path / "result.json") == result


@pytest.mark.slow
def test_the_same_command_does_it_where_there_is_one(
    varied: Path, tmp_path: Path, compiler: None, recorder: Any
) -> None:
    job = job_of(varied, tmp_path)
    with without_compiler(tmp_path):
        assert not run_batch([job], 1, recorder, transcribe).accepted
    assert run_batch([job], 1, recorder, transcribe).accepted
    assert run_batch([job], 1, recorder, transcribe).accepted
    assert [event for event, _ in recorder.events if event != "advanced"] == [
        *("started", "failed", "started", "met", "skipped")
    ]


@pytest.mark.slow
def test_what_was_begun_goes_on_after_a_refusal(varied: Path, tmp_path: Path, compiler: None) -> None:
    """An interrupted run keeps its checkpoint on a machine that cannot go on with it."""
    job, seen = job_of(varied, tmp_path), list[int]()

    def stop(row: TraceRow) -> None:
        raise KeyboardInterrupt

    made = TranscriptionCache(transcribe)
    assert execute(job, stop, made).interrupted
    with without_compiler(tmp_path):
        assert lacks(run(job, unbuilt))
    assert execute(job, lambda row: seen.append(row.iteration), made).solved
    assert seen == [1, 2]
    assert not (job.folder.path / "checkpoint.json").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="the fake compiler is a shell script")
def test_a_compiler_that_fails_is_named(varied: Path, tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("CC", fake(tmp_path, "echo 'error: no header' >&2; exit 1"))
    result = run(job_of(varied, tmp_path))
    assert lacks(result)
    assert "fakecc failed with code 1: error: no header" in result.advice


def test_a_backend_that_cannot_draw_is_refused_for_good(varied: Path, tmp_path: Path) -> None:
    job = job_of(varied, tmp_path, "casadi")
    result = run(job, unbuilt)
    assert (result.status, result.again) == ("failed", False)
    assert "the backend casadi cannot evaluate: use auto, simd, simd32, cuda or cuda32" in result.advice
    assert run(job, unbuilt) == result


@pytest.mark.parametrize(
    ("backend", "gpu", "refused"), [("cuda", True, False), ("cuda", False, True), ("auto", True, True)]
)
def test_a_gpu_needs_no_compiler_where_it_is_asked_for(
    varied: Path, tmp_path: Path, monkeypatch: Patch, backend: str, gpu: bool, refused: bool
) -> None:
    def find() -> None:
        if not gpu:
            raise KernelUnavailable("no GPU that CUDA can use")

    monkeypatch.setattr("symphys.codegen.cuda.find_gpu", find)
    with without_compiler(tmp_path):
        result = run(job_of(varied, tmp_path, backend), unbuilt)
    assert lacks(result) == refused
    assert ("something was built" in result.advice) != refused
    assert ("no GPU that CUDA can use; no C compiler was found" in result.advice) == (refused and not gpu)


def test_solvers_that_draw_nothing_need_none(varied: Path, tmp_path: Path, monkeypatch: Patch) -> None:
    for scenarios, backend in ((False, "auto"), (None, "casadi")):
        monkeypatch.setitem(solvers.SOLVERS, "told", replace(solvers.SOLVERS["told"], scenarios=scenarios))
        with without_compiler(tmp_path):
            assert run(job_of(varied, tmp_path / str(scenarios), backend)).solved


def test_a_device_that_fails_in_the_middle_is_tried_again(
    problem_file: Path, tmp_path: Path, monkeypatch: Patch
) -> None:
    """As one whose memory is taken by others; a solver that refuses is not."""

    def gone(*given: Any, **more: Any) -> None:
        raise KernelUnavailable("NVIDIA failed: out of memory")

    told = solvers.SOLVERS["told"]
    job = job_of(problem_file, tmp_path, "casadi")
    monkeypatch.setitem(solvers.SOLVERS, "told", replace(told, solve=gone))
    result = run(job)
    assert lacks(result) and result.advice == "NVIDIA failed: out of memory"
    monkeypatch.setitem(solvers.SOLVERS, "told", told)
    assert run(job).solved


@pytest.mark.slow
def test_the_others_are_solved(
    varied: Path, problem_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Patch
) -> None:
    monkeypatch.setattr("symphys.report.write_run_report", lambda folder: None)
    with without_compiler(tmp_path):
        code = main(
            ["solve", str(varied), str(problem_file), "--solver", "told", "--out", str(tmp_path), "--unexamined"]
        )
    printed = capsys.readouterr()
    assert code == 1
    assert "no C compiler was found: install gcc" in printed.out + printed.err
    assert lacks(read_result(tmp_path / "varied" / "told-seed0" / "result.json"))
    assert read_result(tmp_path / "short_throw" / "told-seed0" / "result.json").solved
