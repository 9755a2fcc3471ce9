"""Gymnasium: its own checks, returns that are objectives, rows that do not depend on each other."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from tools.repeats import thorough
from worlds.driven import TABLES

import symphys

pytestmark = pytest.mark.slow

gymnasium: Any = pytest.importorskip("gymnasium")
K = np.array([[-4], [-1], [2], [0.5]])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["problem", thorough("ending"), thorough("sampled")])
def test_gymnasium_finds_no_fault(name: str, request: pytest.FixtureRequest) -> None:
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(unbounded|infinity|symmetric and normalized).*")
        check_env(symphys.env.Env(request.getfixturevalue(name)), skip_render_check=True)  # there is none


@pytest.mark.parametrize("name", [thorough("problem"), "ending"])
def test_the_return_is_minus_the_objective(name: str, request: pytest.FixtureRequest) -> None:
    """To the rounding of observations, which are in single precision."""
    problem = request.getfixturevalue(name)
    env, rollout = symphys.env.Env(problem), symphys.compile(problem)
    observation, _ = env.reset(seed=0)
    total, done, steps = 0.0, False, 0
    while not done:
        observation, reward, over, late, _ = env.step(observation @ K)
        total, done, steps = total + reward, over or late, steps + 1
    assert over == (name == "ending") and late != over
    assert (steps < 20) == over
    assert -total == pytest.approx(rollout.evaluate(rollout.z()).objective[0], rel=1e-5)


def test_many_are_as_one_alone(sampled: symphys.Problem) -> None:
    """Episodes of a seed repeat; one that has ended begins anew with the next step, whose reward is 0."""
    env, again = (symphys.env.VectorEnv(sampled, num_envs=3) for _ in range(2))
    seen = []
    for each in (env, again):
        observation, _ = each.reset(seed=5)
        rewards = []
        for k in range(25):
            observation, reward, over, late, _ = each.step(observation @ K)
            assert late.all() == (k == 19) and not over.any()
            rewards.append(reward)
        seen.append(np.array(rewards))
    assert np.array_equal(seen[0], seen[1])
    assert np.array_equal(seen[0][20], np.zeros(3)) and np.ptp(seen[0][19]) > 0
    assert not np.array_equal(seen[0][0], seen[0][21])  # another sample


@pytest.mark.slow
def test_spaces(problem: symphys.Problem) -> None:
    env = symphys.env.VectorEnv(problem, num_envs=4)
    assert env.observation_space.shape == (4, 4) and env.action_space.shape == (4, 1)
    assert np.isinf(env.single_action_space.high).all()
    bare = {key: TABLES[key] for key in ("simulation", "body", "ground", "joint")}
    assert symphys.env.Env({**bare, "cost": TABLES["cost"][:1]}).action_space.high == [20]


def test_a_motion_that_is_not_finite_is_said(problem: symphys.Problem) -> None:
    env = symphys.env.Env(problem)
    env.reset(seed=0)
    with pytest.raises(symphys.SymphysError, match=r"environment 0: cart.position.*step 1"):
        env.step([np.nan])
