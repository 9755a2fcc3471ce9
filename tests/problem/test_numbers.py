"""Numbers hold wherever they are used what the classes of the world declare of them."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem, problem_of_tables
from symphys.problem.quantities import quantity_unit
from symphys.problems import find

ARM = {
    "simulation": {"duration": 0.1, "dt": 0.01},
    "ground": {"friction": 0.5},
    "body": [
        {"name": "arm", "mass": 1.0, "position": [0, 0, 2], "shape": {"box": {"size": [0.1, 0.2, 0.3], "edge": 0.01}}}
    ],
    "contact": {"torsion": 0.01},
    "target": [{"name": "there", "value": "arm.velocity", "tolerance": 0.01}],
}


def arm(sets: str, kind: str = "hinge", **variable: object) -> Problem:
    """An arm on a hinge or a slider, a variable of which sets something."""
    joint = {
        "name": "hip",
        "between": ["world", "arm"],
        kind: {"axis": [0, 1, 0]},
        "point": [0, 0, 2],
        "armature": 0.1,
        "friction": 0.2,
        "motor": {"affine": {"gain": -2.0, "kp": 1.0, "kv": 0.1}},
        "spring": {"stiffness": 3.0, "damping": 0.5, "rest": 0.1},
    }
    chosen = {"name": "chosen", "sets": [sets], **variable}
    return problem_of_tables({**ARM, "joint": [joint], "variable": [chosen]})


@pytest.mark.parametrize("name", ["quadruped_walk", "pendulum", "ice_and_asphalt", "bounce_recorded"])
def test_every_parameter_is_declared_and_within_its_bounds(name: str) -> None:
    problem = load_problem(find(name))
    numbers = problem.parametric.numbers
    assert numbers.keys() == problem.parameters.keys()
    for each, values in problem.parameters.items():
        assert np.all((values >= numbers[each].least) & (values <= numbers[each].most)), each
        assert numbers[each].unit == quantity_unit(each, problem.world()), each


@pytest.mark.parametrize(
    ("key", "turning", "sliding"),
    [
        ("stiffness", "N m/rad", "N/m"),
        ("damping", "N m s/rad", "N s/m"),
        ("rest", "rad", "m"),
        ("kp", "N m/rad", "N/m"),
        ("armature", "kg m^2", "kg"),
        ("friction", "N m", "N"),
        ("anchor", "m", "m"),
        ("gain", None, None),
    ],
)
def test_units_follow_the_coordinate(key: str, turning: str | None, sliding: str | None) -> None:
    for kind, unit in (("hinge", turning), ("slider", sliding)):
        assert arm("arm.velocity", kind).parametric.numbers[f"hip.{key}"].unit == unit


def test_a_gain_may_be_negative_where_its_motor_says_so() -> None:
    (variable,) = arm("hip.gain").variables
    assert (variable.lower[0], variable.guess[0]) == (-np.inf, -2.0)


@pytest.mark.parametrize(
    ("sets", "lower", "upper"),
    [("hip.stiffness", 0, np.inf), ("hip.rest", -np.inf, np.inf), ("arm.mass", 1e-3, np.inf), ("arm.edge", 0, 0.0495)],
)
def test_bounds_are_what_is_physical(sets: str, lower: float, upper: float) -> None:
    (variable,) = arm(sets).variables
    assert (variable.lower[0], variable.upper[0]) == pytest.approx((lower, upper))


@pytest.mark.parametrize(("sets", "lower"), [("hip.stiffness", -1.0), ("arm.mass", 0.0), ("contact.torsion", -0.1)])
def test_bounds_beyond_what_is_physical_are_refused(sets: str, lower: float) -> None:
    with pytest.raises(ProblemError, match=f"{sets} must be"):
        arm(sets, lower=lower)
