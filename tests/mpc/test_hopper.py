"""The planar hopper under its controller: it stands, and hops to its goal with a plant that is heavier."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.mpc import Controller, Plant, close_loop, record_of
from symphys.problem import load_problem
from symphys.problems import find

OFF = {"mpc.plant.masses": 1.1, "mpc.plant.latency": 0.004}
"""Masses and inertias 10 % off, and plans that are ready 4 ms after they were asked for."""


@pytest.mark.thorough
def test_it_follows_its_way_without_a_fall() -> None:
    """In the first 0.4 s, in which the line goes 5 cm: within 5 cm of it, in its pose to 0.3 rad."""
    problem = load_problem(find("planar_hopper_mpc"), {**OFF, "mpc.duration": 0.4})
    controller = Controller(problem, threads=1)
    plant = Plant(problem)
    loop = close_loop(controller, plant)
    motion = plant.motion(loop.time, loop.x, loop.u)
    share = loop.time / 2
    line = 0.5 * share**2 * (3 - 2 * share)
    assert np.abs(motion["ahead.position"].ravel() - line).max() < 0.05
    assert motion["ahead.position"].ravel()[-1] > 0.02, "it stays where it was"
    assert np.abs(motion["pitch.angle"] - 0.3).max() < 0.3
    assert not loop.stopped and loop.gained.mean() > 0.9


@pytest.mark.thorough
def test_it_hops_to_its_goal_and_stands_there() -> None:
    """Half a metre ahead in its pose for the last second, in flight on the way."""
    problem = load_problem(find("planar_hopper_mpc"), OFF)
    plant = Plant(problem)
    loop = close_loop(Controller(problem, threads=1), plant)
    record = record_of(loop)
    assert record.done and record.held > 1.0
    motion = plant.motion(loop.time, loop.x, loop.u)
    tilt = sum(motion[f"{name}.angle"].ravel() for name in ("pitch", "knee", "ankle"))
    soles = [motion["foot.position"][:, 2] + along * np.sin(tilt) - 0.03 for along in (0.1, -0.1)]
    assert np.min(soles, axis=0).max() > 0.01, "it never leaves the ground"
    assert np.abs(motion["ahead.rate"].ravel()[-100:]).max() < 0.1
