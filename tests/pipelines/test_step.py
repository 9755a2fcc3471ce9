"""One step with open commands: played as the controller would, it is the rollout; its adjoints are its slopes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from worlds.driven import TABLES

import symphys

pytestmark = pytest.mark.slow

K, B = np.array([-4, -1, 2, 0.5]), 0.0


def played(step: symphys.CompiledStep, begun: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Final states and the sum of costs of motions that the controller of the file drives."""
    state, observation, inputs = begun
    total = np.zeros(len(state))
    for k in range(step.steps):
        state, observation, cost = step(state, observation @ K[:, None] + B, inputs[:, k])
        total += cost
    return state, total


@pytest.mark.slow
def test_costs_add_up_to_the_objective(problem: symphys.Problem, step: symphys.CompiledStep) -> None:
    """With contact, running costs, one at an instant, one of variables, a target; a second controller acts besides."""
    assert step.actions == ("rail.command",) and step.observations == tuple(f"place[{k}]" for k in range(4))
    rollout = symphys.compile(problem)
    state, total = played(step, step.start(2))
    assert total == pytest.approx(np.tile(rollout.evaluate(rollout.z()).objective, 2), rel=1e-12)
    motion = symphys.simulate(problem)
    assert np.abs(motion.contact_force).max() > 0.2
    for name in ("ball.position", "cart.velocity"):
        assert state[0, step.columns[name]] == pytest.approx(motion[name][-1], abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["auto", "casadi"])
def test_adjoints_are_slopes(problem: symphys.Problem, backend: str) -> None:
    step, rng, h = symphys.compile_step(problem, backend=backend), np.random.default_rng(0), 1e-6
    state, observation, inputs = step.start(3)
    for k in range(9):  # up to the instant of a cost, in contact
        state, observation, cost = step(state, rng.normal(size=(3, 1)), inputs[:, k])
    action, given = rng.normal(size=(3, 1)), inputs[:, 9]
    weights = [rng.normal(size=part.shape) for part in (state, observation, cost)]
    slopes = step.pull(state, action, *weights, inputs=given)

    def number(*called: Any) -> Any:
        return sum((w * part).reshape(3, -1).sum(1) for w, part in zip(weights, step(*called), strict=True))

    at = [state, action, given]
    for which, slope in enumerate(slopes):
        way = rng.normal(size=at[which].shape)
        sides = [number(*at[:which], at[which] + sign * h * way, *at[which + 1 :]) for sign in (1, -1)]
        assert (slope * way).sum(1) == pytest.approx((sides[0] - sides[1]) / (2 * h), rel=1e-5, abs=1e-6)


def test_both_backends_give_the_same(problem: symphys.Problem, step: symphys.CompiledStep) -> None:
    plain = symphys.compile_step(problem, backend="casadi")
    assert "virtual machine" in plain.backend and "virtual machine" not in step.backend
    for one, other in zip(played(step, step.start()), played(plain, plain.start()), strict=True):
        assert one == pytest.approx(other, rel=1e-11, abs=1e-12)


@pytest.mark.slow
def test_what_is_left_of_a_motion_that_is_over(ending: symphys.Problem) -> None:
    """The motion stands still; its costs until then, and those of the time that is left, are the objective."""
    step, rollout = symphys.compile_step(ending), symphys.compile(ending)
    state, observation, inputs = step.start()
    total = np.zeros(1)
    while step.alive(state).all():
        state, observation, cost = step(state, observation @ K[:, None], inputs[:, int(step.tick(state)[0])])
        total += cost
    assert 0 < step.tick(state)[0] < step.steps
    assert total + step.rest(state) == pytest.approx(rollout.evaluate(rollout.z()).objective, rel=1e-12)
    after = step(state, np.ones((1, 1))).state
    assert np.array_equal(after[:, step.columns["cart.position"]], state[:, step.columns["cart.position"]])


@pytest.mark.slow
def test_samples_of_scenarios(sampled: symphys.Problem, problem: symphys.Problem) -> None:
    """The first is the problem's own; the others have masses and pushes that a seed draws, each of its own."""
    step = symphys.compile_step(sampled)
    begun = step.start(4, seed=1)
    assert np.array_equal(begun.inputs, step.start(4, seed=1).inputs)
    rollout = symphys.compile(problem)
    state, total = played(step, begun)
    assert total[0] == pytest.approx(rollout.evaluate(rollout.z()).objective[0], rel=1e-12)
    assert len(set(total.round(9))) == 4
    pushed = state[:, step.columns["cart.position"]]
    assert pushed[:, 1] == pytest.approx(0, abs=1e-9)  # the rail holds it
    assert np.ptp(begun.inputs[1:], axis=0).max() > 1


@pytest.mark.slow
def test_what_is_opened() -> None:
    bare = {key: TABLES[key] for key in ("simulation", "body", "ground", "joint")}
    motors = symphys.compile_step({**bare, "cost": TABLES["cost"][:1]}, backend="casadi")
    assert motors.actions == ("rail.command",) and motors.upper == [20]
    assert motors.observations[:2] == ("cart.position[0]", "cart.position[1]") and motors.observation_size == 26
    knots = symphys.compile_step("two_balls", backend="casadi")
    assert knots.actions == ("pusher.force[0]", "pusher.force[1]")
    drift = symphys.compile_step(TABLES, ["drift"], sensors=["place"], backend="casadi")
    assert drift.actions == ("ball.force[0]",) and drift.observation_size == 4


def test_what_cannot_be_is_said() -> None:
    for arguments, text in (
        ({"controllers": ["hnad"]}, 'no controller is called "hnad"; did you mean "hand"'),
        ({"sensors": ["plaec"]}, 'no sensor is called "plaec"; did you mean "place"'),
    ):
        with pytest.raises(symphys.SymphysError, match=text):
            symphys.compile_step(TABLES, **arguments)
    with pytest.raises(symphys.SymphysError, match="ball_throw"):
        symphys.compile_step("ball_throw")
    looking = {**TABLES, "cost": [{"name": "small", "squares": "gains"}]}
    with pytest.raises(symphys.ProblemError, match=r'cost "small": .*gains'):
        symphys.compile_step(looking)


def test_shapes_that_do_not_fit_are_said(step: symphys.CompiledStep) -> None:
    state = step.start(2).state
    with pytest.raises(ValueError, match=r"action.*\(batch, 1\)"):
        step(state, np.zeros((2, 3)))
    with pytest.raises(ValueError, match="2 states"):
        step(state, np.zeros((1, 1)))
