"""Balls of shipped problems fly on parabolas and bounce as restitution says."""

from __future__ import annotations

import numpy as np
import pytest
from data.bouncing import bouncing_height
from data.shipped import shipped
from worlds import flights, slides

import symphys
from symphys.problem import load_problem
from symphys.problems import find

GRAVITY = 9.81
HEIGHTS, RADIUS, RESTITUTION, NOISE = (1.0, 0.7, 1.3), 0.05, 0.75, 0.002
"""Of the recorded bounces: where the ball is let go [m], its radius [m], and the noise of its height [m]."""


@pytest.mark.slow
def test_there_is_a_way_into_the_basket_without_the_board() -> None:
    """A parabola straight into the ring: nothing touches the ball on its way."""
    start, ring, time = flights.BASKET_START, flights.RING, flights.BASKET_TIME
    throw = (ring - start - flights.GRAVITY * time**2 / 2) / time
    np.testing.assert_allclose(throw, [1.692, -1.385, 7.107], rtol=0, atol=5e-4)
    made = shipped("basket", "casadi")
    assert made.judge(throw).solved
    motion = made.simulate(throw)
    assert motion.contact_gap[motion.time <= time].min() > 0


def test_the_formula_of_the_stairs() -> None:
    """Down from one apex and up to the next takes the period."""
    fall, rise = (np.sqrt(2 * height / GRAVITY) for height in (flights.APEX + flights.RISER, flights.APEX))
    assert fall + rise == pytest.approx(flights.PERIOD, rel=1e-12)
    np.testing.assert_allclose([flights.RESTITUTION, flights.APEX], [0.7565, 0.2275], rtol=0, atol=5e-5)


@pytest.mark.slow
def test_without_a_hand_the_dribbled_ball_comes_less_high() -> None:
    """A hand that carries itself only: the ball falls, and comes back to 0.64 of its height."""
    motion = shipped("dribble", "casadi").simulate(np.full(40, GRAVITY))
    height = motion["ball.position"][:, 2] - 0.12
    first = int(np.argmin(height[:60]))
    assert height[first:100].max() == pytest.approx(0.8**2 * (0.9 - 0.12), abs=0.01)


@pytest.mark.thorough
def test_the_guess_catches_the_ball_and_puts_it_elsewhere() -> None:
    """A parabola until the catch; then the ball touches both plates, r / cos(20 degrees) above their seam."""
    made = shipped("catch", "casadi")
    motion = made.simulate(made.shooting.start(0))
    flies = motion.time < 0.55
    time = motion.time[flies]
    flight = np.stack([-1 + 1.6 * time, 1 + 2.6 * time - GRAVITY / 2 * time**2], axis=1)
    np.testing.assert_allclose(motion["ball.position"][flies][:, [0, 2]], flight, atol=1e-9)
    rest = motion["ball.position"][-1] - motion["bowl.position"][-1]
    np.testing.assert_allclose(rest, [0, 0, 0.05 / np.cos(np.deg2rad(20))], atol=1e-3)
    assert abs(motion["bowl.position"][-1, 0] - 1) > 0.4


@pytest.mark.slow
def test_the_last_ball_of_a_row_flies_off_with_the_speed_of_the_formula() -> None:
    """In Huygens' row, in the guess, and without the balls between."""
    assert slides.kept_in_row(slides.ROW) == (pytest.approx((4 / 3) ** 4), pytest.approx(0.300564, abs=1e-6))
    assert slides.kept_in_row([1.6, 0.1])[0] == pytest.approx(1.882, abs=1e-3)
    made = shipped("row_of_balls", "casadi")
    for z in (np.array(slides.ROW[1:-1]), made.shooting.start(0)):
        speed, _ = slides.kept_in_row([1.6, *z, 0.1])
        assert made.simulate(z).velocity[-1, -1, 0] == pytest.approx(speed, rel=1e-12)


def test_recorded_bounces_are_parabolas_with_noise() -> None:
    """The squared residuals of 167 samples, over the noise, are within three deviations of their number."""
    recordings = load_problem(find("bounce_recorded")).recordings
    assert [each.held_back for each in recordings] == [False, False, True]
    residuals = []
    for each, height in zip(recordings, HEIGHTS, strict=True):
        (measured,) = each.measured
        truth = bouncing_height(each.time, height, RADIUS, RESTITUTION)
        residuals.append((measured.values[:, 0] - truth) / NOISE)
        assert measured.noise is not None and measured.noise.tolist() == [NOISE]
    known = np.concatenate(residuals)
    known = known[np.isfinite(known)]
    assert known.size == 167
    assert abs(known @ known - known.size) < 3 * np.sqrt(2 * known.size)


@pytest.mark.parametrize("drop", range(3))
def test_the_engine_predicts_recorded_bounces(drop: int) -> None:
    """With the true numbers, as the parabolas have it; with a restitution that is off by 0.05, not at all."""
    problem = load_problem(find("bounce_recorded"))
    time = problem.recordings[drop].time
    steps = np.round(time / problem.simulation.dt).astype(int)
    errors = []
    for restitution in (RESTITUTION, RESTITUTION + 0.05):
        motion = symphys.simulate(problem, bounce=restitution, let_go=HEIGHTS[drop])
        simulated = motion["ball.position"][steps, 2]
        errors.append(np.abs(simulated - bouncing_height(time, HEIGHTS[drop], RADIUS, RESTITUTION)).max())
    assert errors[0] < NOISE / 10 < 10 * NOISE < errors[1]
