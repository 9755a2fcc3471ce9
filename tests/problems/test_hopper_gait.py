"""A hop that repeats itself: free flight, its cost of transport, and a second hop like the first."""

from __future__ import annotations

import numpy as np
import pytest
from shipped import shipped, solve

from symphys import problems
from symphys.problem import load_problem
from symphys.trajectory import Trajectory
from symphys.transcription import transcribe

GRAVITY, KNOTS, STEPS = 9.81, 26, 50
MASSES = {"trolley": 0.1, "lift": 0.1, "torso": 5.0, "leg": 0.5, "foot": 0.5}
COORDINATES = ("up.position", "pitch.angle", "hip.angle", "thruster.position")
RATES = ("along.rate", "up.rate", "pitch.rate", "hip.rate", "thruster.rate")


def cost_of_transport(motion: Trajectory) -> float:
    """Copper losses and 10 W over weight and distance, by the sums of the motion's own columns."""
    dt = motion.time[1] - motion.time[0]
    losses = 0.02 * motion["thruster.command"] ** 2 + 0.2 * motion["hip.torque"] ** 2
    moved = motion["torso.position"][-1, 0] - motion["torso.position"][0, 0]
    return float((dt * losses[:STEPS].sum() + 10 * motion.time[-1]) / (GRAVITY * sum(MASSES.values()) * moved))


def test_in_flight_the_centre_of_mass_falls_freely() -> None:
    """Motor and hip are inner forces: they change neither its fall nor its speed ahead."""
    made = shipped("hopper_gait", "casadi")
    z = made.shooting.start(0)
    z[3 + KNOTS :] = np.linspace(0, -0.5, KNOTS)
    motion = made.simulate(z)
    aloft = int(np.argmax(motion["foot-ground.force"][:, 2] > 0))
    assert aloft >= 10
    time = motion.time[: aloft + 1]
    weighed = sum(mass * motion[f"{name}.position"] for name, mass in MASSES.items() if name != "trolley")
    fall = (weighed[: aloft + 1, 2] - weighed[0, 2]) / (sum(MASSES.values()) - MASSES["trolley"])
    assert fall == pytest.approx(-GRAVITY * time**2 / 2, abs=GRAVITY * time[-1] * (time[1] - time[0]))
    ahead = sum(mass * motion[f"{name}.velocity"][:, 0] for name, mass in MASSES.items())
    assert ahead[:aloft] == pytest.approx(ahead[0], rel=1e-6)


@pytest.mark.thorough
def test_the_second_hop_is_like_the_first() -> None:
    """The commands of one period, step by step and twice: the return map closes, and the second hop follows the first.

    It does so to 3e-3, since the forces that a step hands to the next are no part of what is closed.
    """
    made = shipped("hopper_gait")
    found = solve("ipopt", made)
    verdict, motion = made.judge(found.z), made.simulate(found.z)
    assert verdict.solved
    assert verdict.objective == pytest.approx(cost_of_transport(motion), rel=0.02)
    assert verdict.objective < 0.5
    for name in COORDINATES + RATES:
        assert motion[name][-1] == pytest.approx(motion[name][0], abs=2e-6)
    twice = {"simulation.duration": 1.0, "variable.0.upper": 2.0, **{f"variable.{k}.knots": 2 * STEPS for k in (3, 4)}}
    held = {f"variable.{k}.interpolation": "constant" for k in (3, 4)} | {"variable.3.guess": 0.0}
    both = transcribe(load_problem(problems.find("hopper_gait"), twice | held), backend="casadi")
    at = np.arange(STEPS) * (KNOTS - 1) / STEPS
    thrust, swing = (np.interp(at, np.arange(KNOTS), found.z[3 + k * KNOTS :][:KNOTS]) for k in (0, 1))
    again = both.simulate(np.concatenate([[2 * found.z[0]], found.z[1:3], np.tile(thrust, 2), np.tile(swing, 2)]))
    for name in COORDINATES + RATES:
        assert again[name][STEPS] == pytest.approx(motion[name][-1], abs=1e-6)
        assert again[name][-1] == pytest.approx(motion[name][-1], abs=5e-3)
