"""Problems about whole motions and their phases, or whose duration is free, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, solve
from tools.repeats import first

from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import transcribe

GRAVITY = 9.81


@first("solver", ["ilqr", "multiple_shooting", "least_squares"])
def test_the_bounce_repeats_itself(solver: str) -> None:
    """Solved to the end: what meets the target, 1e-3 m/s, may be off by 2e-4 m, 3.9 m/s at the ground over 2 g."""
    found = solve(solver, shipped("bounce_cycle"), polish=True)
    height, speed = found.z
    assert height == pytest.approx(0.1 + GRAVITY * 0.8**2 / 8, abs=1e-4)
    assert speed == pytest.approx(1.2 / 0.8, abs=1e-4)


@first("solver", ["ilqr", "multiple_shooting", "ipopt"])
def test_the_push_of_least_cost_of_transport_falls_linearly(solver: str) -> None:
    made = shipped("cost_of_transport")
    found = solve(solver, made)
    least = 2 * np.sqrt(3 * 5 * 0.02) / (4 * GRAVITY)
    assert made.judge(found.z).objective == pytest.approx(least, rel=1e-4)
    first = np.sqrt(3 * 5 / 0.02)
    assert found.z == pytest.approx(np.linspace(first, 0, 21), abs=0.01 * first)


@first("solver", ["ilqr", "multiple_shooting", "ipopt"])
def test_the_fastest_move_is_bang_bang(solver: str) -> None:
    """Multiple shooting ends with a barrier, which keeps the push off its bounds: less with a lower tolerance."""
    exactly = {"solver.multiple_shooting.tolerance": 1e-8} if solver == "multiple_shooting" else {}
    made = transcribe(load_problem(find("fastest_move"), exactly))
    found = solve(solver, made)
    assert found.z[0] == pytest.approx(2 * np.sqrt(1.5 * 2 / 10), abs=1e-6)
    assert found.z[1:] == pytest.approx(np.repeat([10.0, -10.0], 10), abs=1e-4)
    assert made.simulate(found.z).time[-1] == pytest.approx(found.z[0])


@first("solver", ["multiple_shooting", "ilqr", "ipopt"])
def test_the_push_before_the_flight_falls_linearly(solver: str) -> None:
    made = shipped("push_and_fly")
    found = solve(solver, made)
    slope = 3 * 2 * (0.5 + GRAVITY / 2) / (1 - 0.6**3)
    middles = (np.arange(20) + 0.5) / 50
    assert found.z[:20] == pytest.approx(slope * (1 - middles), abs=0.05)
    assert found.z[20:] == pytest.approx(0, abs=1e-3)


@first("solver", ["ilqr", "multiple_shooting", "least_squares"])
def test_the_brake_takes_what_two_velocities_and_the_way_ask_for(solver: str) -> None:
    """Coasting, an exponential decay, coasting: the way of the decay is that of the logarithmic mean."""
    made = shipped("eddy_brake", "casadi")
    speed, strength = solve(solver, made).z
    mean = (speed - 0.5) / np.log(speed / 0.5)
    assert 0.4 * speed + 0.4 * mean + 0.2 * 0.5 == pytest.approx(1.5, abs=2e-4)
    assert strength == pytest.approx(2 * np.log(speed / 0.5) / 0.4, rel=1e-3)


@first("solver", ["least_squares", "ilqr"])
def test_a_sled_stops_where_friction_of_ice_and_asphalt_lets_it(solver: str) -> None:
    """v - mu g t / 2 on ice, then w^2 / 2 mu' g."""
    made = shipped("ice_and_asphalt", "casadi")
    found = solve(solver, made)
    speed, roughness = found.z
    edge = made.judge(found.z).outputs["speed at the edge [m/s]"]
    assert speed == pytest.approx(2 + 0.05 * 9.81 / 2, abs=2e-4)
    assert edge == pytest.approx(speed - 0.05 * 9.81, rel=1e-9)
    assert roughness == pytest.approx((2 - 0.05 * 9.81 / 2) ** 2 / 9.81, abs=2e-4)
