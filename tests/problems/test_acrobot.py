"""An acrobot swings up from rest, against its equations of motion, integrated on their own."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.shipped import Array, seeds, shipped, solve
from scipy.integrate import solve_ivp

from symphys.findings.verdict import DOUBTED, rule
from symphys.problem import load_problem
from symphys.problems import find
from symphys.runs.record import judged
from symphys.transcription import Transcription, transcribe
from symphys.verification.refinement import refine

GRAVITY, DAMPING, TIME, KNOTS = 9.81, 0.1, 2.0, 41
COST = 95.603707
"""Of the swing that every seed finds; its elbow goes beyond half a turn, to 3.37 rad."""


def acceleration(angles: Any, rates: Any, torque: Any) -> Any:
    """(2,): by Lagrange's equations, from the energies of two links; angles from hanging, the second from the first."""
    first, both = angles[0], angles[0] + angles[1]
    elbow = ca.vertcat(ca.sin(first), -ca.cos(first))
    centres = elbow / 2, elbow + ca.vertcat(ca.sin(both), -ca.cos(both))
    speeds = [ca.jtimes(centre, angles, rates) for centre in centres]
    kinetic = sum(ca.sumsqr(speed) for speed in speeds) / 2
    kinetic += (0.083 * rates[0] ** 2 + 0.33 * (rates[0] + rates[1]) ** 2) / 2
    potential = GRAVITY * (centres[0][1] + centres[1][1])
    momenta = ca.gradient(kinetic, rates)
    forces = ca.gradient(kinetic - potential, angles) + ca.vertcat(0, torque) - DAMPING * rates
    return ca.solve(ca.jacobian(momenta, rates), forces - ca.jtimes(momenta, angles, rates))


def swung(torques: Array) -> Array:
    """(4,): angles and rates at the end, under torques that are linear between knots."""
    q, v, u = ca.SX.sym("q", 2), ca.SX.sym("v", 2), ca.SX.sym("u")
    slope, times = ca.Function("slope", [q, v, u], [ca.vertcat(v, acceleration(q, v, u))]), np.linspace(0, TIME, KNOTS)

    def at(time: float, state: Array) -> Array:
        return np.array(slope(state[:2], state[2:], np.interp(time, times, torques))).ravel()

    return np.asarray(solve_ivp(at, [0, TIME], np.zeros(4), rtol=1e-9, atol=1e-11, max_step=0.05).y[:, -1])


def ended(made: Transcription, z: Array) -> Array:
    """(4,): angles and rates at the end of a rollout."""
    motion = made.simulate(z)
    return np.array([motion[f"{joint}.{name}"][-1] for name in ("angle", "rate") for joint in ("shoulder", "elbow")])


@cache
def halved() -> Transcription:
    """The acrobot at half the time step."""
    return transcribe(load_problem(find("acrobot"), {"simulation.dt": 0.005}), exact=True, backend="casadi")


@seeds(20)
@pytest.mark.parametrize("solver", ["ilqr", "multiple_shooting"])
def test_every_seed_finds_the_swing(solver: str, seed: int) -> None:
    """At half the step its end is off by a fourth, so that both tell the end of the exact motion."""
    made = shipped("acrobot")
    found = solve(solver, made, seed)
    assert found.trace[-1].best < COST * (1 + 1e-5)
    assert found.trace[-1].max_violation <= 1
    ends = [ended(made, found.z), ended(halved(), found.z)]
    apart = [np.abs(end - swung(found.z)).max() for end in ends]
    assert apart[1] < 0.04
    assert apart[0] == pytest.approx(4 * apart[1], rel=0.1)
    np.testing.assert_allclose((4 * ends[1] - ends[0]) / 3, swung(found.z), atol=4e-3)


def test_a_swing_that_half_the_step_refutes_is_not_solved() -> None:
    """Torques that are held, in steps of 0.1 s: what meets all there misses by twenty tolerances at half the step."""
    held = {"simulation.dt": 0.1, "twist.interpolation": "constant", "twist.knots": 20}
    made = transcribe(load_problem(find("acrobot"), held), exact=True, backend="casadi")
    found = solve("ilqr", made)
    trust = refine(made, found.z)
    verdict = judged(made.judge(found.z))
    assert verdict.met and trust["refined"][0]["worst"] > 3
    ruling = rule(found.status.value, verdict, trust)
    assert ruling.verdict == DOUBTED
    assert any("dt / 2" in doubt for doubt in ruling.doubts)
