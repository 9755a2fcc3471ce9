"""A contact whose body a joint holds along the normal, for the instant in which it passes the upright."""

from __future__ import annotations

import numpy as np
import pytest
from laboratory import Lab
from linkage import ABOUT_Y, Array

from symphys.joints import HINGE, Joint, Socket
from symphys.shapes import Capsule, Plane
from symphys.world import Body, Scheme, World, make_world

PIVOT, ARM, RATE = 0.75, 0.25, 0.4


def standing(cuts: int, ground: bool) -> Lab:
    """A rod that stands on a hinge at PIVOT, which turns about y."""
    rod = Body("rod", 1.0, (0.02, 0.02, 0.001), (Capsule(0.03, 0.2),))
    made = make_world([rod], [Plane.ground()] if ground else [])
    joint = Joint("pivot", HINGE, 0, None, (Socket((0, 0, -ARM), ABOUT_Y), Socket((0, 0, PIVOT), ABOUT_Y)))
    return Lab(World(made.bodies, made.statics, made.pairs, joints=(joint,)), Scheme(dt=0.01, cuts=cuts))


def swung(lab: Lab, start: float) -> Array:
    """(steps + 1, 3) [m]: where the rod goes from an angle [rad] against the upright, towards it."""
    along = np.array([np.sin(start), 0, np.cos(start)])
    values = {
        "rod.position": [0, 0, PIVOT] + ARM * along,
        "rod.orientation": [np.cos(start / 2), 0, np.sin(start / 2), 0],
        "rod.angular_velocity": [0, RATE, 0],
        "rod.velocity": RATE * ARM * np.array([along[2], 0, -along[0]]),
    }
    return lab.states(values, 0.04)["rod.position"]


@pytest.mark.parametrize("cuts", [0, 1, 2])
def test_a_rod_passes_the_upright_high_above_the_ground(cuts: int) -> None:
    """As if there were no ground, wherever in a step it is upright."""
    with_ground, without = (standing(cuts, ground) for ground in (True, False))
    for start in np.linspace(-0.008, 0, 9):
        assert swung(with_ground, start) == pytest.approx(swung(without, start), abs=1e-5)
