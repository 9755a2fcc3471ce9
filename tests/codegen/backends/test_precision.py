"""Gradients in single precision are compared with double precision, and what is far off is told everywhere."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from fakes.emulated import Emulated, needs_compiler
from worlds.toys import require

import symphys
from symphys.codegen.backends.precision import largest_error
from symphys.codegen.runtime import widths
from symphys.codegen.runtime.batch import RolloutBatch
from symphys.codegen.runtime.kernel import ProcessorKernel
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.transcription import transcribe


def problem(duration: float = 1.0) -> Problem:
    return load_problem(find("ball_throw"), {"simulation.duration": duration})


def doctored(monkeypatch: pytest.MonkeyPatch, factor: float) -> None:
    """Single precision whose gradients are off by ``factor``, as those of long motions are."""
    run = ProcessorKernel._run

    def off(self: ProcessorKernel, batch: RolloutBatch) -> None:
        run(self, batch)
        if self.report.precision == "single" and "gradient" in batch.results:
            batch.results["gradient"][:] *= 1 + factor

    monkeypatch.setattr(ProcessorKernel, "_run", off)


def test_the_largest_error_is_by_the_length_of_its_row() -> None:
    exact = np.array([[3.0, 4.0], [0.0, 1e-9], [np.nan, 1.0]])
    assert largest_error(exact + np.array([[0.5, 0], [0, 0], [0, 0]]), exact) == pytest.approx(0.1)
    assert largest_error(exact + np.array([[0, 0], [0, 1e-9], [0, 0]]), exact) == pytest.approx(1e-9 / 5e-3)
    assert largest_error(np.full((3, 2), np.nan), exact) == np.inf
    assert largest_error(np.zeros((3, 2)), np.zeros((3, 2))) == 0


@pytest.mark.slow
def test_gradients_that_are_right_are_not_doubted() -> None:
    """A thrown ball: single precision knows five digits."""
    require("simd32")
    rollout = symphys.compile(problem(), backend="simd32")
    rollout.gradient(rollout.z())  # warnings are errors


@pytest.mark.slow
@pytest.mark.parametrize("factor, words", [(0.6, "60 %"), (96.0, "96 times"), (np.nan, "any multiple")])
def test_gradients_that_are_far_off_are_doubted(factor: float, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    require("simd32")
    doctored(monkeypatch, factor)
    rollout = symphys.compile(problem(), backend="simd32")
    with pytest.warns(RuntimeWarning, match=f"single precision .*{words}"):
        rollout.gradient(rollout.z())


@pytest.mark.slow
def test_adjoints_of_a_step_and_of_quantities_are_doubted(monkeypatch: pytest.MonkeyPatch) -> None:
    require("simd32")
    doctored(monkeypatch, 0.6)
    step = symphys.compile_step("cart_pole", backend="simd32")
    state, observation, _ = step.start(2)
    action = np.ones((2, step.action_size))
    after = step(state, action)
    with pytest.warns(RuntimeWarning, match="cart_pole: .*single precision .*60 %"):
        step.pull(state, action, np.ones_like(after.state), np.zeros_like(observation), np.ones(2))
    thrown = symphys.compile(problem(), backend="simd32")
    recording, Z = thrown.recording("ball.position"), thrown.z()[None]
    value, found = recording.forward(Z)
    with pytest.warns(RuntimeWarning, match="ball_throw: .*single precision .*60 %"):
        recording.pull(Z, np.ones_like(value), {name: np.ones_like(each) for name, each in found.items()})


def test_what_else_a_kernel_notes_is_no_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    """That an interpreter evaluates says nothing of gradients."""
    require("simd32")
    monkeypatch.setattr(widths.Widths, "note", "an interpreter evaluates")
    rollout = symphys.compile(problem(1.1), backend="simd32")
    rollout.gradient(rollout.z())  # warnings are errors


@pytest.mark.parametrize("solver", ["least_squares", "ipopt"])
def test_a_solve_says_so_in_its_result_log_and_page(
    solver: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    require("simd32")
    doctored(monkeypatch, 0.6)
    symphys.solve(problem(), solver, backend="simd32", folder=tmp_path / "out", max_seconds=1e-9)
    (written,) = (tmp_path / "out").rglob("result.json")
    assert "off by 60 %" in json.loads(written.read_text())["backend"]["note"]
    assert "off by 60 %" in (written.parent / "log.txt").read_text()


def test_values_alone_are_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    require("simd32")
    doctored(monkeypatch, 0.6)
    made = transcribe(problem(0.9), backend="simd32")
    made.shooting.evaluator.value(made.shooting.start(0)[None], 0.0)
    assert made.backend.said() == ""


@pytest.mark.slow
@needs_compiler
def test_a_device_in_single_precision_is_compared_with_the_processor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is compared is what came from the device."""
    require("simd")
    monkeypatch.setattr("symphys.codegen.cuda.find_gpu", lambda: Emulated(tmp_path / "device"))
    rollout = symphys.compile(problem(), backend="cuda32")
    get = Emulated.get
    monkeypatch.setattr(Emulated, "get", lambda self, array: 1.5 * get(self, array))
    with pytest.warns(RuntimeWarning, match="50 %"):
        rollout.gradient(rollout.z())
