"""Batched multi-start: solves side by side end as each does alone, to the bit, in fewer calls."""

from __future__ import annotations

import itertools
import os
import signal
import threading
from collections.abc import Iterator
from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from worlds.toys import counted, failing, quadratic, rosenbrock, solve, stop_at, target

from symphys.errors import SymphysError
from symphys.problem import load_problem
from symphys.problems import find
from symphys.solvers import Outcome, Status, TraceRow, solve_multi_start, solver
from symphys.solvers.core.multi_start import EvaluationBatcher
from symphys.transcription import transcribe

descents = pytest.mark.parametrize("name", ["gradient", "least_squares"])


def together(name: str, problem: Any, seeds: range = range(5), **more: Any) -> list[Outcome]:
    chosen = solver(name)
    return solve_multi_start(chosen, problem, [problem.start(seed) for seed in seeds], chosen.Options(), **more)


def same(a: Outcome, b: Outcome) -> None:
    """All but the seconds."""
    assert (a.status, a.advice, a.counts) == (b.status, b.advice, b.counts)
    assert np.array_equal(a.z, b.z)
    rows = [
        [(*astuple(replace(row, seconds=0))[:-1], *row.outputs.values()) for row in outcome.trace] for outcome in (a, b)
    ]
    np.testing.assert_array_equal(rows[0], rows[1])


@descents
@few("problem", [rosenbrock(), target(), quadratic()], 2, ids=["rosenbrock", "target", "quadratic"])
def test_each_is_that_of_the_solve_alone(name: str, problem: Any) -> None:
    for seed, found in enumerate(together(name, problem)):
        same(found, solve(name, problem, seed))


@pytest.mark.slow
@descents
@few("backend", ["casadi", "auto"], 1)
def test_on_a_throw(name: str, backend: str) -> None:
    problem = transcribe(load_problem(find("ball_throw")), backend=backend).shooting
    for seed, found in enumerate(together(name, problem, range(4))):
        same(found, solve(name, problem, seed))


def test_evaluations_are_gathered() -> None:
    watched, watch = counted(quadratic())
    outcomes = together("least_squares", watched)
    assert watch.count["jacobian"] == sum(outcome.counts.jacobians for outcome in outcomes)
    assert watch.calls["jacobian"] <= max(outcome.counts.jacobians for outcome in outcomes) + 1


@descents
def test_an_interruption_ends_one_solve_and_no_other(name: str) -> None:
    outcomes = together(name, rosenbrock(), range(3), monitors=[None, stop_at(2), None])
    assert outcomes[1].status is Status.INTERRUPTED
    assert outcomes[1].checkpoint
    for seed in (0, 2):
        same(outcomes[seed], solve(name, rosenbrock(), seed))


@descents
def test_what_an_evaluation_raises_reaches_every_solve(name: str) -> None:
    problem = failing(rosenbrock(), ("gradient", "jacobian"), 2, RuntimeError("out of order"))
    assert {outcome.status for outcome in together(name, problem, range(3))} == {Status.FAILED}
    problem = failing(rosenbrock(), ("gradient", "jacobian"), 2, KeyboardInterrupt())
    assert {outcome.status for outcome in together(name, problem, range(3))} == {Status.INTERRUPTED}
    with pytest.raises(KeyError):
        together(name, failing(rosenbrock(), ("gradient", "jacobian"), 4, KeyError("bug")), range(3))
    assert not [each for each in threading.enumerate() if each.name.startswith("symphys-solve")]


@pytest.fixture
def one_press() -> Iterator[None]:
    """Ctrl-C is heard once: presses that follow it do nothing."""
    presses = itertools.count()

    def hear(*_: object) -> None:
        if not next(presses):
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, hear)
    yield
    signal.signal(signal.SIGINT, before)


@descents
@pytest.mark.usefixtures("one_press")
def test_ctrl_c_ends_all_solves_and_leaves_no_thread(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Solves press it after an iteration until the main thread has heard; from then on nothing is evaluated."""
    problem, watch = counted(rosenbrock())
    heard, calls, close = threading.Event(), list[int](), EvaluationBatcher.close

    def closing(batcher: EvaluationBatcher) -> None:
        close(batcher)
        calls.append(sum(watch.calls.values()))
        heard.set()

    def press(row: TraceRow) -> None:
        while row.iteration == 1 and not heard.wait(0.02):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(EvaluationBatcher, "close", closing)
    with pytest.raises(KeyboardInterrupt):
        together(name, problem, monitors=[press] * 5)
    assert calls == [sum(watch.calls.values())]
    assert not [each for each in threading.enumerate() if each.name.startswith("symphys-solve")]


@pytest.mark.parametrize("name", ["ipopt", "cma"])
def test_the_others_refuse(name: str) -> None:
    with pytest.raises(SymphysError, match="side by side"):
        together(name, quadratic())


def test_no_start_is_no_solve() -> None:
    assert together("gradient", quadratic(), range(0)) == []
