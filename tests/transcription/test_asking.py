"""The same steps with another objective: what misses by its tolerance counts 1, and what it costs hardly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from symphys.problem import problem_of_tables
from symphys.shooting import StagedProblem
from symphys.transcription import Transcription, transcribe
from symphys.transcription.asking import COST_SHARE, LASTING
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.staged_problem import RolloutStages

TABLES: dict[str, Any] = {
    "simulation": {"duration": 0.4, "dt": 0.02},
    "body": [{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 0.5, "position": [0, 0, 2]}],
    "variable": [{"name": "push", "sets": "ball.force[0]", "knots": 4, "guess": [1, -2, 0.5, 3]}],
    "cost": [{"name": "effort", "at": "always", "squares": "ball.force[0]", "weight": 300.0}],
    "target": [{"name": "there", "value": "ball.position[0] - 0.5", "tolerance": 0.01, "weight": 7.0}],
    "constraint": [
        {"name": "low", "at": "end", "value": "ball.position[2]", "upper": 1.1, "tolerance": 0.02},
        {"name": "slow", "at": "always", "value": "ball.velocity[2]", "lower": -1.0, "tolerance": 0.1},
    ],
    "objective": {"stop": "converged"},
}


@pytest.fixture(scope="module")
def made() -> Transcription:
    """With a cost that is far larger than the rest."""
    return transcribe(problem_of_tables(TABLES), backend="casadi")


def asked(made: Transcription, z: Any) -> StagedProblem:
    """The steps with the objective of what is asked for."""
    assert made.shooting.asking is not None
    return made.shooting.asking(z)


def test_what_misses_by_its_tolerance_counts_one(made: Transcription) -> None:
    z = made.shooting.start(0)
    staged, motion = asked(made, z), made.steps().motion(z, 0.0)
    objective, limits = staged.measure(z[None], motion.x[None], motion.u[None])
    error = made.shooting.evaluator.value(z[None], 0.0).errors[0][0]
    assert error**2 < objective[0] <= error**2 + COST_SHARE
    beyond = limits[0] - np.clip(limits[0], staged.lower, staged.upper)
    for limit, where in ((0.02, slice(0, 1)), (0.1, slice(1, None))):
        steps = 1 if limit == 0.02 else LASTING * 0.4 / 0.02
        assert staged.penalties[where] == pytest.approx(limit**-2 / steps)
    assert beyond.any()


def test_costs_are_never_raised(made: Transcription) -> None:
    """Those of a small push count as they are, times a power of ten that is at most 1."""
    z = 1e-6 * made.shooting.start(0)
    staged, motion = asked(made, z), made.steps().motion(z, 0.0)
    objective, _ = staged.measure(z[None], motion.x[None], motion.u[None])
    values = made.shooting.evaluator.value(z[None], 0.0)
    costs = values.objective[0] - 7.0 * (values.errors[0][0] * 0.01) ** 2
    assert objective[0] - values.errors[0][0] ** 2 == pytest.approx(costs, rel=1e-3)


def test_its_steps_are_those_of_the_problem(made: Transcription) -> None:
    z = made.shooting.start(0)
    first, second = asked(made, z), asked(made, 1.1 * z)
    assert first is second
    expected, found = made.steps().motion(z, 0.0), first.roll_out(z, 0.0)
    assert np.array_equal(found.x[:, : expected.x.shape[1]], expected.x)


def test_other_weights_share_functions_and_change_nothing_else(made: Transcription) -> None:
    """As the steps of the same problem with these weights, which are made anew."""
    z, staged = made.shooting.start(0), asked(made, made.shooting.start(0))
    assert isinstance(staged, RolloutStages)
    own = RolloutStages(symbolic_rollout(staged.rollout.problem, timed=True), backend="casadi")
    motion, multipliers = own.roll_out(z, 0.0), np.zeros(len(own.penalties))
    assert np.array_equal(staged.penalties, own.penalties)
    ours, fresh = (each.expand(motion, multipliers, own.penalties) for each in (staged, own))
    for field in ("x", "u", "xx", "uu", "ux"):
        assert np.array_equal(getattr(ours, field), getattr(fresh, field)), field
    measured = [each.measure(z[None], motion.x[None], motion.u[None]) for each in (staged, own, made.shooting.staged())]
    assert np.array_equal(measured[0][0], measured[1][0]) and np.array_equal(measured[0][1], measured[1][1])
    assert measured[0][0] != pytest.approx(measured[2][0]), "the weights must differ"


def test_nothing_is_asked_for_where_there_is_only_a_cost() -> None:
    tables = {name: value for name, value in TABLES.items() if name not in ("target", "constraint")}
    assert transcribe(problem_of_tables(tables), backend="casadi").shooting.asking is None
