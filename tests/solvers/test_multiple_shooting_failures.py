"""Whatever goes wrong in multiple shooting is a status with advice, or an error before it begins."""

from __future__ import annotations

import itertools
import os
import signal
import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from tools.waiting import FOREVER
from worlds.shots_of_toys import LINE, SWING, every_backend, solve
from worlds.staged_toys import Chain, acrobot, boxed, pendulum
from worlds.toys import quadratic, stop_at, through_json

from symphys.errors import SymphysError
from symphys.solvers import SOLVERS, MultipleShootingOptions, Status


@every_backend
@few("kind", ["step", "linearize", "expand"], 1)
@few("error", [KeyboardInterrupt(), RuntimeError("out of order"), MemoryError("72 TiB")], 1)
def test_what_an_evaluation_raises(backend: str, kind: str, error: BaseException, monkeypatch: Any) -> None:
    """An interruption goes on from the last iterate, all else is a failure; neither is lost in the library."""
    chain = acrobot()
    whole, count = getattr(chain, kind), [0]
    last = 10 if kind != "step" else 10 * chain.steps

    def failing(*given: Any) -> Any:
        count[0] += 1
        if count[0] == last:
            raise error
        return whole(*given)

    monkeypatch.setattr(chain, kind, failing)
    problem = boxed(chain)
    found = solve(problem, nodes=LINE, backend=backend)
    if isinstance(error, KeyboardInterrupt):
        assert found.status is Status.INTERRUPTED
        rest = solve(problem, nodes=LINE, backend=backend, checkpoint=through_json(found.checkpoint))
        assert rest.trace[-1].best == pytest.approx(SWING, abs=1e-4)
    else:
        assert found.status is Status.FAILED and str(error) in found.advice


@every_backend
@pytest.mark.parametrize("call", [1, 3, 5])
def test_a_signal_is_not_lost(backend: str, call: int) -> None:
    """Wherever it comes from this call of Python on: in Python, in the library, or on the way between the two."""
    chain, begun, sent, count = acrobot(), threading.Event(), threading.Event(), itertools.count(1)
    whole = chain.linearize

    def lasting(motion: Any) -> Any:
        number = next(count)
        if number == call:
            begun.set()
        assert number <= call or sent.wait(FOREVER)
        return whole(motion)

    def press() -> None:
        if begun.wait(FOREVER):
            os.kill(os.getpid(), signal.SIGINT)
            sent.set()

    chain.linearize = lasting  # type: ignore[method-assign]
    threading.Thread(target=press, daemon=True).start()
    found = solve(boxed(chain), nodes=LINE, backend=backend)
    assert sent.is_set() and found.status is Status.INTERRUPTED
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_start_that_is_not_finite() -> None:
    found = solve(boxed(pendulum(), guess=np.nan))
    assert found.status is Status.NOT_FINITE and "start" in found.advice


def fragile(chain: Chain) -> tuple[Chain, list[int]]:
    """With steps that are not finite beyond a speed of 25 rad/s, and how many of these each call made."""
    whole, seen = chain.step, []

    def step(k: int, X: Any, U: Any, Z: Any, smoothing: float) -> Any:
        wild = ~(np.abs(X[:, 2:]).max(axis=1) < 25)
        seen.append(int(wild.sum()))
        return np.where(wild[:, None], np.nan, whole(k, X, U, Z, smoothing))

    chain.step = step  # type: ignore[method-assign]
    return chain, seen


@every_backend
@pytest.mark.parametrize("at", [1, 4])
def test_slopes_that_are_not_finite(backend: str, at: int, monkeypatch: Any) -> None:
    chain = acrobot()
    whole, count = chain.linearize, [0]

    def spoiled(motion: Any) -> Any:
        count[0] += 1
        found = whole(motion)
        return replace(found, a=found.a * np.nan) if count[0] >= at else found

    monkeypatch.setattr(chain, "linearize", spoiled)
    found = solve(boxed(chain), nodes=LINE, backend=backend)
    assert found.status is Status.NOT_FINITE and "derivative" in found.advice


