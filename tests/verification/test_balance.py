"""Energy and momentum add up, and what contacts give or take is known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tools.repeats import few, thorough

from symphys.findings.examination import Energy, Examination, Gain
from symphys.findings.levels import BAD, FAIR, GOOD
from symphys.findings.physics import balance_finding, gains_finding, stop_findings
from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import transcribe
from symphys.verification.balance import balance, momentum_gap
from symphys.verification.contacts import slides, surface

ROD = """
title = "A rod strikes the ground with its lower end"
[simulation]
duration = 0.2
dt = 0.01
energy_cap = false
[world]
gravity = [0, 0, 0]
[[body]]
name = "rod"
shape = { spheres = [{ radius = 0.02, centre = [-0.3, 0, 0] }, { radius = 0.02, centre = [0.3, 0, 0] }] }
mass = 1.0
inertia = 0.09
position = [0, 0, 0.35]
orientation = [0.92106099400288508, 0, 0.38941834230865052, 0]
[ground]
friction = 1.0
restitution = 1.0
[[variable]]
name = "v"
sets = "rod.velocity"
guess = [-0.6, 0, -2]
[[target]]
name = "t"
value = "rod.position[0]"
tolerance = 0.1
"""

TOP = """
title = "A top that a torque spins up, pushed along"
[simulation]
duration = 0.5
dt = 0.01
[world]
gravity = [0, 0, -3]
[[body]]
name = "top"
shape = { sphere = { radius = 0.5 } }
mass = 2.0
inertia = 0.7
[[variable]]
name = "torque"
sets = "top.torque"
guess = [0, 0, 1.4]
[[variable]]
name = "push"
sets = "top.force"
guess = [4, 0, 0]
[[target]]
name = "t"
value = "top.position[0]"
tolerance = 0.1
"""

SLIDE = """
title = "A ball is set down sliding"
[simulation]
duration = 1.0
dt = 0.01
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 0.1]
[ground]
friction = 0.3
[[variable]]
name = "push"
sets = "ball.velocity[0]"
guess = 2
[[target]]
name = "t"
value = "ball.position[0]"
tolerance = 0.1
"""


@few("name", ["ball_throw", "two_balls", "bank_shot"], 1)
def test_momentum_closes_for_shipped_problems(name):
    shipped = transcribe(load_problem(find(name)), backend="casadi")
    for seed in (0, 1):
        found = balance(shipped.rollout, shipped.record(shipped.shooting.start(seed)))
        assert found["momentum"] < 1e-9
        assert found["gains"] == []


@pytest.mark.slow
def test_a_force_that_does_not_act_as_recorded_is_found():
    shot = transcribe(load_problem(find("bank_shot")), backend="casadi")
    record = shot.record(shot.shooting.start(0))
    false = replace(record.motion, contact_force=record.motion.contact_force * 1.001)
    assert momentum_gap(shot.rollout, replace(record, motion=false)) > 1e-6


def test_work_of_forces_and_torques(make):
    """A constant torque gives (tau t)^2 / 2 I, a constant force F^2 t^2 / 2 m; gravity moves energy only."""
    top = make(TOP)
    energy = {key: np.array(column) for key, column in balance(
        top.rollout, top.record(top.shooting.start(0)))["energy"].items()}  # fmt: skip
    expected = (1.4 * energy["time"]) ** 2 / (2 * 0.7) + (4 * energy["time"]) ** 2 / (2 * 2.0)
    assert energy["applied"] == pytest.approx(expected, abs=1e-12)
    assert energy["kinetic"] + energy["potential"] == pytest.approx(expected, abs=1e-12)
    assert energy["potential"] == pytest.approx(-2.0 * 3 * 3 * energy["time"] ** 2 / 2, abs=1e-12)
    assert np.all(energy["contact"] == 0)


def test_what_friction_takes(make):
    """A solid ball that slides until it rolls loses 2/7 of its energy, and slides 12 v^2 / 49 mu g less what it rolls.

    The slip v falls by 7/2 mu g t: the surfaces slide v^2 / 7 mu g.
    """
    slide = make(SLIDE)
    record = slide.record(slide.shooting.start(0))
    found = balance(slide.rollout, record)
    assert found["energy"]["contact"][-1] == pytest.approx(-2 / 7 * 2.0**2 / 2, rel=1e-9)
    (ball,) = slides(slide.rollout, record)
    assert ball["contact"] == "ball-ground"
    assert ball["distance"] == pytest.approx(2.0**2 / (7 * 0.3 * 9.81), rel=0.05)
    assert ball["speed"] == pytest.approx(2.0, rel=0.06)


def test_energy_that_a_contact_adds_is_told_with_its_step(make):
    """Kane's rod: the blow turns the slip round, friction holds it, Newton's law gives back the whole normal speed."""
    rod = make(ROD)
    record = rod.record(rod.shooting.start(0))
    found = balance(rod.rollout, record)
    (gain,) = found["gains"]
    before, after = (0.5 * (v @ v + 0.09 * w @ w) for v, w in (
        (record.motion.velocity[i, 0], record.motion.angular_velocity[i, 0]) for i in (0, -1)))  # fmt: skip
    arm = np.array([0.3 * np.cos(0.8), -0.3 * np.sin(0.8)]) + np.array([0, -0.02])
    turn = np.array([arm[1], -arm[0]])
    masses = np.eye(2) + np.outer(turn, turn) / 0.09
    impulse = np.linalg.solve(masses, np.array([0.6, 4.0]))
    assert abs(impulse[0]) < impulse[1]
    expected = impulse @ (np.array([-0.6, -2]) + np.array([0, 2])) / 2
    assert gain["energy"] == pytest.approx(expected, rel=1e-3)
    assert after - before == pytest.approx(gain["energy"])
    assert gain["contacts"] == ["rod[1]-ground"]
    struck = int(np.argmax(np.abs(np.diff(record.motion.velocity[:, 0, 2])) > 0.1))
    assert (gain["step"], gain["time"]) == (struck, pytest.approx(0.01 * struck))
    assert found["momentum"] < 1e-12


def test_an_impact_adds_no_energy_unless_asked_to(make):
    rod = make(ROD.replace("energy_cap = false", ""))
    assert balance(rod.rollout, rod.record(rod.shooting.start(0)))["gains"] == []


def test_words_of_the_budget():
    energy = Energy(*(np.array([0.0, 1.0]) for _ in range(5)))
    gain = Gain(113, 1.13, 0.2, ("rod-ground",))
    line = gains_finding(Examination(energy=energy, gains=(gain,), gained=0.2))
    assert line.level == BAD
    for word in ("rod-ground", "1.13", "113", "0.2 J"):
        assert word in line.meaning
    assert gains_finding(Examination(energy=energy, gained=0.0)).level == GOOD
    assert balance_finding(Examination(energy=energy, momentum=1e-3, drift=0.0)).level == BAD
    assert balance_finding(Examination(energy=energy, momentum=1e-15, drift=0.0)).level == GOOD


def test_points_of_one_contact_have_its_name():
    assert surface("box-ground:3") == surface("box-ground:0") == "box-ground"


BOARDS = """
[simulation]
duration = 0.25
dt = 0.005
[[body]]
name = "cube"
shape = { box = { size = [0.1, 0.1, 0.1] } }
mass = 1.0
position = [0, 0, 0.05]
velocity = [3, 0, 0]
[contact]
friction = 0.2
[[block]]
name = "first"
shape = { box = { size = [2, 1, 0.2] } }
position = [-0.5, 0, -0.1]
[[block]]
name = "second"
shape = { box = { size = [4, 1, 0.2] } }
position = [2.5, 0, HEIGHT]
[[variable]]
name = "push"
sets = "cube.velocity[0]"
guess = [3.0]
[[target]]
name = "far"
value = "cube.position[0] - 0.5"
tolerance = 1.0
"""


@pytest.mark.slow
@few(("edge", "trips"), [(0.01, True), thorough(0.0, False)], 1)
def test_a_trip_over_an_edge_is_told_with_what_it_takes(make, edge, trips):
    """A cube slides off one board onto the next: flush, nothing but friction takes energy; an edge of 1 cm stops it.

    The edge is met after 0.15 to 0.16 s, at 2.7 m/s.
    """
    boards = make(BOARDS.replace("HEIGHT", str(edge - 0.1)))
    record = boards.record(boards.shooting.start(0))
    found = balance(boards.rollout, record)
    if not trips:
        assert found["stops"] == []
        return
    (stop, *_) = found["stops"]
    assert "cube-second" in stop["contacts"] and 0.145 < stop["time"] < 0.165
    motion, k = record.motion, stop["step"]
    before, after = (
        np.sum(motion.velocity[i] ** 2 + 0.01 / 6 * motion.angular_velocity[i] ** 2) / 2 for i in (k, k + 1)
    )
    assert stop["energy"] == pytest.approx(before - after, rel=0.1)
    (line,) = stop_findings(Examination(stops=(Gain(k, stop["time"], stop["energy"], tuple(stop["contacts"])),)))
    assert line.level == FAIR and not line.doubt and "cube-second" in line.meaning
