"""Tangents hold all of a state that a step can reach, and nothing twice."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few, thorough
from worlds.staged_worlds import problem_of

from symphys.model.state_layout import Layout
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.linearization import Linearization
from symphys.transcription.staged.tangent import Tangent

WORLDS = ("loop", "soft", "ball_throw", *(thorough(name) for name in ("parcel", "hopper_jump", "gait_robot_trot")))
SIZES = {"ball_throw": 18, "hopper_jump": 33, "gait_robot_trot": 76}
STEPS = 30


def states_of(name: str, folder: Path) -> tuple[Tangent, np.ndarray, np.ndarray]:
    """Of a rollout on casadi's virtual machine: its tangent, its states, p."""
    problem = problem_of(name, folder)
    made = Linearization(symbolic_rollout(problem), "casadi")
    z = np.concatenate([np.zeros(0), *(variable.guess for variable in problem.variables)])
    x0, u, p = made.start(z)
    states = [x0]
    for k in range(min(STEPS, made.rollout.steps)):
        states.append(made.step.step(k, states[-1][None], u[None, k], p, 0.0)[0])
    return made.tangent, np.array(states), p


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_states_of_a_rollout_lie_in_each_others_tangents(name: str, tmp_path: Path) -> None:
    tangent, states, p = states_of(name, tmp_path)
    before, after = states[1:-1], states[2:]
    found = tangent.retract(before, tangent.difference(before, after, p), p)
    for body in tangent.rollout.world.bodies:  # q and -q are one orientation
        part = Layout(tangent.rollout.world)[f"{body.name}.orientation"]
        found[:, part] *= np.sign((found[:, part] * after[:, part]).sum(axis=1))[:, None]
    assert np.abs(found - after).max() < 1e-13 * max(1.0, np.abs(after).max())


@pytest.mark.slow
@few("name", WORLDS, 1)
def test_difference_undoes_retract(name: str, tmp_path: Path) -> None:
    tangent, states, p = states_of(name, tmp_path)
    d = np.random.default_rng(0).normal(0, 0.3, (len(states), tangent.size))
    assert np.abs(tangent.difference(states, tangent.retract(states, d, p), p) - d).max() < 1e-12
    assert np.abs(tangent.retract(states, 0 * d, p) - states).max() < 1e-14
    if name in SIZES:
        assert tangent.size == SIZES[name]
    assert len(set(tangent.names)) == tangent.size


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_basis_and_projection_are_their_slopes(name: str, tmp_path: Path) -> None:
    tangent, states, p = states_of(name, tmp_path)
    x, rng, step = states[-1], np.random.default_rng(1), 1e-6
    basis, projection = (np.array(ca.DM(each(x, p))) for each in (tangent.basis, tangent.projection))
    assert projection @ basis == pytest.approx(np.eye(tangent.size), abs=1e-12)
    d = rng.normal(size=(1, tangent.size))
    ends = [tangent.retract(x[None], sign * step * d, p)[0] for sign in (1, -1)]
    slope = (ends[0] - ends[1]) / (2 * step)
    assert basis @ d[0] == pytest.approx(slope, abs=1e-7 * np.abs(slope).max())


def test_lag_is_left_out_unless_impacts_cut_steps(tmp_path: Path) -> None:
    """After the first step it is half a step, whatever the state."""
    for name, cut in (("loop", False), ("soft", True)):
        rollout = symbolic_rollout(problem_of(name, tmp_path))
        assert ("lag[0]" in Tangent(rollout).names) == cut
