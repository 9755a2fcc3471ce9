"""A quadruped that learns to walk, by a few numbers and by a net: first steps here, lessons as ``thorough``."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from data.shipped import first_steps
from tools.repeats import thorough
from walk_gradient import compared, gait

from symphys.problem import load_problem
from symphys.problems import find
from symphys.runs.job import solver_options
from symphys.shooting import Array, ScenarioEvaluator
from symphys.solvers import SOLVERS
from symphys.transcription import Transcription, transcribe

UNSEEN = 4711


def taught(name: str, settings: dict[str, object], seed: int = 0) -> tuple[Transcription, ScenarioEvaluator, Array]:
    """The problem with these settings, its samples, and what the solver found."""
    made = transcribe(load_problem(find(name), settings), exact=True)
    if made.shooting.scenario is None:
        pytest.skip(made.backend.note)
    options = solver_options(made.problem, "stochastic")
    found = SOLVERS["stochastic"].solve(made.shooting, made.shooting.start(seed), options, seed)
    return made, made.shooting.scenario, found.z


def ahead(made: Transcription, z: Array) -> Any:
    """(x, up) of the torso: how far it came [m], and the least height of its axis."""
    motion = made.simulate(z)
    torso = motion.body_names.index("torso")
    q = motion.orientation[:, torso]
    return motion.position[-1, torso, 0], (1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2)).min()


@pytest.mark.parametrize(
    ("seconds", "evaluations", "share", "searches"), [(1.0, 120, 0.9, 1), thorough(1.5, 240, 0.8, 3)]
)
def test_its_first_steps_help(seconds: float, evaluations: int, share: float, searches: int) -> None:
    """Over a second and more, from values alone: what stood steps ahead, by the middle one of some searches."""
    made, found = first_steps("quadruped_walk", seconds, evaluations, searches)
    still = made.judge(made.shooting.start(0))
    assert np.median([made.judge(z).objective for z in found]) < share * still.objective
    assert all(ahead(made, z)[0] > ahead(made, made.shooting.start(0))[0] + 0.1 for z in found)


@pytest.mark.thorough
def test_a_short_lesson_helps() -> None:
    """Sixty batches of 16 for 2 s: what stood walks, and costs less in samples that are new.

    And over these 200 steps the adjoint of a calm walk is its derivative, against central differences.
    """
    name = "quadruped_walk"
    shorter = {"simulation.duration": 2, "solver.stochastic.iterations": 60, "solver.stochastic.samples": 16}
    made, scenario, z = taught(name, shorter)
    assert np.median(compared(made, gait(made, 0.05))[0]) < 1e-6
    still, learnt = (scenario.value(each[None], scenario.draw(np.random.default_rng(UNSEEN), 32), 0.0)
                     for each in (made.shooting.start(0), z))  # fmt: skip
    assert learnt.objective.mean() < 0.8 * still.objective.mean()
    assert learnt.alive is not None and learnt.alive.mean() > 0.6
    before, after = ahead(made, made.shooting.start(0))[0], ahead(made, z)[0]
    assert after > before + 1.0


@pytest.mark.thorough
def test_the_adjoint_of_a_calm_walk_is_its_derivative() -> None:
    """Against central differences over a thousand steps, in samples that differ."""
    made = transcribe(load_problem(find("quadruped_walk")), exact=True)
    if made.shooting.scenario is None:
        pytest.skip(made.backend.note)
    errors, _ = compared(made, gait(made, 0.05))
    assert np.median(errors) < 1e-6


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(("name", "speed", "share"), [("quadruped_walk", 2.5, 0.98), ("quadruped_walk_net", 1.5, 0.95)])
def test_it_walks(name: str, speed: float, share: float, seed: int) -> None:
    """As fast as it shall, upright, straight on, and upright in most samples that it has not seen."""
    made, scenario, z = taught(name, {}, seed)
    assert made.judge(z).solved
    x, up = ahead(made, z)
    assert x > 10 * speed and up > 0.866
    errors = scenario.value(z[None], scenario.draw(np.random.default_rng(UNSEEN), 500), 0.0).errors
    upright = [constraint.name for constraint in made.problem.constraints].index("stays upright")
    assert (errors[:, upright] <= 1).mean() >= share
