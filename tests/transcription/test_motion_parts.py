"""Formulas of whole motions: start, end and integrals are those of the rollout, with exact slopes, by every backend."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symphys.errors import ProblemError, SymphysError
from symphys.problem import Problem, load_problem
from symphys.transcription import Transcription, transcribe
from symphys.transcription.nan_tracing import first_non_finite
from symphys.transcription.open_step import compile_open_step

BALL = """
[simulation]
duration = 0.6
dt = 0.01
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 0.5
position = [0, 0, 1]
[ground]
restitution = 0.5
[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 0.5, 0.2]
[[variable]]
name = "push"
sets = "ball.force[0]"
knots = 5
guess = [1, -2, 3, 1, 0.5]
[[cost]]
name = "whole"
value = "integral(sumsqr(ball.velocity) + ball.force[0]**2)"
[[cost]]
name = "running"
at = "always"
value = "sumsqr(ball.velocity) + ball.force[0]**2"
[[cost]]
name = "of transport"
value = "integral(abs(ball.force[0] * ball.velocity[0])) / norm(end.ball.position - start.ball.position)"
[[target]]
name = "periodic"
value = "end.ball.velocity[0:2] - start.ball.velocity[0:2]"
tolerance = 0.01
[[target]]
name = "half way"
at = 0.3
value = "ball.position - start.ball.position"
tolerance = 0.01
[[constraint]]
name = "on average"
value = "average(ball.position[2])"
lower = 0.7
[[output]]
name = "duration"
value = "end.time - start.time"
"""


def load(tmp_path: Path, text: str) -> Problem:
    path = tmp_path / "ball.toml"
    path.write_text(text, encoding="utf-8")
    return load_problem(path)


NOT_FINITE = BALL.replace("sumsqr(ball.velocity) +", "sqrt(ball.position[2] - 0.5) +", 1)


@pytest.fixture
def ball(tmp_path: Path) -> Transcription:
    return transcribe(load(tmp_path, BALL), backend="casadi")


def test_an_integral_is_the_running_cost_and_start_and_end_are_those_of_the_motion(ball: Transcription) -> None:
    z = ball.shooting.start(1)
    judged, motion = ball.judge(z), ball.simulate(z)
    assert judged.costs["whole"] == pytest.approx(judged.costs["running"], rel=1e-14)
    assert judged.outputs["duration"] == pytest.approx(0.6, rel=1e-15)
    periodic, half, _ = judged.checks
    velocity, position = motion.velocity[:, 0], motion.position[:, 0]
    assert periodic.error == pytest.approx(np.linalg.norm((velocity[-1] - velocity[0])[:2]), rel=1e-12)
    assert half.error == pytest.approx(np.linalg.norm(position[30] - position[0]), rel=1e-12)
    power = np.abs(motion.force[:, 0, 0] * velocity[:-1, 0]) + np.abs(motion.force[:, 0, 0] * velocity[1:, 0])
    work = 0.01 * power.sum() / 2
    assert judged.costs["of transport"] == pytest.approx(work / np.linalg.norm(position[-1] - position[0]), rel=1e-12)


def test_where_a_part_is_not_finite_is_said(tmp_path: Path) -> None:
    made = transcribe(load(tmp_path, NOT_FINITE), backend="casadi")
    found = first_non_finite(made.rollout, made.record(made.shooting.start(0)).arrays)
    assert found.startswith("cost 'whole' is not finite at t = 0.3")


def test_a_single_step_has_no_whole_motion(tmp_path: Path) -> None:
    with pytest.raises(SymphysError, match=r"integral.*whole motion"):
        compile_open_step(load(tmp_path, BALL), backend="casadi")


@pytest.mark.parametrize(
    ("found", "given", "message"),
    [
        (
            'at = "always"\nvalue = "',
            'at = "always"\nvalue = "end.time + ',
            r'"running".at: .*"end"',
        ),
        ("end.ball.velocity", "end.bal.velocity", '"bal.velocity"'),
        ("average(ball.position[2])", "average(ball.position[3])", r"no component 3"),
        ("average(ball.position[2])", "average(end.time)", r"what has an average is of one instant"),
    ],
)
def test_what_cannot_be_names_table_and_key(tmp_path: Path, found: str, given: str, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        load(tmp_path, BALL.replace(found, given, 1))


def test_the_largest_value_along_a_motion_is_a_smooth_maximum_over_time(tmp_path: Path) -> None:
    width = 1e-3
    text = (
        BALL
        + f'[[output]]\nname = "top"\nvalue = "{width} * log(average(exp((ball.position[2] - 1) / {width}))) + 1"\n'
    )
    file = tmp_path / "peak.toml"
    file.write_text(text.replace("guess = [1, 0.5, 0.2]", "guess = [1, 0.5, 2]"))
    made = transcribe(load_problem(file), backend="casadi")
    z = made.shooting.start(0)
    peak = 1 + 2**2 / (2 * 9.81)
    found = float(made.judge(z).outputs["top"])
    # about the peak the height is peak - g t^2 / 2, so that the mean is a Gaussian integral
    expected = peak + width * np.log(np.sqrt(2 * np.pi * width / 9.81) / 0.6)
    assert found == pytest.approx(expected, abs=0.02 * width)
