"""Tangents without forces: fewer numbers, and slopes that are right where sweeps settle."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from worlds.staged_worlds import problem_of

import symphys
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.linearization import Linearization
from symphys.transcription.staged.reduced_tangent import ReducedTangent
from symphys.transcription.staged.staged_problem import RolloutStages
from symphys.transcription.staged.step_evaluator import StepEvaluator
from symphys.transcription.staged.tangent import Tangent

NEAR = [
    ("ball_throw", 1e-12),
    *(pytest.param(*each, marks=pytest.mark.slow) for each in (("crane", 1e-12), ("push_box", 0.05))),
]


@cache
def gradients(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Of the merit near the guess, with forces in the tangent and without."""
    problem = symphys.load(name)
    rollout = symbolic_rollout(problem, timed=True)
    stages = RolloutStages(rollout, threads=1)
    z = np.concatenate([variable.guess.ravel() for variable in problem.variables])
    z = (z + 0.01 * np.random.default_rng(0).normal(size=z.size))[None]
    reduced = stages.without_forces()
    assert reduced.tangent.size < stages.tangent.size
    found = [StepEvaluator(rollout, lambda each=each: each).gradient(z, 0.0).gradient for each in (stages, reduced)]
    assert found[0] is not None and found[1] is not None
    return found[0][0], found[1][0]


@pytest.mark.parametrize(("name", "most"), NEAR)
def test_slopes_are_those_with_forces_where_sweeps_settle(name: str, most: float) -> None:
    """A ball has one contact, solved exactly; a box lies on four points, which share its weight."""
    exact, reduced = gradients(name)
    assert np.abs(exact).max() > 0
    assert np.linalg.norm(reduced - exact) <= most * np.linalg.norm(exact)


@pytest.mark.parametrize("name", ["loop", "soft", "ball_throw"])
def test_difference_undoes_retract(name: str, tmp_path: Path) -> None:
    """Also where the velocity has kicks in it that depend on the pose."""
    rollout = symbolic_rollout(problem_of(name, tmp_path))
    tangent, rng = ReducedTangent(rollout), np.random.default_rng(0)
    made = Linearization(rollout, "casadi")
    z = np.concatenate([np.zeros(0), *(variable.guess for variable in rollout.problem.variables)])
    x0, u, p = made.start(z)
    x = made.step.step(0, x0[None], u[:1], p, 0.0)
    d = rng.normal(0, 0.3, (1, tangent.size))
    moved = tangent.retract(x, d)
    assert tangent.difference(x, moved) == pytest.approx(d, abs=1e-12)
    assert tangent.retract(x, 0 * d) == pytest.approx(x, abs=1e-14)
    assert len(set(tangent.names)) == tangent.size < Tangent(rollout).size


@pytest.mark.parametrize("frequency", [0.0, 30.0])
def test_soft_contacts_keep_their_forces(frequency: float) -> None:
    """They remember; those of rigid ones are found anew in each step."""
    tables = {
        "simulation": {"duration": 0.1, "dt": 0.01},
        "ground": {},
        "body": [{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "position": [0, 0, 0.1]}],
        "pair": [{"between": ["ball", "ground"], "frequency": frequency}],
    }
    names = ReducedTangent(symbolic_rollout(symphys.load(tables))).names
    assert ("ball-ground.force[2]" in names) == (frequency > 0), names


def test_without_forces_nothing_changes() -> None:
    """Where a state has none, as of a point that falls freely, the steps are shared."""
    tables = {
        "simulation": {"duration": 0.1, "dt": 0.01},
        "body": [{"name": "point", "mass": 1.0, "inertia": 0.1}],
        "variable": [{"name": "push", "sets": "point.force", "knots": 2}],
        "target": [{"name": "there", "value": "point.position - [1, 0, 0]", "tolerance": 0.1}],
    }
    stages = RolloutStages(symbolic_rollout(symphys.load(tables), timed=True), "casadi")
    assert stages.without_forces() is stages


def test_gains_answer_whole_states(tmp_path: Path) -> None:
    """A gain that reads the reduced tangent reads the same of the whole one, for small deviations."""
    problem = problem_of("soft", tmp_path)
    stages = RolloutStages(symbolic_rollout(problem, timed=True), "casadi")
    reduced = stages.without_forces()
    z = np.concatenate([variable.guess.ravel() for variable in problem.variables])
    motion, rng, steps = stages.roll_out(z, 0.0), np.random.default_rng(0), np.array([3, 5])
    rows = rng.normal(size=(2, reduced.tangent_size))
    whole = reduced.whole_gains(motion, steps, rows)
    assert whole.shape == (2, stages.tangent_size)
    for k, row, lifted in zip(steps, rows, whole, strict=True):
        x = motion.x[k][None]
        moved = stages.retract(x, 1e-6 * rng.normal(size=(1, stages.tangent_size)))
        near, far = reduced.difference(x, moved)[0], stages.difference(x, moved)[0]
        assert lifted @ far == pytest.approx(row @ near, abs=1e-4 * np.abs(row * near).max())
    assert stages.whole_gains(motion, steps, whole) is whole
    assert reduced.whole_gains(motion, steps[:0], rows[:0]).shape == (0, stages.tangent_size), "without any knots"
