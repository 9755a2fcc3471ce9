"""Recorded commands: what the steps get of them, derivatives by a delay, and a motor that is found from them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from worlds.commanded import DT, GUESS, SETS, TRUTH, VARIABLES, arm, dense_means, recorded_arm, true_angles

import symphys
from symphys.prediction.predictor import step_means
from symphys.prediction.residuals import residuals_of
from symphys.problem import RecordedInput

WAYS = ["constant", "linear"]
STEPS = 40


def recorded_input(interpolation: Any, time: Any, values: Any) -> RecordedInput:
    return RecordedInput(np.array(time, float), np.array(values, float).reshape(len(time), -1), interpolation, 0.0, 0)


def uneven() -> tuple[np.ndarray, np.ndarray]:
    """Samples that come between steps, several in one and none in others."""
    rng = np.random.default_rng(3)
    return np.sort(rng.uniform(0.05, 0.3, 25)), rng.normal(size=25)


@pytest.mark.parametrize("interpolation", WAYS)
@pytest.mark.parametrize("delay", [0.0, 0.0237, -0.011, 5.0, -5.0])
def test_a_step_gets_the_mean_over_it(interpolation: str, delay: float) -> None:
    """With a sum over many points as the other way; before the first and after the last sample values stay."""
    time, values = uneven()
    means, _ = step_means(recorded_input(interpolation, time, values), STEPS, DT, delay)
    expected = dense_means(time, values, STEPS, delay, interpolation)
    np.testing.assert_allclose(means[:, 0], expected, atol=2e-2 if interpolation == "constant" else 5e-4)
    if abs(delay) == 5:
        assert means[:, 0] == pytest.approx(np.full(STEPS, values[0 if delay > 0 else -1]), rel=1e-12)


@pytest.mark.parametrize("interpolation", WAYS)
def test_the_impulse_is_kept(interpolation: str) -> None:
    """Whatever the delay, the sum over steps is the integral of what was recorded, here 0 at both ends."""
    signal = recorded_input(interpolation, [0.1, 0.113, 0.2, 0.22], [0, 2, -1, 0])
    area = 0.087 * 2 - 0.02 if interpolation == "constant" else 0.013 + 0.087 / 2 - 0.01
    for delay in (0.0, 0.003, 0.0519):
        assert DT * step_means(signal, STEPS, DT, delay)[0].sum() == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize("interpolation", WAYS)
def test_derivatives_by_the_delay_are_those_of_differences(interpolation: str) -> None:
    signal, h = recorded_input(interpolation, *uneven()), 1e-7
    ends = [step_means(signal, STEPS, DT, 0.0131 + sign * h)[0] for sign in (1, -1)]
    expected = (ends[0] - ends[1]) / (2 * h)
    np.testing.assert_allclose(step_means(signal, STEPS, DT, 0.0131)[1], expected, rtol=1e-5, atol=1e-5)
    assert np.abs(expected).max() > 10


def test_where_jumps_meet_ends_of_steps_the_derivative_is_that_towards_later() -> None:
    signal = recorded_input("constant", np.arange(5) * 0.1 / 10 * 2, [0, 1, 3, 2, 2])
    later = step_means(signal, 8, DT, 1e-6)[0] - step_means(signal, 8, DT, 0.0)[0]
    np.testing.assert_allclose(step_means(signal, 8, DT, 0.0)[1], later / 1e-6, atol=1e-6)


@pytest.mark.slow
@few("interpolation", WAYS, 1)
def test_gain_delay_damping_friction_and_armature_are_found(interpolation: str) -> None:
    """All five within their intervals, from an angle with noise; these are narrow."""
    problem = recorded_arm(interpolation)
    found = symphys.identify(problem, threads=1)
    assert found.status == "converged" and not found.open
    for name, truth in TRUTH.items():
        each = found[name]
        assert each.lower < truth < each.upper, name
        assert each.upper - each.lower < 0.02 * truth, name
        assert abs(problem.variables[list(SETS).index(name)].guess[0] - truth) > 0.2 * truth, "begins elsewhere"


@pytest.mark.slow
@few("interpolation", WAYS, 1)
def test_residuals_have_the_derivatives_of_differences(interpolation: str) -> None:
    """By the numbers of the motor, the delay, and the clock of each recording, which moves its commands too."""
    clock = {"name": "clock", "sets": ["run0.offset", "run1.offset"], "each": "recording", "lower": -0.1}
    residuals = residuals_of(recorded_arm(interpolation, variable=[*VARIABLES, clock]), threads=1)
    shared, own = np.array([1.3, 0.0117, 0.04, 0.1, 0.01]), np.array([[0.0043], [0.0019]])
    which, h = np.array([0, 1]), 1e-6
    for k, (_, by_shared, by_own) in enumerate(residuals.jacobian(shared, own, which)):
        for j, columns in enumerate(np.hstack([by_shared, by_own]).T):
            step = h * np.eye(6)[j]
            ends = [residuals.residuals(shared + sign * step[:5], own + sign * step[5:], which)[k] for sign in (1, -1)]
            expected = (ends[0] - ends[1]) / (2 * h)
            assert np.abs(expected).max() > 100
            np.testing.assert_allclose(columns, expected, atol=1e-5 * np.abs(expected).max())


def test_each_recording_is_driven_by_its_own_commands() -> None:
    """At the truth what is left is the noise, though they differ in commands, rates and lengths."""
    problem = recorded_arm("constant")
    first, second = (each.inputs["knee.command"] for each in problem.recordings)
    assert len(first.time) < len(second.time) and first.time[-1] > second.time[-1]
    found = residuals_of(problem, threads=1).residuals(np.array(list(TRUTH.values())), np.zeros((2, 0)), np.arange(2))
    assert [np.sqrt(np.mean(each**2)) for each in found] == pytest.approx([1, 1], abs=0.15)


def test_angles_are_known_up_to_whole_turns() -> None:
    """An encoder that counts turns, and one that was set to zero a turn later, see the same motion."""
    angle = true_angles(0, "constant")
    problem = recorded_arm("constant", runs=1)
    (recording,) = problem.recordings
    values = recording.measured[0].values
    values.setflags(write=True)
    values[:, 0] = angle + 2 * np.pi
    values[40:, 0] -= 4 * np.pi
    found = residuals_of(problem, threads=1).residuals(np.array(list(TRUTH.values())), np.zeros((1, 0)), np.array([0]))
    assert np.abs(found[0]).max() < 1e-3


HAND = {"name": "hand", "sets": "rod.torque[1]", "knots": 3, "guess": [0.1, -0.2, 0.1]}
AIR = {"name": "air", "on": "knee.command", "value": "-air.c * knee.rate", "numbers": {"c": 0.1}}
STATE = {"name": "state", "reads": ["knee.angle", "knee.rate"]}
HOLD = {"name": "hold", "drives": ["knee.command"], "senses": ["state"], "linear": {}}
GAINS = {"name": "gains", "sets": "hold.gains", "guess": [-0.2, -0.05]}


@pytest.mark.slow
@few(
    "others",
    [
        {},
        {"variable": [*VARIABLES, HAND]},
        {"force": [AIR]},
        {"sensor": [STATE], "controller": [HOLD], "variable": [*VARIABLES, GAINS]},
    ],
    ids=["alone", "beside a variable", "with a force law", "with a controller"],
    count=1,
)
def test_commands_are_added_to_other_inputs(others: dict[str, Any]) -> None:
    """The compiled rollout, in which each step reads its command, and casadi's, which has all in one vector, agree."""
    residuals = residuals_of(recorded_arm("linear", **others), threads=1)
    predictor, shared, own = residuals.predictor, residuals.shared.guess, residuals.own.guess
    shared[1] = 0.0117
    for k, found in enumerate(predictor.values(shared, own, [0, 1])):
        motion, _, time = predictor.motion(shared, own, k)
        expected = np.interp(time, motion.time, motion["knee.angle"].ravel())
        assert found.values.ravel() == pytest.approx(expected, abs=1e-9)
    (plain,) = residuals_of(recorded_arm("linear", runs=1), 1).predictor.values(shared[:5], own[:1], [0])
    assert not others or np.abs(next(predictor.values(shared, own, [0])).values - plain.values).max() > 0.01


@pytest.mark.slow
def test_units_of_a_motors_numbers() -> None:
    """The gain of an affine motor is force by command, whose unit is anything."""
    assert residuals_of(recorded_arm("constant"), 1).shared.units == ("", "s", "N m s/rad", "N m", "kg m^2")


@pytest.mark.slow
def test_what_would_determine_a_joints_friction() -> None:
    """Not a slide, as for a surface."""
    still = {"name": "still", "rate": 50.0, "table": {"q": [0.0] * 20}}
    still |= {"measured": [{"value": "knee.angle", "columns": "q", "noise": 0.001}]}
    problem = symphys.load(arm(GUESS) | {"variable": [VARIABLES[3]], "recording": [still]})
    (direction,) = symphys.identify(problem, threads=1).open
    assert direction.text == "friction has no effect on what was measured"
    assert direction.advice == "Let the joint swing out to rest: its last swings show the dry friction"
