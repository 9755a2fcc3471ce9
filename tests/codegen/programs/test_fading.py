"""Adjoints that lose a share in each step back, and end where nothing is kept."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import programs
import pytest

from symphys.codegen import Cache, Fading, KernelUnavailable, Place, ProgramError, compile_program

STEPS, GRAVITY, LOSS = programs.STEPS, 9.81, 0.1
TORQUE = Place(0, 1, 1)
"""Of each step; torques of 0 and 1 serve as what is kept, too."""


@pytest.fixture(scope="module")
def fading(cache: Cache) -> Any:
    """The pendulum with a state that fades."""
    program = replace(programs.pendulum(), fading=Fading(programs.PENDULUM_STATE, TORQUE))
    try:
        return compile_program(program, cache=cache, threads=1)
    except KernelUnavailable as error:
        pytest.skip(str(error))


def swept(torque: Any, loss: float, kept: Any) -> Any:
    """The gradient of the merit by a sweep of its own, for each of the torques."""
    x = np.array([[1.0, 0.0]])
    for u in torque:
        x = np.vstack([x, x[-1] + 0.05 * np.array([x[-1][1], u - GRAVITY * np.sin(x[-1][0])])])
    adjoint, gradient = 20 * x[-1], np.empty(len(torque))
    for k in reversed(range(len(torque))):
        gradient[k] = 0.05 * adjoint[1] + 0.02 * torque[k]
        step = np.array([[1, 0.05], [-0.05 * GRAVITY * np.cos(x[k][0]), 1]])
        running = np.array([2 * x[k][0] * (x[k][0] ** 2 > 0.1), 0])
        adjoint = (step.T @ adjoint + running) * (1 - loss) * kept[k]
    return gradient


def test_without_loss_it_is_the_derivative(fading: Any) -> None:
    """Whatever is kept."""
    torque = np.zeros(STEPS)
    found = fading.gradient(torque, [1, 0, 0], [GRAVITY])[1][0]
    assert found == pytest.approx(swept(torque, 0, np.ones(STEPS)), rel=1e-12)


def test_each_step_loses_its_share(fading: Any) -> None:
    """Lane by lane; where nothing is kept the adjoint ends."""
    torques = np.ones((9, STEPS))
    for lane in range(1, 9):
        torques[lane, 3 * lane] = 0
    found = fading.gradient(torques, [1, 0, 0], [GRAVITY], LOSS)[1]
    for torque, gradient in zip(torques, found, strict=True):
        assert gradient == pytest.approx(swept(torque, LOSS, torque), rel=1e-12, abs=1e-14)
    assert found[3, :9] == pytest.approx(swept(torques[3], LOSS, torques[3])[:9], abs=1e-14)
    assert np.abs(found[3] - found[0]).max() > 0.01


@pytest.mark.parametrize("spared", [1, 7, STEPS])
def test_steps_that_are_spared(fading: Any, spared: int) -> None:
    """As a shorter rollout whose state is its last: also after a whole one in the same memory."""
    torques = np.linspace(-1, 1, 9)[:, None] * np.ones(STEPS)
    whole = fading.gradient(torques, [1, 0, 0], [GRAVITY])
    outputs, found = fading.gradient(torques, [1, 0, 0], [GRAVITY], spared=spared)
    for torque, gradient in zip(torques, found, strict=True):
        short = swept(torque[: STEPS - spared], 0, np.ones(STEPS))
        assert gradient[: STEPS - spared] == pytest.approx(short, rel=1e-12, abs=1e-14)
    again = fading.gradient(torques, [1, 0, 0], [GRAVITY])
    assert np.array_equal(again[1], whole[1])
    assert not np.array_equal(outputs["merit"], whole[0]["merit"])


def test_more_steps_than_there_are_cannot_be_spared(fading: Any) -> None:
    with pytest.raises(ProgramError, match="cannot be spared"):
        fading.gradient(np.zeros(STEPS), [1, 0, 0], [GRAVITY], spared=STEPS + 1)


def test_what_fades_must_last() -> None:
    program = programs.pendulum()
    with pytest.raises(ProgramError, match=r"fading state: .* outside the memory"):
        replace(program, fading=Fading(Place(program.size, 2, 2)))
