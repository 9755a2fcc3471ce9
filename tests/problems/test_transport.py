"""A cart carries a box by friction, and lets it slide: closed forms of the carrying, the slip and the whole motion."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import seeds, shipped, solve

from symphys.verification.refinement import FINER_DT, finer_problem

FRICTION, GRAVITY, CART, BOX = 0.2, 9.81, 2.0, 1.0
LIMIT = FRICTION * GRAVITY
"""[m/s^2] The largest acceleration that friction gives to the box."""


@pytest.mark.parametrize("share", [0.95, 1.3])
def test_friction_carries_the_box_with_mu_g_at_most(share: float) -> None:
    """Below the limit both move as one; above it the box has the limit, and the cart what is left of the push."""
    made = shipped("transport", "casadi")
    push = share * LIMIT * (CART + BOX)
    motion = made.simulate(np.full(41, push))
    after = 30  # steps, in which the box stays on the cart
    time = motion.time[after]
    box, cart = motion["box.velocity"][after, 0] / time, motion["cart.velocity"][after, 0] / time
    expected = (push / (CART + BOX),) * 2 if share < 1 else (LIMIT, (push - LIMIT * BOX) / CART)
    assert (box, cart) == pytest.approx(expected, rel=1e-3)
    assert abs(motion["box_pitch.angle"][after]) < 1e-3


@pytest.mark.parametrize("share", [0.98, 1.1])
def test_the_fastest_move_without_a_slip(share: float) -> None:
    """Bang-bang control at the limit of friction: d = (T / 2)^2 mu g, of which ramps of 0.1 s leave 9 tenths."""
    made = shipped("transport", "casadi")
    pushes = share * LIMIT * (CART + BOX) * np.array([0.0, *[1.0] * 9, 0.0, *[-1.0] * 9, *[0.0] * 21])
    motion = made.simulate(pushes)
    moved = np.ptp(motion["cart.position"][:, 0])
    slid = motion["box.position"][-1, 0] - motion["cart.position"][-1, 0] + 0.3
    if share < 1:
        assert moved == pytest.approx(0.9 * share * LIMIT, rel=5e-3)
        assert motion["cart.velocity"][-1, 0] == pytest.approx(0, abs=2e-3)
        assert slid == pytest.approx(0, abs=2e-3)
    else:
        assert np.abs(motion["box.position"][:, 0] - motion["cart.position"][:, 0] + 0.3).max() > 0.01


@pytest.mark.thorough
@seeds(3)
def test_the_box_slides_to_the_other_end_and_half_the_step_agrees(seed: int) -> None:
    made = shipped("transport")
    found = solve("ilqr", made, seed)
    assert made.judge(found.z).solved
    assert finer_problem(made, FINER_DT).judge(found.z).worst < 1.0
    motion = made.simulate(found.z)
    speed = motion["box.velocity"][:, 0]
    assert np.abs(np.diff(speed) / np.diff(motion.time)).max() < 1.05 * LIMIT
    assert np.ptp(motion["box.position"][:, 2]) < 1e-3