@every_backend
def test_simulations_that_are_not_finite_shorten_the_step(backend: str) -> None:
    chain, seen = fragile(acrobot())
    found = solve(boxed(chain), backend=backend, nodes=LINE, steps_between_nodes=4)
    assert sum(seen) > 0
    assert found.trace[-1].best == pytest.approx(SWING, abs=1e-3)


@every_backend
def test_a_guess_of_states_makes_up_for_controls_that_cannot_be_simulated(backend: str) -> None:
    problem = boxed(fragile(acrobot())[0], guess=50.0)
    assert solve(problem, backend=backend).status is Status.NOT_FINITE
    found = solve(problem, backend=backend, nodes=LINE)
    assert found.status is Status.CONVERGED and not np.isfinite(found.trace[0].objective)
    assert found.trace[-1].best == pytest.approx(SWING, abs=1e-4)


@every_backend
def test_a_budget(backend: str) -> None:
    found = solve(boxed(acrobot()), backend=backend, nodes=LINE, iterations=5)
    assert found.status is Status.BUDGET and "iterations" in found.advice
    assert len(found.trace) == 6


def test_a_problem_without_steps_is_refused() -> None:
    found = SOLVERS["multiple_shooting"].solve(quadratic(), np.zeros(3), MultipleShootingOptions())
    assert found.status is Status.NOT_APPLICABLE
    assert "step by step" in found.advice and "ipopt" in found.advice


def test_fatrop_takes_no_constraint_across_intervals() -> None:
    """IPOPT does: the sum of two speeds far apart."""
    chain = pendulum(fast=50.0)
    slopes = chain.limit_slopes

    def across(motion: Any) -> Any:
        limits, by_state, by_input, by_static = slopes(motion)
        both = by_state.tolil()
        both[0, 60] = 1e-9
        return limits, both.tocsr(), by_input, by_static

    chain.limit_slopes = across  # type: ignore[method-assign]
    assert solve(boxed(chain, 8.0)).status is Status.CONVERGED
    with pytest.raises(SymphysError, match=r"number 1 .*backend = 'ipopt'"):
        solve(boxed(chain, 8.0), backend="fatrop")


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"backend": "snopt"}, "backend must be ipopt or fatrop"),
        ({"hessian": "none"}, "hessian must be auto, gauss-newton, exact or limited-memory"),
        ({"hessian": "limited-memory", "backend": "fatrop"}, "hessian must be auto, gauss-newton or exact with"),
        ({"steps_between_nodes": -1}, "steps_between_nodes must be at least 0"),
        ({"tolerance": 0.0}, "tolerance must be above 0"),
    ],
)
def test_values_that_cannot_be(bad: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MultipleShootingOptions(**bad)


def test_what_cannot_be_passed_on() -> None:
    problem = boxed(pendulum(), 8.0)
    for options, message in (
        ({"options": {"nonsense": 1}}, "options.nonsense: .*no such option"),
        ({"options": {"max_iter": 1}}, "options.max_iter: .*use iterations"),
        ({"backend": "fatrop", "options": {"nonsense": 1}}, "options.nonsense: FATROP .*no such option"),
        ({"backend": "fatrop", "options": {"mu_init": "x"}}, "options.mu_init: FATROP"),
        ({"backend": "fatrop", "options": {"tolerance": 1}}, "options.tolerance: FATROP"),
    ):
        with pytest.raises(SymphysError, match=f"solver.multiple_shooting.{message}"):
            solve(problem, **options)


def test_a_checkpoint_of_another_grid_is_damaged() -> None:
    problem = boxed(pendulum(), 8.0)
    part = solve(problem, monitor=stop_at(3))
    with pytest.raises(SymphysError, match="damaged"):
        solve(problem, steps_between_nodes=5, checkpoint=through_json(part.checkpoint))


@pytest.mark.slow
def test_options_reach_the_library() -> None:
    """A barrier that begins low, or a line of IPOPT's text."""
    problem = boxed(pendulum(), 8.0)
    few = len(solve(problem, backend="fatrop").trace)
    assert len(solve(problem, backend="fatrop", options={"mu_init": 1e-4}).trace) != few
    lines: list[str] = []
    solve(problem, options={"mu_strategy": "adaptive", "print_user_options": "yes"}, log=lines.append)
    assert any("mu_strategy = adaptive" in line for line in lines)
