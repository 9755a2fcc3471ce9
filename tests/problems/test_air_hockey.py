"""A pusher knocks a puck to its place, against the laws of what pushes it and of how it slides."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import seeds, shipped, solve

from symphys.verification.refinement import FINER_DT, finer_problem

MASS, DAMPING, HELD, TIME = 0.1, 0.1, 0.05, 2.0
"""Of both discs [kg], of the puck [N s/m], of a command [s], of the motion [s]."""


def test_the_guess_meets_the_puck_in_its_middle() -> None:
    made = shipped("air_hockey", "casadi")
    motion = made.simulate(made.shooting.start(0))
    before = motion.time < np.sqrt(2 * 0.3 * MASS / 0.05)
    np.testing.assert_allclose(motion["pusher_y.position"].ravel()[before], 0.25 * motion.time[before] ** 2, atol=1e-9)
    assert np.abs(motion["puck_x.position"]).max() < 1e-9
    assert motion["puck_y.position"][-1] > 0.2


@pytest.mark.thorough
@seeds(5)
def test_the_puck_comes_to_its_place(seed: int) -> None:
    """The pusher's way to the hit is that of its forces to a step, the puck's from there on that of its damping."""
    made = shipped("air_hockey")
    found = solve("ilqr", made, seed)
    assert made.judge(found.z).solved
    if seed == 0:
        assert finer_problem(made, FINER_DT).judge(found.z).checks[0].error < 0.1
    motion = made.simulate(found.z)
    touching = np.flatnonzero(np.linalg.norm(motion.contact_force, axis=2).sum(axis=1) > 0)
    first, last = int(touching[0]) - 1, int(touching[-1]) + 1
    forces = found.z[:80].reshape(2, 40)
    times, dt = motion.time[: first + 1], made.problem.simulation.dt
    for axis, force in zip("xy", forces, strict=True):
        way = [sum(f / MASS * moved(t - k * HELD) for k, f in enumerate(force)) for t in times]
        late = dt * np.abs(motion[f"pusher_{axis}.rate"][: first + 1]).max()
        np.testing.assert_allclose(motion[f"pusher_{axis}.position"].ravel()[: first + 1], way, atol=late)
        left = TIME - motion.time[last]
        slid = motion[f"puck_{axis}.rate"][last] * MASS / DAMPING * (1 - np.exp(-DAMPING / MASS * left))
        ended = motion[f"puck_{axis}.position"][-1] - motion[f"puck_{axis}.position"][last]
        np.testing.assert_allclose(ended, slid, rtol=0.02)


def moved(time: float) -> float:
    """By 1 m/s^2, for as long as a command is held, from then on at the speed that it gave [m]."""
    pushed = min(max(time, 0.0), HELD)
    return pushed**2 / 2 + pushed * max(time - HELD, 0.0)
