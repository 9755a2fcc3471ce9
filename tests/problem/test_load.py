"""A valid file becomes the model that it describes."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from symphys.model.world import Scheme
from symphys.problem import Problem, VariableSlot

Load = Callable[..., Problem]


def test_header_and_simulation(load: Load, valid: str) -> None:
    problem = load()
    assert (problem.name, problem.title, problem.text) == ("example", "Two balls", valid)
    assert problem.simulation.steps == 100
    assert problem.simulation.scheme() == Scheme(dt=0.01)
    assert problem.solver_tables == {"gradient": {"iterations": 10}}


def test_title_defaults_to_the_name(load: Load) -> None:
    assert load(('title = "Two balls"', "")).title == "example"


def test_switches_of_the_scheme(load: Load) -> None:
    text = "sweeps = 3\nposition_sweeps = 0\nwarm_start = false\ntime_of_impact = false\nimpact_friction = false"
    problem = load(("dt = 0.01", f"dt = 0.01\n{text}\npush_out = 0.5\nsmoothing = 0.1"))
    assert problem.simulation.scheme() == Scheme(0.01, 3, 0, 0.5, False, False, False)
    assert problem.simulation.smoothing == (0.1,)


@pytest.mark.parametrize(
    ("text", "stages"),
    [("0", (0.0,)), ("0.05", (0.05,)), ("[0]", (0.0,)), ("[0.1, 0.01, 0]", (0.1, 0.01, 0.0)), ("[1, 0.5]", (1.0, 0.5))],
)
def test_smoothing_is_a_number_or_stages(load: Load, text: str, stages: tuple[float, ...]) -> None:
    assert load(("dt = 0.01", f"dt = 0.01\nsmoothing = {text}")).simulation.smoothing == stages


def test_without_smoothing_contact_is_exact(load: Load) -> None:
    assert load().simulation.smoothing == (0.0,)


def test_initial_state(load: Load) -> None:
    initial = load().initial
    assert list(initial) == [
        f"{body}.{key}"
        for body in ("ball", "marble")
        for key in ("position", "orientation", "velocity", "angular_velocity")
    ]
    np.testing.assert_array_equal(initial["ball.position"], [0, 0, 1])
    np.testing.assert_array_equal(initial["ball.orientation"], [1, 0, 0, 0])


@pytest.mark.parametrize(
    ("orientation", "expected"),
    [
        ("[2, 0, 0, 0]", [1, 0, 0, 0]),
        ("[0, 0, 0, -3]", [0, 0, 0, -1]),
        ("{ roll_deg = 90 }", [np.sqrt(0.5), np.sqrt(0.5), 0, 0]),
        ("{ yaw_deg = 180 }", [0, 0, 0, 1]),
        ("{ roll_deg = 90, yaw_deg = 90 }", [0.5, 0.5, 0.5, 0.5]),  # z turns x into y after the roll about x
        ("{ pitch_deg = 90, yaw_deg = 90 }", [0.5, -0.5, 0.5, 0.5]),
    ],
)
def test_orientation(load: Load, orientation: str, expected: list[float]) -> None:
    problem = load(("mass = 2.0", f"mass = 2.0\norientation = {orientation}"))
    np.testing.assert_allclose(problem.initial["ball.orientation"], expected, atol=1e-15)


def test_variables(load: Load) -> None:
    throw, push = load().variables
    assert (throw.kind, throw.slots, throw.components, throw.knots) == (
        "initial",
        (VariableSlot("ball.velocity", (0, 1, 2)),),
        3,
        1,
    )
    np.testing.assert_array_equal(throw.guess, [1, 2, 3])
    np.testing.assert_array_equal(throw.lower, [-np.inf] * 3)
    np.testing.assert_array_equal(throw.scale, [1, 1, 1])
    np.testing.assert_array_equal(throw.spread, [0.1, 0.1, 0.1])
    assert (push.kind, push.slots, push.knots, push.interpolation) == (
        "control",
        (VariableSlot("marble.force", (0, 1)),),
        4,
        "constant",
    )
    np.testing.assert_array_equal(push.guess, np.zeros(8))


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ("guess = 2", [2] * 8),
        ("guess = [1, 2]", [1, 2] * 4),
        ("guess = [[1, 2], [3, 4], [5, 6], [7, 8]]", [1, 2, 3, 4, 5, 6, 7, 8]),
    ],
)
def test_guess_is_spread_over_knots(load: Load, keys: str, expected: list[float]) -> None:
    np.testing.assert_array_equal(load(("knots = 4", f"knots = 4\n{keys}")).variables[1].guess, expected)


def test_one_component_takes_one_number_per_knot(load: Load) -> None:
    problem = load(("marble.force[0:2]", "marble.force[-1]"), ("knots = 4", "knots = 4\nguess = [1, 2, 3, 4]"))
    assert problem.variables[1].slots == (VariableSlot("marble.force", (2,)),)
    np.testing.assert_array_equal(problem.variables[1].guess, [1, 2, 3, 4])


@pytest.mark.parametrize(
    ("name", "nominal", "lower", "upper"),
    [
        ("ball.mass", 2.0, 2e-3, np.inf),
        ("ball.radius", 0.5, 5e-4, np.inf),
        ("ball.friction", 0.5, 0.0, np.inf),
        ("ground.restitution", 0.5, 0.0, 1.0),
        ("ground.offset", 0.0, -np.inf, np.inf),
        ("gravity[2]", -9.81, -np.inf, np.inf),
        ("ball.position[2]", 1.0, -np.inf, np.inf),
    ],
)
def test_defaults_are_the_file_and_what_is_physical(
    load: Load, name: str, nominal: float, lower: float, upper: float
) -> None:
    variable = load(('sets = "ball.velocity"\nguess = [1, 2, 3]', f'sets = "{name}"')).variables[0]
    assert (variable.guess, variable.lower, variable.upper) == (nominal, lower, upper)


def test_a_variable_may_set_several_quantities(load: Load) -> None:
    problem = load(('"ball.velocity"', '["ball.velocity", "marble.velocity"]'))
    assert [slot.name for slot in problem.variables[0].slots] == ["ball.velocity", "marble.velocity"]


def test_aims(load: Load) -> None:
    problem = load()
    (cost,), (target,), (constraint,) = problem.costs, problem.targets, problem.constraints
    assert (cost.at, cost.weight, cost.squares) == ("always", 1.0, True)
    assert (target.at, target.tolerance, target.weight) == ("end", 0.01, 1.0)
    assert (constraint.at, constraint.lower, constraint.upper) == ("always", -np.inf, 5)
    assert constraint.formula.text == "ball.position[2]"


def test_equals_is_both_bounds(load: Load) -> None:
    constraint = load(('"ball.position[2]"\nupper = 5', '"ball.position"\nequals = [1, 2, 3]')).constraints[0]
    np.testing.assert_array_equal(constraint.lower, [1, 2, 3])
    np.testing.assert_array_equal(constraint.upper, [1, 2, 3])


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ([], False),  # a cost is left to improve once the targets are met
        ([("[[cost]]", '[objective]\nstop = "met"\n[[cost]]')], True),
        ([("[[cost]]", "[objective]\ngoal = 1\n[[cost]]")], True),
        ([("[[cost]]", '[objective]\ngoal = 1\nstop = "converged"\n[[cost]]')], False),
        ([('[[cost]]\nname = "effort"\nat = "always"\nsquares = "marble.force"', "")], True),
    ],
)
def test_when_to_stop(load: Load, changes: list[tuple[str, str]], expected: bool) -> None:
    assert load(*changes).stop_when_met is expected


def test_byte_order_mark_and_windows_lines(tmp_path_factory: pytest.TempPathFactory, valid: str) -> None:
    from symphys.problem import load_problem

    path = tmp_path_factory.mktemp("windows") / "p.toml"
    path.write_bytes(b"\xef\xbb\xbf" + valid.replace("\n", "\r\n").encode())
    assert load_problem(path).text == valid


def test_formulas_see_every_kind_of_name(load: Load) -> None:
    names = "ball.position[0] + ball.orientation[0] + ball.angular_velocity[1] + ball.torque[2] + ball.mass"
    names += " + marble.radius + ground.friction + gravity[2] + time + throw[2] + push[7]"
    assert len(load(('"ball.position - [1, 0, 0.5]"', f'"{names}"')).targets[0].formula.names) == 11


def test_a_problem_can_be_sent_to_another_process(load: Load) -> None:
    problem = load()
    problem.world()
    assert pickle.loads(pickle.dumps(problem)).world() == problem.world()
    assert copy.deepcopy(problem).targets == problem.targets
