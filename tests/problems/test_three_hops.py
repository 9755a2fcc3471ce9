"""Three hops of a leg on a spring, by commands alone."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from shipped import Array, met, shipped

from symphys.trajectory import Trajectory

GRAVITY, RADIUS, STEP, KNOTS = 9.81, 0.05, 0.01, 41


def flights(motion: Trajectory) -> list[tuple[float, float]]:
    """Seconds without contact, and the rise of the foot [m], of each flight of 0.1 s at least that has ended."""
    touches = np.flatnonzero(motion["foot-ground.force"][:, 2] > 0)
    height: Array = motion["foot.position"][:, 2]
    long = [(a, b) for a, b in pairwise(touches) if motion.time[b] - motion.time[a] >= 0.1]
    return [(float(motion.time[b] - motion.time[a]), float(height[a:b].max() - RADIUS)) for a, b in long]


def test_with_its_leg_straight_down_the_guess_hops_on_the_spot() -> None:
    """The leg is stretched in flight, so the foot rises by g t^2 / 8 in a flight of t; nothing tips it over."""
    made = shipped("three_hops", "casadi")
    thrust = made.shooting.start(0)[:KNOTS]
    motion = made.simulate(np.concatenate([thrust, np.zeros(KNOTS)]))
    found = flights(motion)
    assert len(found) == 3
    for seconds, rise in found:
        assert rise == pytest.approx(GRAVITY * seconds**2 / 8, abs=GRAVITY * seconds * STEP / 2)  # two steps
    assert np.abs(motion["foot.position"][:, 0]).max() < 1e-9
    assert np.abs(motion["pitch.angle"]).max() < 1e-9


@pytest.mark.thorough
def test_three_hops_in_a_row() -> None:
    """From one seed of three: three flights, and a foot that stays where it lands."""
    made = shipped("three_hops")
    (found,) = met("ilqr", made, of=3, wanted=1)
    motion = made.simulate(found.z)
    assert made.judge(found.z).solved
    assert len(flights(motion)) >= 3
    foot = motion["foot.position"]
    for k in (1, 2, 3):
        at = int(np.argmin(np.abs(motion.time - (0.25 + 0.6 * k if k < 3 else 2.0))))
        assert foot[at] == pytest.approx([0.3 * k, 0, RADIUS], abs=0.041)
