"""A contact whose body a joint holds along the normal, for the instant in which it passes the upright."""

from __future__ import annotations

import numpy as np
import pytest
from tools.laboratory import Lab
from worlds.linkage import ABOUT_Y

from symphys.model.joints import HINGE, Joint, JointFrame
from symphys.model.shapes import Capsule, Plane
from symphys.model.world import Body, Scheme, World, make_world
from symphys.types import Array

PIVOT, ARM, RATE = 0.75, 0.25, 0.4


def standing(cuts: int, ground: bool, pivot: float = PIVOT, time_of_impact: bool = True) -> Lab:
    """A rod that stands on a hinge at this height, which turns about y."""
    rod = Body("rod", 1.0, (0.02, 0.02, 0.001), (Capsule(0.03, 0.2),))
    made = make_world([rod], [Plane.ground()] if ground else [])
    joint = Joint("pivot", HINGE, 0, None, (JointFrame((0, 0, -ARM), ABOUT_Y), JointFrame((0, 0, pivot), ABOUT_Y)))
    scheme = Scheme(dt=0.01, cuts=cuts, time_of_impact=time_of_impact)
    return Lab(World(made.bodies, made.statics, made.pairs, joints=(joint,)), scheme)


def swung(lab: Lab, start: float, pivot: float = PIVOT, rate: float = RATE) -> dict[str, Array]:
    """Where the rod goes from an angle [rad] against the upright, turning at ``rate`` [rad/s]."""
    along = np.array([np.sin(start), 0, np.cos(start)])
    values = {
        "rod.position": [0, 0, pivot] + ARM * along,
        "rod.orientation": [np.cos(start / 2), 0, np.sin(start / 2), 0],
        "rod.angular_velocity": [0, rate, 0],
        "rod.velocity": rate * ARM * np.array([along[2], 0, -along[0]]),
    }
    return lab.states(values, 0.04)


@pytest.mark.slow
@pytest.mark.parametrize("cuts", [0, 1, 2])
def test_a_rod_passes_the_upright_high_above_the_ground(cuts: int) -> None:
    """As if there were no ground, wherever in a step it is upright."""
    with_ground, without = (standing(cuts, ground) for ground in (True, False))
    for start in np.linspace(-0.008, 0, 9):
        positions = [swung(lab, start)["rod.position"] for lab in (with_ground, without)]
        assert positions[0] == pytest.approx(positions[1], abs=1e-5)


@pytest.mark.slow
def test_a_rod_that_turns_far_within_a_step_is_not_pulled_into_the_ground() -> None:
    """Half a step later a push at its tip would speed up the approach; it used to gain any speed by that."""
    low = 0.476
    lab = standing(0, True, pivot=low, time_of_impact=False)
    for rate in (30, 60, 90):
        for before in np.linspace(0, 0.4, 9):
            found = swung(lab, np.pi - before, pivot=low, rate=rate)
            assert np.abs(found["rod.angular_velocity"]).max() < 1.5 * rate
