"""Starts of jointed bodies that are numbers of each recording: joints carry what hangs on a body along."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import symphys
from symphys.prediction.residuals import RecordingResiduals, residuals_of

pytestmark = pytest.mark.slow

FIELDS = ("position", "orientation", "velocity", "angular_velocity")
TURN = np.array([0.9, 0.1, -0.3, 0.3]) / np.linalg.norm([0.9, 0.1, -0.3, 0.3])
TRUE = {
    "position": [0.1, -0.2, 1.4],
    "orientation": TURN.tolist(),
    "velocity": [0.5, 0.2, 1.0],
    "angular_velocity": [2.0, -3.0, 1.0],
}
ANGLE, RATE = 0.6, -5.0
"""[rad], [rad/s] of the hinge at the start."""


def tables(**more: Any) -> dict[str, Any]:
    """Two boxes on a hinge with dry friction, far above the ground."""
    box = {"shape": {"box": {"size": [0.1, 0.05, 0.05]}}}
    bodies = [
        {"name": "one", **box, "mass": 0.4, "position": [0, 0, 1]},
        {"name": "two", **box, "mass": 0.3, "position": [0, 0.06, 1]},
    ]
    hinge = {"name": "hinge", "hinge": {"axis": [0, 1, 0]}, "between": ["one", "two"], "point": [-0.03, 0.06, 1]}
    return {
        "simulation": {"duration": 0.2, "dt": 0.005},
        "body": bodies,
        "joint": [hinge | {"friction": 0.002}],
        "site": [{"name": "end", "body": "two", "position": [0.05, 0, 0]}],
        **more,
    }


NAMES = ("one.position", "one.orientation", "hinge.angle", "end.position")
FRICTION = {"name": "friction", "sets": "hinge.friction", "guess": 0.002}
OWN = [{"name": name, "sets": f"one.{name}", "each": "recording"} for name in FIELDS]
OWN += [{"name": "bend", "sets": "hinge.start", "each": "recording"}]
OWN += [{"name": "swing", "sets": "hinge.start_rate", "each": "recording"}]


def recorded(first: dict[str, Any], measured: dict[str, np.ndarray], variables: list[Any]) -> symphys.Problem:
    """A recording with this first row, which need not be where the measured motion began."""
    count = len(measured["hinge.angle"])
    table = {name: values.tolist() for name, values in measured.items()}
    table |= {name: [value] * count for name, value in first.items()}
    columns = [{"value": name, "columns": name, "noise": 0.001} for name in NAMES]
    start = {f"one.{name}": name for name in FIELDS} | {"hinge.angle": "angle", "hinge.rate": "rate"}
    recording = {"name": "toss", "rate": 200.0, "table": table, "measured": columns, "start": start}
    return symphys.load(tables(recording=[recording], variable=variables))


def motion() -> dict[str, np.ndarray]:
    """What is measured of the motion from the true start, by another way: all bodies begin as the first row says."""
    sizes = {"one.position": 3, "one.orientation": 4, "hinge.angle": 1, "end.position": 3}
    nothing = {name: np.tile(np.eye(1, size), (40, 1)) for name, size in sizes.items()}
    nothing["hinge.angle"] = np.zeros(40)
    found = residuals_of(recorded({**TRUE, "angle": ANGLE, "rate": RATE}, nothing, [FRICTION]), 1)
    (sampled,) = found.predictor.values(np.array([0.002]), np.zeros((1, 0)), [0])
    ends = np.cumsum([found.predictor.sizes[name] for name in NAMES])
    parts = np.split(sampled.values, ends[:-1], axis=1)
    return {name: part[:, 0] if part.shape[1] == 1 else part for name, part in zip(NAMES, parts, strict=True)}


@pytest.fixture(scope="module")
def problem() -> symphys.Problem:
    """The first row is not where the motion began, as noise makes it."""
    near = {name: np.array(value) + 0.02 for name, value in TRUE.items()}
    near["orientation"] /= np.linalg.norm(near["orientation"])
    first = {name: value.tolist() for name, value in near.items()}
    return recorded({**first, "angle": ANGLE - 0.05, "rate": RATE + 0.3}, motion(), [FRICTION, *OWN])


@pytest.fixture(scope="module")
def residuals(problem: symphys.Problem) -> RecordingResiduals:
    return residuals_of(problem, 1)


def true_numbers(residuals: RecordingResiduals) -> np.ndarray:
    """(1, 14): of a recording; an orientation as the rotation vector from the first row's, in axes of the body."""
    first = residuals.predictor.recordings[0].start["one.orientation"]
    turn = Rotation.from_quat(first, scalar_first=True).inv() * Rotation.from_quat(TURN, scalar_first=True)
    numbers = {**TRUE, "orientation": turn.as_rotvec()}
    return np.concatenate([*[numbers[name] for name in FIELDS], [ANGLE, RATE]])[None]


