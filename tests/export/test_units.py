"""The numbers of an exported problem have sizes and units."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from symphys.export import ExportError, problem_model, words
from symphys.problem import load_problem, problem_of_tables
from symphys.transcription.rollout import symbolic_rollout

ARM = """
[simulation]
duration = 0.1
dt = 0.01

[[body]]
name = "cart"
mass = 1.0
inertia = 0.1

[[body]]
name = "arm"
mass = 1.0
inertia = 0.1
position = [0, 0, -0.5]

[[joint]]
name = "rail"
between = ["world", "cart"]
slider = { axis = [1, 0, 0] }
motor = { torque = { torque = 5 } }

[[joint]]
name = "wrist"
between = ["cart", "arm"]
universal = { axes = [[0, 1, 0], [1, 0, 0]] }
point = [0, 0, 0]
motor = { servo = { gain = 5, torque = 5, velocity = 5 } }

[[variable]]
name = "push"
sets = "rail.command"
knots = 2

[[variable]]
name = "aim"
sets = "wrist.command"

[[variable]]
name = "strong"
sets = "wrist.torque"
"""


def test_commands_have_their_sizes_and_units(tmp_path: Path) -> None:
    file = tmp_path / "arm.toml"
    file.write_text(ARM, encoding="utf-8")
    problem = load_problem(file)
    rollout = symbolic_rollout(problem)
    lines = words.decision_lines(problem) + words.input_lines(rollout) + words.parameter_lines(rollout)
    named = [found.groups() for line in lines if (found := re.match(r"(\S+).*?(\w+\.\w+) (\[.*?\])", line))]
    assert named == [
        ("z[0..1]", "rail.command", "[N]"),
        ("z[2..3]", "wrist.command", "[rad]"),
        ("z[4]", "wrist.torque", "[N m]"),
        ("u[0]", "rail.command", "[N]"),
        ("u[1..2]", "wrist.command", "[rad]"),
        ("p[0]", "wrist.torque", "[N m]"),
    ]
    states = words.state_lines(rollout)
    assert any(line.endswith("rail.motor [N]") for line in states)
    assert any(line.endswith("wrist.motor [N m]") for line in states)


def test_a_free_duration_and_numbers_of_laws_are_named() -> None:
    law = {"name": "drag", "on": "ball.force", "value": "-drag.c[0] * ball.velocity", "numbers": {"c": [0.1, 0.2]}}
    problem = problem_of_tables(
        {
            "simulation": {"duration": 0.1, "dt": 0.01},
            "body": [{"name": "ball", "mass": 1, "inertia": 1}],
            "force": [law],
            "variable": [{"name": "T", "sets": "simulation.duration"}, {"name": "c", "sets": "drag.c[0]"}],
            "cost": [{"name": "c", "value": "ball.position[0]"}],
        }
    )
    assert [line.split(None, 1)[1] for line in words.decision_lines(problem)] == [
        "T: simulation.duration [s]",
        "c: drag.c[0]",
    ]
    with pytest.raises(ExportError, match="drag"):
        problem_model(problem)
    assert "drag" in problem_model(problem, approximate=True).text
