"""Differential dynamic programming on small motions: swing-ups, limits, statics, interruption."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from worlds.staged_toys import acrobot, attitude, boxed, pendulum
from worlds.toys import quadratic, require, stop_at, through_json

import symphys
from symphys.codegen.toolchain import build
from symphys.shooting import ShootingProblem
from symphys.solvers import Outcome, Status, solver
from symphys.solvers.ddp.gains import follow
from symphys.solvers.ddp.iteration import LONG
from symphys.transcription import transcribe

SWING = 98.637754
"""The least objective of the acrobot's swing-up that is known; multiple shooting finds it too."""


def solve(problem: ShootingProblem, start: Any = None, **more: Any) -> Outcome:
    """By ilqr; what is no argument of the call is an option."""
    method = solver("ilqr")
    calls = {key: more.pop(key) for key in ("seed", "monitor", "checkpoint", "log", "keep") if key in more}
    point = problem.start(calls.get("seed", 0)) if start is None else np.asarray(start)
    return method.solve(problem, point, method.Options(**more), **calls)


@pytest.mark.slow
def test_the_acrobot_swings_up_from_rest() -> None:
    """From hanging, without a guess, and from every seed to the same swing."""
    problem = boxed(acrobot())
    found = [solve(problem, seed=seed) for seed in range(4)]
    best = [each.trace[-1].best for each in found]
    assert {each.status for each in found} == {Status.CONVERGED}
    assert best == pytest.approx([SWING] * 4, rel=1e-6)
    assert problem.staged is not None
    last = problem.staged().roll_out(found[0].z, 0.0).x[-1]
    assert last == pytest.approx([np.pi, 0, 0, 0], abs=0.5)


@pytest.mark.slow
def test_a_body_turns_by_180_degrees() -> None:
    found = solve(boxed(attitude()))
    assert found.status is Status.CONVERGED
    assert found.trace[-1].best == pytest.approx(22.467749, abs=1e-4)


@pytest.mark.slow
def test_static_entries_are_found_with_the_controls() -> None:
    scaled = solve(boxed(attitude(parameter=True), statics=[1.2]))
    assert scaled.trace[-1].best == pytest.approx(14.742314, abs=1e-4)
    thrown = solve(boxed(pendulum(throw=True), 3.0, statics=[1.0]), iterations=500)
    assert thrown.trace[-1].objective == pytest.approx(4.797, abs=2e-3)
    assert thrown.trace[-1].max_violation < 1


@pytest.mark.slow
def test_limits_of_controls_and_of_the_path() -> None:
    """Some controls are at their bounds and some speeds at their limit, and none beyond; the end is met."""
    chain = pendulum(fast=4.0, knots=11)
    found = solve(boxed(chain, 8.0), iterations=500)
    motion = chain.roll_out(found.z, 0.0)
    assert np.abs(found.z).max() == 8.0
    assert np.abs(motion.x[:-1, 1]).max() == pytest.approx(4.0, abs=1e-5)
    assert motion.x[-1, 0] == pytest.approx(np.pi, abs=1e-6)
    assert found.trace[-1].max_violation < 1


@pytest.mark.slow
@few("stop", [0, 4], 1)
def test_what_was_interrupted_comes_to_the_same_answer(stop: int) -> None:
    problem = boxed(pendulum(), 9.0)
    whole = solve(problem)
    part = solve(problem, monitor=stop_at(stop))
    assert part.status is Status.INTERRUPTED and len(part.trace) == stop + 1 and not part.gains
    rest = solve(problem, checkpoint=through_json(part.checkpoint))
    assert rest.status is whole.status and len(rest.trace) == len(whole.trace)
    np.testing.assert_array_equal(rest.z, whole.z)


@pytest.mark.slow
def test_gains_bring_a_disturbed_motion_back() -> None:
    """From a start that is off, the swing-up ends far away with the same torques, and upright with the gains."""
    problem = boxed(acrobot())
    found = solve(problem)
    assert problem.staged is not None and found.gains
    staged, bounds, off = problem.staged(), (problem.stacked("lower"), problem.stacked("upper")), {}
    start, last = staged.start(found.z[None])[0], found.gains["states"][-1][None]
    for feedback in (False, True):
        motion = follow(staged, found.gains, start + np.array([0.02, -0.02, 0, 0]), bounds, feedback)
        off[feedback] = float(np.abs(staged.difference(last, motion.x[-1:])).max())
    assert off[True] < 0.2 * off[False], off
    assert off[False] > 0.2
    np.testing.assert_allclose(follow(staged, found.gains, start, bounds).z, found.z, atol=1e-9)


def test_budgets_seeds_and_refusals() -> None:
    problem = boxed(acrobot())
    short = solve(problem, iterations=3)
    assert short.status is Status.BUDGET and len(short.trace) == 4 and "iterations" in short.advice
    np.testing.assert_array_equal(solve(problem, seed=2, iterations=3).z, solve(problem, seed=2, iterations=3).z)
    refused = solve(quadratic())
    assert refused.status is Status.NOT_APPLICABLE and "step by step" in refused.advice
    counts = short.counts
    assert counts.gradients == 3 * 4 and counts.rollouts >= 3 * LONG


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"damping": 0.0}, "damping must be above 0"),
        ({"penalty": -1.0}, "penalty must be above 0"),
        ({"growth": 1.0}, "growth must be above 1"),
        ({"iterations": -1}, "iterations must be at least 0"),
    ],
)
def test_values_that_cannot_be(bad: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        solver("ilqr").Options(**bad)


@pytest.mark.slow
def test_iterates_of_a_first_start_are_those_of_compiled_kernels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An interpreter evaluates values, steps and Jacobians until their compilers are done."""
    require("simd")
    monkeypatch.setattr(build, "MIN_LONG_OPERATIONS", 0)
    found = []
    for wait in ("", "1"):
        monkeypatch.setenv("SYMPHYS_WAIT", wait)
        monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path / f"kernels{wait}"))
        problem = transcribe(symphys.load("cart_pole"), threads=1).shooting
        found.append([(row.objective, row.step) for row in solve(problem, iterations=6).trace])
    np.testing.assert_array_equal(*found)
