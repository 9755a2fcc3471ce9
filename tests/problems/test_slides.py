"""What slides and rolls in shipped problems is braked as Coulomb says."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped
from scipy.optimize import fsolve
from worlds import slides
from worlds.plate import Plate

from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import transcribe
from symphys.verification.refinement import FINER_DT, finer_problem

GRAVITY, FLOOR = 9.81, 0.35
PARCEL = Plate((0.4, 0.3), 0.01, FLOOR)


@pytest.mark.thorough
def test_the_bank_shot_holds_at_half_the_step() -> None:
    """To half a millimetre."""
    made, stroke = shipped("bank_shot", "casadi"), np.array([1.1299, 0.5717, 7.55, -18.18])
    ends = [each.simulate(stroke).position[-1] for each in (made, finer_problem(made, FINER_DT))]
    assert np.abs(ends[1] - ends[0]).max() < 5e-4


def test_the_formula_of_the_hook() -> None:
    z = fsolve(slides.pocket_missed, [8, 0, -20], xtol=1e-12)
    _, velocity, grip = slides.bowled(z)
    np.testing.assert_allclose(z, [8.310, -0.588, -29.03], rtol=0, atol=5e-3)
    assert grip == pytest.approx(2.289, abs=1e-3)
    surface = np.array([slides.FORWARD_SPIN, -z[2]]) * slides.BALL_RADIUS
    np.testing.assert_allclose(velocity, (5 * z[:2] + 2 * surface) / 7)


@pytest.mark.slow
def test_a_crate_is_knocked_and_slides_as_the_formulas_say() -> None:
    """The crate stands on the floor all the time, and the floor has one step of 10 ms at most to brake the impact."""
    kick = np.array(slides.KICK)
    motion = shipped("knock", "casadi").simulate(kick)
    after = slides.knocked(kick[:2], kick[2] + kick[1] * 0.25 / kick[0])
    np.testing.assert_allclose(after, [2.3990, 0.2716, 2.8353], rtol=0, atol=1e-3)
    k = int(np.argmax(motion.velocity[:, 0, 0] > 1))
    np.testing.assert_allclose(motion.velocity[k, 0, :2], after[:2], rtol=0, atol=0.3 * GRAVITY * 0.01)
    assert motion.velocity[k, 0, 0] < after[0]
    assert motion.angular_velocity[k, 0, 2] == pytest.approx(after[2], abs=0.05)
    x, y, angle = Plate((0.3, 0.4), 0.1, 0.3).slid(after)
    np.testing.assert_allclose(motion.position[-1, 0, :2], [x, y], rtol=0, atol=1e-4)
    q = motion.orientation[-1, 0]
    assert 2 * np.arctan2(q[3], q[0]) == pytest.approx(angle, abs=2e-3)


@pytest.mark.slow
def test_a_plate_goes_as_far_and_turns_as_far_as_the_formulas() -> None:
    """v^2 = 2 mu g s, and four corners at the same distance d brake with mu g d / I, however they share the weight."""
    made, speed = shipped("parcel", "casadi"), np.sqrt(2 * FLOOR * GRAVITY * 2)
    assert made.simulate(np.array([speed, 0, 0])).position[-1, 0, 0] == pytest.approx(2, abs=2e-3)
    assert PARCEL.slid(np.array([speed, 0, 0]))[0] == pytest.approx(2, abs=1e-5)
    brake = FLOOR * GRAVITY * np.hypot(*PARCEL.size) / 2 / PARCEL.inertia
    motion = made.simulate(np.array([0, 0, 5.0]))
    angle = 2 * np.arctan2(motion.orientation[-1, 0, 3], motion.orientation[-1, 0, 0])
    assert angle == pytest.approx(25 / (2 * brake), rel=2e-3)


@pytest.mark.thorough
def test_the_ground_stops_the_pushed_box_as_coulomb_says() -> None:
    """From 1 m/s it slides by v^2 / (2 mu g) without a turn."""
    sliding = load_problem(find("push_box")).set({"body.box.velocity": [1, 0, 0], "body.feet.velocity": [1, 0, 0]})
    made = transcribe(sliding, backend="casadi")
    motion = made.simulate(made.shooting.start(0))
    assert motion["box.position"][-1, 0] == pytest.approx(1 / (2 * 0.5 * GRAVITY), rel=0.02)
    assert np.abs(motion["box.position"][:, 1]).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(("share", "slips"), [(0.9, False), (1.2, True)])
def test_friction_limits_the_acceleration_of_a_glass_on_a_tray(share: float, slips: bool) -> None:
    motion = shipped("fast_tray", "casadi").simulate(np.array([1.0, *np.full(16, share * 0.3 * GRAVITY * 1.3)]))
    ahead = motion["tray.velocity"][-1, 0] - motion["glass.velocity"][-1, 0]
    assert (ahead > 0.1) == slips
    if not slips:
        assert ahead == pytest.approx(0, abs=0.01)


LIMIT, CART, BOX = 0.2 * GRAVITY, 2.0, 1.0
"""[m/s^2] The largest acceleration that friction gives to the transported box; masses [kg]."""


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.95, 1.3])
def test_friction_carries_the_box_with_mu_g_at_most(share: float) -> None:
    """Below the limit both move as one; above it the box has the limit, and the cart what is left of the push."""
    push = share * LIMIT * (CART + BOX)
    motion = shipped("transport", "casadi").simulate(np.full(41, push))
    after = 30  # steps, in which the box stays on the cart
    time = motion.time[after]
    box, cart = motion["box.velocity"][after, 0] / time, motion["cart.velocity"][after, 0] / time
    expected = (push / (CART + BOX),) * 2 if share < 1 else (LIMIT, (push - LIMIT * BOX) / CART)
    assert (box, cart) == pytest.approx(expected, rel=1e-3)
    assert abs(motion["box_pitch.angle"][after]) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.98, 1.1])
def test_the_fastest_move_without_a_slip(share: float) -> None:
    """Bang-bang control at the limit of friction: d = (T / 2)^2 mu g, of which ramps of 0.1 s leave 9 tenths."""
    pushes = share * LIMIT * (CART + BOX) * np.array([0.0, *[1.0] * 9, 0.0, *[-1.0] * 9, *[0.0] * 21])
    motion = shipped("transport", "casadi").simulate(pushes)
    slid = motion["box.position"][:, 0] - motion["cart.position"][:, 0] + 0.3
    if share < 1:
        assert np.ptp(motion["cart.position"][:, 0]) == pytest.approx(0.9 * share * LIMIT, rel=5e-3)
        assert motion["cart.velocity"][-1, 0] == pytest.approx(0, abs=2e-3)
        assert slid[-1] == pytest.approx(0, abs=2e-3)
    else:
        assert np.abs(slid).max() > 0.01


@pytest.mark.slow
def test_the_guess_meets_the_puck_in_its_middle() -> None:
    made = shipped("air_hockey", "casadi")
    motion = made.simulate(made.shooting.start(0))
    before = motion.time < np.sqrt(2 * 0.3 * 0.1 / 0.05)
    np.testing.assert_allclose(motion["pusher_y.position"].ravel()[before], 0.25 * motion.time[before] ** 2, atol=1e-9)
    assert np.abs(motion["puck_x.position"]).max() < 1e-9
    assert motion["puck_y.position"][-1] > 0.2


def test_the_putted_ball_follows_the_green_and_rolls() -> None:
    """It never leaves the ground; when it rolls, speed is spin times radius."""
    motion = shipped("putt", "casadi").simulate(np.array([2.3215, -1.1838]))
    rolling = slice(60, 300)
    assert np.abs(motion.contact_gap[:, 0]).max() < 1e-6
    speed = np.linalg.norm(motion.velocity[rolling, 0], axis=1)
    flat = np.hypot(*motion.angular_velocity[rolling, 0, :2].T)
    np.testing.assert_allclose(speed, 0.02134 * flat, rtol=0.02, atol=1e-3)
