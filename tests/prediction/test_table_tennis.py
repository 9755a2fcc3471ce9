"""Drag, lift, restitution and friction of a table tennis ball, from shots with noise that differ in speed and spin."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest

import symphys

TRUTH = {"drag_C": 0.4, "lift_C": 0.6, "bounce": 0.876, "grip": 0.2}
SETS = {"drag_C": "drag.C", "lift_C": "lift.C", "bounce": "table.restitution", "grip": "table.friction"}
GUESS = {"drag_C": 0.5, "lift_C": 0.45, "bounce": 0.8, "grip": 0.12}
NOISE, SPIN_NOISE = 0.002, 3.0
"""[m] of a camera at 200 Hz, [rad/s] of spins that are read off the ball's mark."""
START, ABOVE = [-1.6, -0.2, 0.9], [0.5, 0.0, 1.3]
"""[m] behind the table, and above it."""
THROWN = {"name": "thrown", "sets": "ball.velocity", "each": "recording", "scale": 1.0}
SPUN = {"name": "spun", "sets": "ball.angular_velocity", "each": "recording", "prior": [0.0, SPIN_NOISE], "scale": 10.0}
Shots = list[tuple[list[float], list[float]]]
SHOTS: Shots = [
    ([8.2, 1.3, 2.6], [-90, 270, 60]),
    ([5.6, 0.5, 1.7], [0, -120, 0]),
    ([6.6, -0.6, 2.0], [0, 60, 200]),
    ([8.6, 0.5, 2.6], [40, 330, -50]),
    ([6.0, 0.4, 1.8], [80, 0, -120]),
]
"""Velocities [m/s] and spins [rad/s]: topspin, backspin, side spin and mixed ones, over the net and onto the table."""
PLAIN: Shots = [(velocity, [0, 0, 0]) for velocity, _ in SHOTS]
DROPS: Shots = [([0, 0, -speed], [0, 0, 0]) for speed in (1.0, 3.0, 6.0)]


def recorded(
    shots: Shots, start: list[float], own: list[dict[str, Any]], names: list[str], seed: int = 0, **keys: Any
) -> symphys.Problem:
    """Recordings of these shots, as the ball of the shipped problem flies with the true numbers."""
    problem, random, recordings = symphys.load("table_tennis"), np.random.default_rng(seed), []
    for k, (velocity, spin) in enumerate(shots):
        given = {"body.ball.position": start, "variable.hit.guess": velocity, "variable.spin.guess": spin}
        motion = symphys.simulate(problem.set(given))
        places = motion["ball.position"] + NOISE * random.standard_normal((len(motion.time), 3))
        near = [np.array(velocity) + 0.1 * random.standard_normal(3)]
        near += [np.array(spin) + SPIN_NOISE * random.standard_normal(3)]
        table = {"time": motion.time.tolist(), "p": places.tolist()}
        table |= {name: [value.tolist()] * len(places) for name, value in zip("vw", near, strict=True)}
        measured = [{"value": "ball.position", "columns": "p", "noise": NOISE}]
        begins = {each["sets"]: name for each, name in zip(own, "vw", strict=False)}
        recordings.append({"name": f"shot{k}", "table": table, "measured": measured, "start": begins, **keys})
    tables = tomllib.loads(problem.text)
    tables["body"][0]["position"] = start
    shared = [{"name": name, "sets": SETS[name], "guess": GUESS[name]} for name in names]
    kept = {key: tables[key] for key in ("simulation", "body", "block", "force")}
    return symphys.load(kept | {"variable": [*shared, *own], "recording": recordings})


@pytest.mark.thorough
def test_all_four_are_found_from_shots_of_different_spin() -> None:
    """Each shot has a velocity and a spin of its own, which are estimated with them."""
    found = symphys.identify(recorded(SHOTS, START, [THROWN, SPUN], list(TRUTH)), threads=1)
    assert found.status == "converged" and not found.open
    for name, truth in TRUTH.items():
        each = found[name]
        assert each.lower < truth < each.upper, name
        assert each.upper - each.lower < 0.05 * truth, name
    assert found.own[:, 3:] == pytest.approx(np.array([spin for _, spin in SHOTS]), abs=3 * SPIN_NOISE)


@pytest.mark.thorough
def test_flights_without_spin_leave_the_lift_open() -> None:
    """Before the first bounce; the drag is found all the same."""
    problem = recorded(PLAIN, START, [THROWN], ["drag_C", "lift_C"], until=0.24)
    found = symphys.identify(problem, threads=1)
    assert [each.names for each in found.open] == [("lift_C",)]
    assert found.open[0].text == "lift_C has no effect on what was measured"
    assert found["drag_C"].lower < TRUTH["drag_C"] < found["drag_C"].upper


@pytest.mark.thorough
def test_bounces_straight_down_leave_lift_and_friction_open() -> None:
    """No spin before the bounce, and none after it."""
    found = symphys.identify(recorded(DROPS, ABOVE, [THROWN], list(TRUTH)), threads=1)
    assert {each.names for each in found.open} == {("lift_C",), ("grip",)}
    for name in ("drag_C", "bounce"):
        assert found[name].lower < TRUTH[name] < found[name].upper, name
