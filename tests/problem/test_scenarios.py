"""The [[scenario]] tables: what they become, and what is wrong with some."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem

WALKER = """
[simulation]
duration = 1
dt = 0.01
[[body]]
name = "torso"
shape = { box = { size = [0.4, 0.2, 0.1] } }
mass = 5
position = [0, 0, 0.5]
collides_with = []
[[body]]
name = "leg"
shape = { capsule = { radius = 0.05, length = 0.2 } }
mass = 1
position = [0, 0, 0.3]
[[joint]]
name = "hip"
between = ["torso", "leg"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0.45]
motor = { servo = { gain = 20, torque = 30, velocity = 8 } }
[[body]]
name = "lamp"
shape = { sphere = { radius = 0.05 } }
mass = 1
position = [0, 1, 0]
collides_with = []
[[joint]]
name = "nail"
between = ["world", "lamp"]
ball = {}
point = [0, 1, 0.3]
[ground]
friction = 0.5
[[variable]]
name = "command"
sets = "hip.command"
[[cost]]
name = "far"
value = "-torso.position[0]"
"""
Load = Callable[[str], Problem]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    def build(tables: str) -> Problem:
        path = tmp_path / "walker.toml"
        path.write_text(WALKER + tables, encoding="utf-8")
        return load_problem(path)

    return build


def table(*lines: str) -> str:
    return "\n".join(["[[scenario]]", 'name = "s"', *lines, ""])


def test_without_tables_there_is_none(load: Load) -> None:
    assert load("").scenarios is None


def test_numbers(load: Load) -> None:
    found = load(table('sets = ["torso.mass", "leg.mass"]', "factor = 0.1", "alike = true")).scenarios
    assert found is not None
    (varied,) = found.quantities
    assert (varied.kind, varied.factor, varied.alike, varied.lasts) == ("parameter", 0.1, True, 0)
    assert [slot.name for slot in varied.slots] == ["torso.mass", "leg.mass"]


def test_pushes_last_for_a_while(load: Load) -> None:
    found = load(table('sets = "torso.force[0:2]"', "shift = [30, 20]", "lasts = 0.2")).scenarios
    assert found is not None
    assert (found.quantities[0].lasts, found.quantities[0].shift.tolist()) == (0.2, [30, 20])


def test_robots_are_all_that_hangs_together(load: Load) -> None:
    found = load(table('robot = "torso"', "tilt_deg = 90", "joints = 0.1")).scenarios
    assert found is not None
    (posed,) = found.poses
    assert (posed.bodies, [joint.name for joint in posed.joints]) == (("torso", "leg"), ["hip"])
    assert (posed.tilt, posed.bend) == (pytest.approx(np.pi / 2), 0.1)


def test_grids_differ_where_they_say_so(load: Load) -> None:
    problem = load(table("simulation = { dt = 0.005 }"))
    assert problem.scenarios is not None
    (grid,) = problem.scenarios.discretisations
    assert (grid.simulation.steps, grid.simulation.sweeps) == (200, problem.simulation.sweeps)


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ((), r"sets: give one of sets, robot and simulation"),
        (('sets = "torso.mass"', 'robot = "torso"', "factor = 0.1"), r"sets: give one of"),
        (('sets = "torso.mas"', "factor = 0.1"), r"sets: there is no quantity .torso.mas."),
        (('sets = ["torso.mass", "torso.velocity"]', "factor = 0.1"), r"sets: these are of different kinds"),
        (('sets = "torso.mass"',), r"factor: give either factor or shift"),
        (('sets = "torso.mass"', "factor = 0.1", "shift = 1"), r"factor: give either"),
        (('sets = "torso.mass"', "factor = 1"), r"factor: must be less than 1"),
        (('sets = "torso.velocity"', "shift = [1, 2]"), r"shift: must be a number, or 3 of them; it has 2"),
        (('sets = "torso.mass"', "factor = 0.1", "lasts = 0.1"), r"lasts: only forces, torques and commands"),
        (('sets = "torso.force"', "shift = 1", "lasts = 3"), r"lasts: is longer than the motion, 1 s"),
        (
            ('sets = "ground.friction"', "shift = 0.6"),
            r"shift: would take ground.friction from -0.1 to 1.1; physical is 0",
        ),
        (('sets = "torso.mass"', "shift = 5"), r"shift: would take torso.mass from 0 to 10; physical is 0.005"),
        (('sets = "hip.command"', "shift = 0.1"), r"sets: hip.command\[0\] is set by variable command already"),
        (('robot = "tors"', "tilt = 0.1"), r"robot: there is no body .tors."),
        (('robot = "lamp"', "tilt = 0.1"), r"robot: lamp hangs on the world"),
        (('robot = "torso"',), r"tilt: give tilt, joints or velocity"),
        (("simulation = {}",), r"simulation: give dt, sweeps or both"),
        (("simulation = { dt = 0.03 }",), r"simulation.dt: duration / dt = .* no whole number of steps"),
    ],
)
def test_bad_tables_are_named(load: Load, lines: tuple[str, ...], told: str) -> None:
    with pytest.raises(ProblemError, match=r'scenario "s"\.' + told):
        load(table(*lines))


def test_nothing_differs_twice(load: Load) -> None:
    twice = table('sets = "torso.velocity"', "shift = 0.1") + table('robot = "leg"', "velocity = 0.1").replace(
        '"s"', '"t"'
    )
    with pytest.raises(ProblemError, match=r'scenario "t"\.robot: torso.velocity\[0\] .*scenario s'):
        load(twice)
