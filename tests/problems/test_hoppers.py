"""Hoppers of shipped problems fall freely in flight, stand on their springs, and forget how they started."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, short_descent, solve
from worlds import hops

from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import transcribe

GRAVITY, KNOTS, STEPS, STARTS = 9.81, 21, 200, 7


@pytest.mark.slow
def test_in_flight_the_centre_of_mass_falls_freely() -> None:
    """Thrust and hip are inner forces: they change neither its fall nor its speed ahead; the trolley does not fall."""
    made = shipped("hopper_gait", "casadi")
    z = made.shooting.start(0)
    z[STARTS + KNOTS :] = np.linspace(0, -3, KNOTS)
    z[STARTS : STARTS + KNOTS] = np.linspace(0, 30, KNOTS)
    motion = made.simulate(z)
    aloft = int(np.argmax(motion["foot-ground.force"][:, 2] > 0))
    assert aloft >= 30
    time = motion.time[:aloft]
    ahead = sum(mass * motion[f"{name}.velocity"][:aloft, 0] for name, mass in hops.GAIT.items())
    assert ahead == pytest.approx(np.full(aloft, ahead[0]), rel=1e-6)
    falling = {name: mass for name, mass in hops.GAIT.items() if name != "trolley"}
    height = hops.of_centre(motion, falling, "position")
    fall = hops.of_centre(motion, falling, "velocity")[0] * time - GRAVITY * time**2 / 2
    assert (height - height[0])[:aloft] == pytest.approx(fall, abs=GRAVITY * time[-1] * (time[1] - time[0]))


@pytest.mark.thorough
def test_the_second_hop_is_like_the_first() -> None:
    """The commands of one period, step by step and twice: the second hop follows the first.

    It does so to 5e-3, since the forces that a step hands to the next are no part of what is closed.
    """
    made = shipped("hopper_gait")
    z = solve("ipopt", made).z
    motion = made.simulate(z)
    twice = {"simulation.duration": 0.8, "variable.0.upper": 1.2, "variable.0.guess": 0.8}
    held = {
        f"variable.{k}.{key}": value for k in (7, 8) for key, value in (("knots", 400), ("interpolation", "constant"))
    }
    both = transcribe(
        load_problem(find("hopper_gait"), twice | held | {"variable.7.guess": 0.0}), backend="casadi"
    )  # fmt: skip
    at = (np.arange(STEPS) + 0.5) * (KNOTS - 1) / STEPS
    thrust, swing = (np.interp(at, np.arange(KNOTS), z[STARTS + k * KNOTS :][:KNOTS]) for k in (0, 1))
    again = both.simulate(np.concatenate([[2 * z[0]], z[1:STARTS], np.tile(thrust, 2), np.tile(swing, 2)]))
    for name in hops.PERIODIC:
        assert again[name][STEPS] == pytest.approx(motion[name][-1], abs=1e-6)
        assert again[name][-1] == pytest.approx(motion[name][-1], abs=5e-3)


@pytest.mark.thorough
def test_a_short_descent_takes_the_jump_nearer() -> None:
    """Starts that are off by 1e-13 end between 0.21 and 0.62 of it."""
    before, after = short_descent("hopper_jump", 40)
    assert after < 0.65 * before


@pytest.mark.thorough
def test_springs_hold_up_the_planar_hopper_in_the_guess() -> None:
    """It stays within 3 cm of its pose, on its foot, and the ground carries its weight."""
    made = shipped("planar_hopper", "casadi")
    motion = made.simulate(made.shooting.start(0))
    assert np.abs(motion["torso.position"][:, [0, 2]] - motion["torso.position"][0, [0, 2]]).max() < 0.03
    assert np.abs(hops.clearance(motion)).max() < 2e-3
    carried = motion.contact_force[-1].sum(axis=0)
    np.testing.assert_allclose(carried, [0, 0, sum(hops.PLANAR_HOPPER.values()) * GRAVITY], atol=0.05)


@pytest.mark.thorough
def test_with_its_leg_straight_down_the_guess_hops_on_the_spot() -> None:
    """Nothing pushes it aside, and in its three flights the centre of mass falls freely: thrust is an inner force."""
    made = shipped("three_hops", "casadi")
    motion = made.simulate(np.concatenate([made.shooting.start(0)[:41], np.zeros(41)]))
    found = hops.flights(motion)
    assert len(found) == 3
    rising = hops.of_centre(motion, hops.HOPPER, "velocity")
    for first, last in found:
        assert np.diff(rising[first + 2 : last - 2]) == pytest.approx(-GRAVITY * 0.005, rel=1e-6)
    assert np.abs(motion["foot.position"][:, 0]).max() < 1e-9


@pytest.mark.slow
def test_three_hops_forget_another_start() -> None:
    """Of 0.3 m/s at the start, with the same commands, less than a twentieth is left after three hops."""
    made = shipped("three_hops", "casadi")
    z = made.shooting.start(0)
    pushed = load_problem(find("three_hops"), {f"body.{k}.velocity": [0.3, 0, 0] for k in range(4)})
    still, moving = made.simulate(z), transcribe(pushed, backend="casadi").simulate(z)
    assert moving["torso.velocity"][0, 0] == pytest.approx(0.3)
    assert moving["torso.velocity"][-1, 0] == pytest.approx(still["torso.velocity"][-1, 0], abs=0.015)
