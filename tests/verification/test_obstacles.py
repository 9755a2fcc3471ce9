"""Obstacles are found where there are any, and only there: targets that contradict or oppose, bounds that hold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from symphys.transcription import Transcription
from symphys.verification.target_conflicts import constant_part, held_bounds, opposed, target_conflicts

Make = Callable[..., Transcription]

THROW = """
[simulation]
duration = 0.2
dt = 0.02
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
[[variable]]
name = "throw"
sets = "ball.velocity[0:2]"
guess = [1, 0.5]
upper = 5
"""
NEAR = ("near", "ball.position[0] - 0.3")


def problem(*targets: tuple[str, str], more: str = "") -> str:
    tables = [f'[[target]]\nname = "{name}"\nvalue = "{value}"\ntolerance = 0.01\n' for name, value in targets]
    return THROW + more + "".join(tables)


def conflicts(make: Make, text: str, z: list[float]) -> dict[str, object]:
    made = make(text)
    return target_conflicts(made, made.record(np.array(z)))


@pytest.mark.parametrize(
    ("far", "named"),
    [
        ("ball.position[0] - 0.6", True),
        ("3 * ball.velocity[0] - 9", True),
        ("ball.position[0] - 0.31", False),  # within both tolerances half way
        ("2 * ball.position[0] - 0.6", False),  # the same demand twice
        ("ball.position[1] - 0.6", False),
        ("ball.position[0]**2 - 0.36", False),  # parallel gradients, but by no fixed ratio: elsewhere both may be met
        ("ball.position[0] + ball.position[1] - 0.6", False),
    ],
)
def test_targets_that_contradict_each_other_are_named(make: Make, far: str, named: bool) -> None:
    found = conflicts(make, problem(NEAR, ("far", far)), [1.0, 0.5])
    assert found["contradicting"] == (["near", "far"] if named else [])


def test_three_targets_may_contradict_each_other_where_no_two_do(make: Make) -> None:
    """X, y and their sum; the sum of a fourth with nothing to do with them stays out."""
    three = (NEAR, ("side", "ball.position[1] - 0.2"), ("sum", "ball.position[0] + ball.position[1] - 1"))
    turn = '[[variable]]\nname = "turn"\nsets = "ball.angular_velocity[2]"\nguess = 1\n'
    text = problem(*three, ("turn", "ball.angular_velocity[2] - 3"), more=turn)
    assert conflicts(make, text, [1.0, 0.5, 1.0])["contradicting"] == ["near", "side", "sum"]


def test_nothing_is_said_where_everything_is_met(make: Make) -> None:
    found = conflicts(make, problem(NEAR, ("again", "ball.position[0] - 0.3")), [1.5, 0.0])
    assert found == {"equations": 0, "unknowns": 0, "contradicting": [], "opposed": [], "outweighed": []}


@pytest.mark.parametrize(
    ("target", "cost", "speed", "named"),
    [
        ("ball.position[0] - 0.3", "ball.velocity[0]**2", 0.06 / 1.04, True),  # least v^2 + (0.2 v - 0.3)^2
        ("ball.position[0] - 0.3", "0.05 * ball.velocity[0]", 0.875, True),  # least 0.05 v + (0.2 v - 0.3)^2
        ("ball.position[0] - 0.3", "ball.velocity[0]**2", 0.5, False),  # on the way to it
        ("cos(ball.position[0]) - 3", "1e-3 * (ball.velocity[0] - 1)**2", 1 / 81, False),  # no speed meets it
        ("ball.position[0] - 0.3", "1e-6 * ball.velocity[0]**2", 1.5, False),  # met
    ],
)
def test_targets_that_costs_hold_back_are_named_where_the_sum_is_least(
    make: Make, target: str, cost: str, speed: float, named: bool
) -> None:
    """A target is a penalty: the minimum of the sum misses it, and more weight would bring it nearer."""
    costs = f'[[cost]]\nname = "slow"\nvalue = "{cost}"\nat = "end"\n'
    found = conflicts(make, problem(("near", target), more=costs), [speed, 0.0])
    assert found["outweighed"] == (["near"] if named else [])


def test_equations_and_unknowns_are_counted(make: Make) -> None:
    """A component whose bounds are one number is no unknown."""
    text = problem(("there", "ball.position - [1, 2, 3]")).replace("upper = 5", "upper = [5, 0.5]\nlower = [-5, 0.5]")
    found = conflicts(make, text, [1.0, 0.5])
    assert (found["equations"], found["unknowns"]) == (3, 1)


@pytest.mark.parametrize(("z", "named"), [([2.0, 0.75], True), ([2.0, 1.0], False), ([1.0, 0.75], False)])
def test_targets_that_oppose_each_other_are_named_where_they_cancel(make: Make, z: list[float], named: bool) -> None:
    """Two points to be at: half way between them, beside the line through them, and before both."""
    points = [
        (f"point {k}", f"norm(ball.position[0:2] - {point})") for k, point in enumerate(([0.3, 0.15], [0.5, 0.15]))
    ]
    found = conflicts(make, problem(*points), z)
    assert found["opposed"] == (["point 0", "point 1"] if named else [])
    assert found["contradicting"] == []


def test_a_bound_that_takes_the_descent_away_is_no_opposition() -> None:
    slopes = np.array([[1.0, 0.5], [-1.0, 0.5]])
    assert opposed(slopes, np.array([False, True])) == [0, 1]
    assert opposed(slopes, np.array([False, False])) == []
    assert opposed(np.array([[1e-12, 0.0], [-1e-12, 0.0]]), np.zeros(2, bool)) == []


def test_a_part_that_no_change_touches_is_that_of_a_fixed_combination() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.standard_normal((2, 6))
    changes = np.array([first, 2 * first, second])
    part = constant_part(np.array([1.0, 0.0, 5.0]), changes, np.ones(3))
    assert part == pytest.approx([0.8, -0.4, 0.0])
    assert constant_part(np.array([1.0, 2.0, 5.0]), changes, np.ones(3)) == pytest.approx(np.zeros(3))
    still = np.array([first, 0 * first, second])
    assert constant_part(np.array([1.0, 9.0, 5.0]), still, np.ones(3)) == pytest.approx(np.zeros(3))


def test_a_bound_that_holds_the_answer_back_is_named_with_what_it_would_gain(make: Make) -> None:
    """d/dv of (0.2 v - 2)^2 at v = 5; the other component is free."""
    made = make(problem(("far", "ball.position[0] - 2")))
    (row,) = held_bounds(made, np.array([5.0, 0.0]))
    assert {key: row[key] for key in ("variable", "component", "components", "side", "bound", "knots", "of")} == {
        **{"variable": "throw", "component": 0, "components": 2, "side": "upper", "bound": 5.0, "knots": 1, "of": 1}
    }
    assert row["gain"] == pytest.approx(0.4)


@pytest.mark.parametrize(("target", "z"), [(0.5, [5.0, 0.0]), (2.0, [4.99, 0.0]), (1.0, [5.0, 0.0])])
def test_a_bound_holds_nothing_where_the_merit_falls_inside_or_levels_out_or_where_z_is_not_at_it(
    make: Make, target: float, z: list[float]
) -> None:
    assert held_bounds(make(problem(("far", f"ball.position[0] - {target}"))), np.array(z)) == []


def test_knots_at_a_bound_are_counted_together(make: Make) -> None:
    """Of a force in x and y over 5 knots, 4 lie at a bound in x, two of them at another value."""
    push = '[[variable]]\nname = "push"\nsets = "ball.force[0:2]"\nknots = 5\n'
    push += "lower = -1\nupper = [[1, 1], [1, 1], [2, 1], [1, 1], [1, 1]]\n"
    made = make(problem(("far", "ball.position[0] - 2"), more=push))
    z = np.array([0.0, 0.0, *[1, 0], *[1, 0], *[2, 0], *[1, 0], *[-1, 0]], float)
    (row,) = held_bounds(made, z)
    assert (row["variable"], row["component"], row["side"], row["knots"], row["of"]) == ("push", 0, "upper", 4, 5)
    assert np.isnan(row["bound"])
    z[6] = 1.5
    (row,) = held_bounds(made, z)
    assert (row["knots"], row["bound"]) == (3, 1.0)
