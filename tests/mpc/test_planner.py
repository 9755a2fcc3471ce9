"""Plans agree with a staged problem of their own and with the backward pass of iLQR, which keeps a costate."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from worlds.swung import TABLES, pendulum

from symphys.errors import ProblemError
from symphys.mpc.planner import Planner, PlanPolicy, RecedingPlan, shifted
from symphys.problem import problem_of_tables
from symphys.shooting import Linearized, StagedMotion
from symphys.solvers.ddp.backward_pass import Bounds, backward_pass
from symphys.solvers.ddp.forward_pass import MotionBatch, forward_pass
from symphys.solvers.ddp.iteration import STEP_LENGTHS, LocalExpansion
from symphys.solvers.ddp.knots import PaddedKnots, knot_steps
from symphys.transcription.staged.staged_problem import RolloutStages


@cache
def planner() -> Planner:
    return Planner(pendulum(), threads=1)


@cache
def stages() -> RolloutStages:
    return RolloutStages(planner().rollout, threads=1, exact=True)


@cache
def plan() -> RecedingPlan:
    """After three iterations: neither the guess nor the optimum; some decisions are at their bounds."""
    made = planner()
    made.damping = 1e-2
    policy = PlanPolicy(
        np.tile(made.start, (20, 1)), np.linspace(-9, 7, 20)[:, None], np.zeros((20, 1)), np.zeros((20, 1, 3))
    )
    policy = PlanPolicy(policy.x, policy.v, policy.ahead, np.zeros((20, 1, made.tangent.size)))
    return made._improved(policy, made.start, 0.0, 3)


def motion(z: np.ndarray) -> StagedMotion:
    return stages().roll_out(z, 0.0)


def merit(z: np.ndarray) -> float:
    """Objective and penalties, by the staged problem."""
    found = motion(z)
    objective, limits = stages().measure(z[None], found.x[None], found.u[None])
    beyond = limits - np.clip(limits, stages().lower, stages().upper)
    return float(objective[0] + np.sum(stages().penalties * beyond**2))


@pytest.mark.slow
def test_a_plan_costs_what_the_staged_problem_says() -> None:
    assert plan().cost == pytest.approx(merit(plan().v.ravel()), rel=1e-12)


@pytest.mark.slow
def test_a_plan_is_a_motion_of_the_model() -> None:
    assert plan().x == pytest.approx(motion(plan().v.ravel()).x, abs=1e-10)


def padded() -> PaddedKnots:
    return PaddedKnots.of(knot_steps(stages()), np.full(20, -8.0), np.full(20, 8.0))


@pytest.mark.slow
def test_slopes_and_curvature_of_costs_are_those_of_differences() -> None:
    """Squares and limits lie on top of each other; here each is differentiated for itself, along the motion."""
    found, staged, h = motion(plan().v.ravel()), stages(), 1e-6
    none, penalties = np.zeros(len(staged.lower)), 2 * staged.penalties
    wanted = planner().stages.expand(found, none, penalties)

    def value(x: np.ndarray, u: np.ndarray) -> float:
        objective, limits = staged.measure(found.z[None], x[None], u[None])
        beyond = limits - np.clip(limits, staged.lower, staged.upper)
        return float(objective[0] + np.sum(staged.penalties * beyond**2))

    assert wanted.value == pytest.approx(value(found.x, found.u), rel=1e-12)
    for k in (0, 7, 20):
        for i in range(staged.tangent_size):
            step = np.zeros((1, staged.tangent_size))
            step[0, i] = h
            ends = []
            for sign in (1, -1):
                x = found.x.copy()
                x[k] = staged.retract(x[k : k + 1], sign * step)[0]
                ends.append(value(x, found.u))
            assert wanted.x[k, i] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5, abs=1e-6)
    for k in (0, 7, 19):
        u, v = found.u.copy(), found.u.copy()
        u[k], v[k] = u[k] + h, v[k] - h
        assert wanted.u[k, 0] == pytest.approx((value(found.x, u) - value(found.x, v)) / (2 * h), rel=1e-5, abs=1e-6)


@pytest.mark.slow
def test_the_feedback_of_a_plan_is_that_of_the_backward_pass() -> None:
    """Slopes of the whole cost to go lead to the feedback of a costate, with decisions that bounds hold among them."""
    found, made = motion(plan().v.ravel()), planner()
    made.stages.begin(made.start, 0.0)
    about = LocalExpansion(made.stages, found, made._limits, padded(), np.full(20, 2.0))
    wanted, got = about.policy(0.1), about.policy(0.1, gradient=False)
    assert wanted is not None and got is not None
    assert wanted.ahead == pytest.approx(got.ahead, rel=1e-8, abs=1e-9)
    assert wanted.back == pytest.approx(got.back, rel=1e-7, abs=1e-8)
    assert (wanted.first, wanted.second) == pytest.approx((got.first, got.second), rel=1e-9)
    held = ~got.back.any(axis=(1, 2))
    assert held.any() and not held.all()


@pytest.mark.slow
def test_the_compiled_rollout_is_the_forward_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    """States, decisions and costs of all step lengths."""
    made, found = planner(), motion(plan().v.ravel())
    slopes: Linearized = stages().linearize(found)
    costs = stages().expand(found, np.zeros(len(stages().lower)), 2 * stages().penalties)
    bounds = Bounds(-8 - found.z, 8 - found.z, np.full(20, 2.0))
    policy = backward_pass([slopes], costs, knot_steps(stages()), stages().statics, bounds, 1.0)
    assert policy is not None
    monkeypatch.setattr(stages(), "follow", lambda *_: None)
    wanted = forward_pass(stages(), found, policy, padded(), STEP_LENGTHS)
    about = PlanPolicy(found.x[:-1], plan().v, policy.ahead, policy.back)
    x, v, cost = made.follow(found.x[0], about, STEP_LENGTHS, 0.0)
    assert x == pytest.approx(wanted.x, abs=1e-9)
    assert v == pytest.approx(wanted.u, abs=1e-9)
    assert cost == pytest.approx([merit(row) for row in wanted.z], rel=1e-9)


@pytest.mark.slow
def test_without_a_compiler_a_rollout_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    made = planner()
    policy = PlanPolicy(plan().x[:-1], plan().v, np.full((20, 1), 0.3), plan().back)
    lengths = np.array([1.0, 0.25])
    compiled = made.follow(made.start, policy, lengths, 0.5)
    monkeypatch.setattr(made.stages, "follow", lambda *_: None)
    for one, other in zip(compiled, made.follow(made.start, policy, lengths, 0.5), strict=True):
        assert one == pytest.approx(other, abs=1e-9)


@pytest.mark.slow
def test_a_shift_by_whole_steps_drops_what_is_past() -> None:
    moved = shifted(plan(), 3 * plan().dt)
    assert moved.v[:-3] == pytest.approx(plan().v[3:])
    assert moved.x[:-3] == pytest.approx(plan().x[3:-1])
    assert moved.v[-3:] == pytest.approx(np.tile(plan().v[-1:], (3, 1)))


def test_a_shift_by_half_a_step_is_halfway() -> None:
    moved = shifted(plan(), 0.5 * plan().dt)
    assert moved.v[:-1] == pytest.approx((plan().v[:-1] + plan().v[1:]) / 2)


@pytest.mark.slow
def test_a_cost_in_time_sees_the_time_of_the_tick() -> None:
    """A reference that moves: a plan at t tracks what is wanted from t on."""
    tables = {**TABLES, "cost": [{"name": "track", "at": "always", "squares": "pivot.angle - 0.1 * time"}]}
    tables |= {"target": [], "constraint": []}
    made = Planner(problem_of_tables(tables), threads=1)
    policy = shifted(made.first(made.start, 0.0), 0.0)
    still = PlanPolicy(policy.x, np.zeros_like(policy.v), policy.ahead, np.zeros_like(policy.back))
    for clock in (0.0, 2.0):
        cost = made.follow(made.start, still, np.zeros(1), clock)[2][0]
        squares = (0.1 * (clock + 0.08 * np.arange(21))) ** 2
        assert cost == pytest.approx(0.08 * np.sum(squares[1:] + squares[:-1]) / 2, rel=1e-9)


def with_cost(**cost: str) -> dict[str, object]:
    return {"cost": [*TABLES["cost"][::2], {"name": "effort", "weight": 0.03, **cost}]}


@pytest.mark.slow
def test_a_control_may_be_named_by_its_variable() -> None:
    """``twist`` is what it sets, ``pivot.command``, at the step that is looked at: plans cost the same."""
    made = Planner(problem_of_tables({**TABLES, **with_cost(at="always", squares="twist")}, "pendulum"), threads=1)
    assert made.first(made.start, 0.0).cost == pytest.approx(planner().first(planner().start, 0.0).cost, rel=1e-12)


@pytest.mark.thorough
def test_an_input_that_a_force_law_adds_to_may_stand_beside_a_state() -> None:
    """At the end of a step it is that of the step, which follows from the state before: a named part is too."""
    brake = {"name": "brake", "on": "bob.torque", "value": "-brake.c * bob.angular_velocity", "numbers": {"c": 0.1}}
    push = {"name": "push", "sets": "bob.torque[1]", "knots": 20}
    tables = {**TABLES, "force": [brake], "variable": [*TABLES["variable"], push]}
    whole, part = (
        Planner(problem_of_tables({**tables, **with_cost(at="always", squares=squares)}, "p"), threads=1)
        for squares in ("bob.position[2] * bob.torque[1]", "bob.position[2] * push")
    )
    costs = [made.first(made.start, 0.0).cost for made in (whole, part)]
    assert np.isfinite(costs).all() and costs[0] != pytest.approx(costs[1], rel=1e-6)
    for made in (whole, part):
        found = made.first(made.start, 0.0)
        z = np.zeros(40)
        z[made._new] = found.v
        made.stages.begin(made.start, 0.0)
        rolled = made.stages.roll_out(z, 0.0)
        batch = MotionBatch(z[None], rolled.x[None], rolled.u[None])
        assert made._costs(batch)[0] == pytest.approx(found.cost, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (with_cost(at="end", squares="twist"), r'cost "effort".at: .*"always"'),
        (with_cost(at="always", squares="twist[3]"), "the name of a variable is its value at one instant"),
        ({"mpc": None}, "there is no such table"),
        ({"variable": [{"name": "push", "sets": "bob.velocity[0]"}]}, "decides forces, torques and commands only"),
        ({"cost": [{"name": "then", "at": 0.5, "squares": "pivot.angle"}]}, "a horizon moves on"),
    ],
)
def test_what_makes_no_sense_is_named(change: dict[str, object], said: str) -> None:
    tables = {key: value for key, value in {**TABLES, **change}.items() if value is not None}
    with pytest.raises(ProblemError, match=said):
        Planner(problem_of_tables(tables), threads=1)


@pytest.mark.parametrize(
    ("mpc", "said"),
    [
        ({"dt": 0.07}, "no whole number of steps"),
        ({"rate": 0.5}, "ticks are 2 s apart"),
        ({"plant": {"latency": "none"}}, "latency"),
        ({"rates": 3}, "rates"),
    ],
)
def test_faults_of_the_table_are_named(mpc: dict[str, object], said: str) -> None:
    with pytest.raises(ProblemError, match=said):
        pendulum(**mpc)
