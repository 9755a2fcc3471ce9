"""Phases: costs and constraints of a stretch of the motion, instants at its ends; what cannot be is said."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from symphys.codegen import interpret
from symphys.errors import ProblemError
from symphys.problem import problem_of_tables
from symphys.transcription import rollout_program, transcribe
from symphys.transcription.open_step import compile_open_step

TABLES: dict[str, Any] = {
    "simulation": {"duration": 0.5, "dt": 0.01},
    "body": [{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 0.5, "position": [0, 0, 1]}],
    "phase": [{"name": "push", "until": 0.2}, {"name": "short", "share": 0.5}, {"name": "flight"}],
    "variable": [
        {"name": "throw", "sets": "ball.velocity", "guess": [1, 0.5, 0.2]},
        {"name": "force", "sets": "ball.force[0]", "knots": 50, "guess": 1},
    ],
    "cost": [
        {"name": "push", "during": "push", "squares": "[ball.velocity, ball.force[0]]"},
        {"name": "short", "during": "short", "squares": "[ball.velocity, ball.force[0]]"},
        {"name": "flight", "during": "flight", "squares": "[ball.velocity, ball.force[0]]"},
        {"name": "all", "at": "always", "squares": "[ball.velocity, ball.force[0]]"},
    ],
    "target": [{"name": "take off", "at": "end of push", "value": "ball.position", "tolerance": 0.01}],
    "constraint": [{"name": "high", "during": "short", "value": "ball.position[2]", "lower": 0.99}],
    "output": [
        {"name": "from", "at": "start of short", "value": "time"},
        {"name": "to", "at": "end of short", "value": "time"},
        {"name": "last", "at": "end of flight", "value": "time"},
    ],
}


def test_phases_add_up_and_begin_and_end_where_they_say() -> None:
    made = transcribe(problem_of_tables(TABLES), backend="casadi")
    z = made.shooting.start(0)
    judged, motion = made.judge(z), made.simulate(z)
    costs = judged.costs
    assert costs["push"] + costs["short"] + costs["flight"] == pytest.approx(costs["all"], rel=1e-13)
    squares = (motion.velocity[:, 0] ** 2).sum(axis=1)
    inside = 0.01 * ((squares[20:25] + squares[21:26]).sum() / 2 + 5)
    assert costs["short"] == pytest.approx(inside, rel=1e-12)
    assert list(judged.outputs.values()) == pytest.approx([0.2, 0.25, 0.5], rel=1e-12)
    take_off, high = judged.checks
    assert take_off.error == pytest.approx(np.linalg.norm(motion.position[20, 0]), rel=1e-12)
    assert high.error == pytest.approx(0.99 - motion.position[21:26, 0, 2].min(), rel=1e-12)
    assert made.shooting.constraint_lower.size == 5


def test_phases_are_the_same_on_a_finer_grid_and_scale_with_a_free_duration() -> None:
    problem = problem_of_tables(TABLES)
    finer = replace(problem, simulation=replace(problem.simulation, dt=0.005))
    made = transcribe(finer, backend="casadi")
    assert list(made.judge(made.shooting.start(0)).outputs.values()) == pytest.approx([0.2, 0.25, 0.5])
    shares = [{"name": "push", "share": 0.4}, {"name": "short", "share": 0.5}, {"name": "flight"}]
    free = {"name": "T", "sets": "simulation.duration", "guess": 1.0}
    tables = {**TABLES, "phase": shares, "variable": [*TABLES["variable"], free]}
    made = transcribe(problem_of_tables(tables), backend="casadi")
    judged = made.judge(made.shooting.start(0))
    assert list(judged.outputs.values()) == pytest.approx([0.4, 0.5, 1.0])
    costs = judged.costs
    assert costs["push"] + costs["short"] + costs["flight"] == pytest.approx(costs["all"], rel=1e-13)


WADING: dict[str, Any] = {
    "simulation": {"duration": 1.0, "dt": 0.005},
    "world": {"gravity": [0, 0, 0]},
    "body": [{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 0.5}],
    "phase": [{"name": "air", "share": 0.4}, {"name": "water", "share": 0.9}, {"name": "beyond"}],
    "force": [
        {"name": "drag", "on": "ball.force", "during": "water", "value": "-1.5 * ball.velocity"},
        {"name": "jet", "on": "ball.force[2]", "during": "beyond", "value": "2"},
    ],
    "variable": [{"name": "throw", "sets": "ball.velocity", "guess": [3, 0, 0]}],
    "cost": [{"name": "place", "value": "sumsqr(ball.position - [1, 0, 0])"}],
    "output": [{"name": "far", "value": "ball.position[0]"}],
}
"""Nothing acts in air, drag in water, a jet beyond."""


@pytest.mark.parametrize("duration", [1.0, 1.6])
def test_a_force_acts_in_its_phase_alone(duration: float) -> None:
    """Against x = v t, then v m / c (1 - exp(-c t / m)), then a steady velocity; the jet gives t^2 / 2 F / m."""
    free = {"name": "T", "sets": "simulation.duration", "guess": duration}
    more = [] if duration == 1.0 else [free]
    problem = problem_of_tables({**WADING, "variable": [*WADING["variable"], *more]})
    made = transcribe(problem, backend="casadi")
    z = made.shooting.start(0)
    motion = made.simulate(z)
    air, water, beyond = 0.4 * duration, 0.5 * duration, 0.1 * duration
    slowed = 3 * np.exp(-1.5 * water / 0.5)
    far = 3 * air + (3 - slowed) * 0.5 / 1.5 + slowed * beyond
    assert motion.position[80, 0, 0] == pytest.approx(3 * air, rel=1e-12)
    assert motion.position[-1, 0, 0] == pytest.approx(far, rel=1e-4)
    assert motion.position[-1, 0, 2] == pytest.approx(beyond**2 / 2 * 2 / 0.5, rel=1e-9)
    assert np.all(motion.force[80:180, 0, 2] == 0)
    assert np.all(motion.force[:80, 0, 0] == 0)
    assert np.all(motion.force[80:180, 0, 0] < 0)
    program = rollout_program(made.rollout)
    assert interpret(program, z, [0.0])["merit"] == pytest.approx(made.judge(z).objective, rel=1e-12)


FREE = {"name": "T", "sets": "simulation.duration"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"output": [{"name": "o", "at": "end of flght", "value": "time"}]},
            r'"o".at: .*"flght"',
        ),
        ({"cost": [{"name": "c", "during": "fligt", "value": "time"}]}, r'"c".during: .*"flight"'),
        ({"cost": [{"name": "c", "during": "push", "at": "always", "value": "time"}]}, r"stands instead of at"),
        ({"cost": [{"name": "c", "during": "push", "value": "end.time"}]}, r"is of the whole motion"),
        ({"phase": [{"name": "push"}, {"name": "short"}, {"name": "flight"}]}, r'phase "push".until: .*needed'),
        ({"phase": [{"name": "push", "until": 0.2, "share": 0.2}]}, r"stands instead of until"),
        ({"phase": [{"name": "push", "until": 0.205}]}, r"falls between two steps"),
        (
            {"phase": [{"name": "push", "until": 0.3}, {"name": "short", "until": 0.2}]},
            r'"short".until: .*before',
        ),
        (
            {"force": [{"name": "f", "on": "ball.force[0]", "value": "1", "during": "pusch"}]},
            r'force "f".during: .*"push"',
        ),
        ({"phase": []}, r"there is no \[\[phase\]\]"),
        ({"variable": [FREE]}, r'"push".until: .*variable'),
    ],
)
def test_what_cannot_be_names_table_and_key(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        problem_of_tables({**TABLES, **change})


@pytest.mark.parametrize(
    "tables",
    [
        TABLES,
        {**WADING, "variable": [{"name": "push", "sets": "ball.force", "knots": 200, "guess": [0.3, 0, 0.1]}]},
    ],
    ids=["costs", "forces"],
)
def test_single_steps_know_their_phase(tables: dict[str, Any]) -> None:
    """Costs of all steps of a horizon add up to the objective of the whole motion, whose last state they reach."""
    problem = problem_of_tables({**tables, "constraint": []})
    step, made = compile_open_step(problem, backend="casadi"), transcribe(problem, backend="casadi")
    state, total = step.start().state, 0.0
    knots = np.concatenate([v.guess.reshape(step.steps, -1) for v in problem.variables if v.kind == "control"], axis=1)
    for action in knots:
        state, _, cost = step(state, action[None])
        total += cost[0]
    z = made.shooting.start(0)
    assert total == pytest.approx(made.judge(z).objective, rel=1e-12)
    assert state[0, step.columns["ball.position"]] == pytest.approx(made.simulate(z).position[-1, 0], abs=1e-12)