def test_estimates_begin_at_the_first_row(residuals: RecordingResiduals) -> None:
    (guess,) = residuals.own.guess
    assert guess[:3] == pytest.approx(np.array(TRUE["position"]) + 0.02)
    assert guess[-2:] == pytest.approx([ANGLE - 0.05, RATE + 0.3])


def test_joints_carry_what_hangs_on_a_body(residuals: RecordingResiduals) -> None:
    """The motion from a start that own numbers say is that of a recording whose first row says it."""
    found = residuals.residuals(np.array([0.002]), true_numbers(residuals), np.array([0]))
    assert np.abs(found[0]).max() < 1e-6, "[noise] of 1e-3 m"
    off = residuals.residuals(np.array([0.002]), residuals.own.guess, np.array([0]))
    assert np.abs(off[0]).max() > 1


def test_derivatives_are_those_of_differences(residuals: RecordingResiduals) -> None:
    shared, own, which, h = np.array([0.0015]), residuals.own.guess, np.array([0]), 1e-6
    ((_, _, by_own),) = residuals.jacobian(shared, own, which)
    for j in range(own.shape[1]):
        step = h * np.eye(own.shape[1])[j][None]
        ends = [residuals.residuals(shared, own + sign * step, which)[0] for sign in (1, -1)]
        assert by_own[:, j] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5, abs=0.01), j


@pytest.mark.slow
def test_start_and_friction_are_found(problem: symphys.Problem, residuals: RecordingResiduals) -> None:
    found = symphys.identify(problem, threads=1)
    assert found.status == "converged"
    assert found.own[0] == pytest.approx(true_numbers(residuals)[0], abs=1e-3)
    assert found["friction"].value == pytest.approx(0.002, abs=1e-4)


def test_recorded_angles_count_turns() -> None:
    """A wheel on a spiral spring from 9 rad swings through turns: its recording is met, and fits its stiffness."""
    time = np.arange(101) * 0.01
    angle, rate = 9.0 * np.cos(2 * time), -18.0 * np.sin(2 * time)
    wheel = {"name": "wheel", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "inertia": 0.01}
    hinge = {"name": "axle", "between": ["world", "wheel"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 0]}
    measured = [{"value": "axle.angle", "columns": "angle", "noise": 1e-3}]
    recording = {"name": "swing", "rate": 100.0, "measured": measured, "start": {"axle.angle": "angle"}}
    recording["table"] = {"angle": angle.tolist(), "rate": rate.tolist()}
    recording["start"] |= {"axle.rate": "rate"}  # type: ignore[operator]
    problem = symphys.load(
        {
            "simulation": {"duration": 1.0, "dt": 0.01},
            "world": {"gravity": [0, 0, 0]},
            "body": [wheel],
            "joint": [hinge | {"spring": {"stiffness": 0.05}}],
            "variable": [{"name": "stiffness", "sets": "axle.stiffness", "guess": 0.05}],
            "recording": [recording],
        }
    )
    found = residuals_of(problem, threads=1)
    off = found.residuals(np.array([0.04]), np.zeros((1, 0)), np.array([0]))[0]
    assert np.abs(off).max() * 1e-3 < 1e-4 * 9  # of second order in the step
    assert found.residuals(np.array([0.4]), np.zeros((1, 0)), np.array([0]))[0].max() * 1e-3 > 2 * np.pi
    assert symphys.identify(problem).parameters[0].value == pytest.approx(0.04, rel=1e-4)
