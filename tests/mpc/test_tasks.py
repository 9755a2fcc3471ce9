"""The shipped controllers do their tasks with a plant of another step whose masses are 10 % off."""

from __future__ import annotations

import pytest

from symphys.mpc import Controller, Plant, close_loop, record_of
from symphys.problem import load_problem
from symphys.problems import find


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "latency"), [("acrobot", 0.002), ("spinner", 0.003), ("mini_cheetah_mpc", 0.01)])
def test_the_task_is_done(name: str, latency: float) -> None:
    """Plans are ready ``latency`` [s] after they were asked for, whatever this machine does meanwhile."""
    problem = load_problem(find(name), {"mpc.plant.masses": 1.1, "mpc.plant.latency": latency})
    plant = Plant(problem)
    assert plant.dt <= problem.simulation.dt / 2
    record = record_of(close_loop(Controller(problem, threads=1), plant))
    assert record.done
