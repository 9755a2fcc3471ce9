"""Finer time steps are those of the same kernel where nothing in a step depends on their number."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tools.repeats import few
from worlds.features import FEATURES

import symphys
from symphys.problem import problem_of_tables
from symphys.transcription import transcribe, transcribe_finer
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.linearization import Linearization

HEAVY = {"load on two boards", "inertia and centre of mass", "soft joint", "a leg that lands", "loop of joints"}
"""What takes seconds to build."""


@few("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in HEAVY)) for name in FEATURES], 12)
def test_they_lead_where_steps_of_their_own_lead(name: str) -> None:
    problem = problem_of_tables(FEATURES[name])
    half = replace(problem.simulation, dt=problem.simulation.dt / 2)
    known = transcribe(problem, backend="casadi", threads=1)
    shared, own = (
        transcribe_finer(known, half),
        Linearization(symbolic_rollout(replace(problem, simulation=half)), "casadi"),
    )
    z = known.shooting.start(1)
    assert shared.arrays(z).x == pytest.approx(own.motion(z, 0.0).x, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("name", "same"), [("ball_throw", True), ("eddy_brake", False), ("fastest_move", True)])
def test_what_acts_in_a_phase_has_steps_of_its_own(name: str, same: bool) -> None:
    known = transcribe(symphys.load(name), backend="casadi")
    simulation = known.problem.simulation
    finer = transcribe_finer(known, replace(simulation, dt=simulation.dt / 2))
    assert (finer.steps().step is known.steps().step) == same
    z = known.shooting.start(1)
    coarse, fine = known.judge(z).objective, finer.judge(z).objective
    assert abs(coarse - fine) < 0.02 * (1 + abs(coarse))
    own = Linearization(symbolic_rollout(finer.problem), "casadi").motion(z, 0.0)
    assert finer.arrays(z).x == pytest.approx(own.x, rel=1e-9, abs=1e-9)


def test_a_problem_with_scenarios_is_judged_by_steps_of_its_backend() -> None:
    """Its own rollout, without them, is casadi's."""
    tables = {**FEATURES["impacts with friction"]}
    varied = [{"name": "heavy", "sets": "ball.mass", "factor": 0.2}]
    for backend in ("casadi", "auto"):
        made = transcribe(problem_of_tables({**tables, "scenario": varied}), backend=backend)
        assert made.steps().step.backend == backend
