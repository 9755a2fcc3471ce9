"""Adjoints that lose a share in each step back, and end where nothing is kept."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from worlds import programs

from symphys.codegen import AdjointDiscount, Cache, Place, ProgramError, compile_program

STEPS, GRAVITY, DISCOUNT = programs.STEPS, 9.81, 0.1
TORQUE = Place(0, 1, 1)
"""Of each step; torques of 0 and 1 serve as what is kept, too."""


@pytest.fixture(scope="module")
def discounted(cache: Cache) -> Any:
    """The pendulum with a state whose adjoint is discounted."""
    program = replace(programs.pendulum(), discounted=AdjointDiscount(programs.PENDULUM_STATE, TORQUE))
    return compile_program(program, cache=cache, threads=1)


def swept(torque: Any, discount: float, kept: Any) -> Any:
    """The gradient of the merit by a sweep of its own, for each of the torques."""
    x = np.array([[1.0, 0.0]])
    for u in torque:
        x = np.vstack([x, x[-1] + 0.05 * np.array([x[-1][1], u - GRAVITY * np.sin(x[-1][0])])])
    adjoint, gradient = 20 * x[-1], np.empty(len(torque))
    for k in reversed(range(len(torque))):
        gradient[k] = 0.05 * adjoint[1] + 0.02 * torque[k]
        step = np.array([[1, 0.05], [-0.05 * GRAVITY * np.cos(x[k][0]), 1]])
        running = np.array([2 * x[k][0] * (x[k][0] ** 2 > 0.1), 0])
        adjoint = (step.T @ adjoint + running) * (1 - discount) * kept[k]
    return gradient


def test_without_discount_it_is_the_derivative(discounted: Any) -> None:
    """Whatever is kept."""
    torque = np.zeros(STEPS)
    found = discounted.gradient(torque, [1, 0, 0], [GRAVITY])[1][0]
    assert found == pytest.approx(swept(torque, 0, np.ones(STEPS)), rel=1e-12)


def test_each_step_loses_its_share(discounted: Any) -> None:
    """Lane by lane; where nothing is kept the adjoint ends."""
    torques = np.ones((9, STEPS))
    for lane in range(1, 9):
        torques[lane, 3 * lane] = 0
    found = discounted.gradient(torques, [1, 0, 0], [GRAVITY], DISCOUNT)[1]
    for torque, gradient in zip(torques, found, strict=True):
        assert gradient == pytest.approx(swept(torque, DISCOUNT, torque), rel=1e-12, abs=1e-14)
    assert found[3, :9] == pytest.approx(swept(torques[3], DISCOUNT, torques[3])[:9], abs=1e-14)
    assert np.abs(found[3] - found[0]).max() > 0.01


@pytest.mark.parametrize("skipped", [1, 7, STEPS])
def test_steps_that_are_skipped(discounted: Any, skipped: int) -> None:
    """As a shorter rollout whose state is its last: also after a whole one in the same memory."""
    torques = np.linspace(-1, 1, 9)[:, None] * np.ones(STEPS)
    whole = discounted.gradient(torques, [1, 0, 0], [GRAVITY])
    outputs, found = discounted.gradient(torques, [1, 0, 0], [GRAVITY], skipped=skipped)
    for torque, gradient in zip(torques, found, strict=True):
        short = swept(torque[: STEPS - skipped], 0, np.ones(STEPS))
        assert gradient[: STEPS - skipped] == pytest.approx(short, rel=1e-12, abs=1e-14)
    again = discounted.gradient(torques, [1, 0, 0], [GRAVITY])
    assert np.array_equal(again[1], whole[1])
    assert not np.array_equal(outputs["merit"], whole[0]["merit"])


def test_more_steps_than_there_are_cannot_be_skipped(discounted: Any) -> None:
    with pytest.raises(ProgramError, match="skipped"):
        discounted.gradient(np.zeros(STEPS), [1, 0, 0], [GRAVITY], skipped=STEPS + 1)


def test_what_is_discounted_must_last() -> None:
    program = programs.pendulum()
    with pytest.raises(ProgramError, match=r"discounted state: .*memory"):
        replace(program, discounted=AdjointDiscount(Place(program.size, 2, 2)))
