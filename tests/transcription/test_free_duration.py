"""A duration that a variable sets: the motion is that of the fixed duration, its slopes exact, by every backend."""

from __future__ import annotations

from typing import Any

import pytest

from symphys import problems
from symphys.errors import ProblemError, SymphysError
from symphys.problem import Problem, load_problem, problem_of_tables
from symphys.transcription import Transcription, transcribe
from symphys.transcription.open_step import compile_open_step
from symphys.verification import examine
from symphys.verification.examination import survey

TABLES: dict[str, Any] = {
    "simulation": {"duration": 0.6, "dt": 0.02},
    "body": [
        {"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 0.5, "position": [0, 0, 0.3]},
        {"name": "arm", "shape": {"capsule": {"radius": 0.02, "length": 0.3}}, "mass": 1, "position": [3, 0, 1]},
    ],
    "ground": {"restitution": 0.5},
    "joint": [
        {
            "name": "hinge",
            "between": ["world", "arm"],
            "hinge": {"axis": [0, 1, 0]},
            "point": [3, 0, 1.2],
            "motor": {"torque": {"torque": 50}},
            "spring": {"stiffness": 2, "damping": 0.1},
            "start": 0.3,
        }
    ],
    "force": [{"name": "drag", "on": "ball.force", "value": "-0.1 * norm(ball.velocity) * ball.velocity"}],
    "sensor": [{"name": "clock", "reads": ["sin(3 * time)", "duration"]}],
    "controller": [
        {"name": "brain", "drives": "ball.force[1]", "senses": ["clock"], "linear": {"gains": [[1.0, 0.2]]}}
    ],
    "variable": [
        {"name": "throw", "sets": "ball.velocity", "guess": [1, 0.5, 0.2]},
        {"name": "T", "sets": "simulation.duration", "guess": 0.7},
        {"name": "swing", "sets": "hinge.command", "knots": 4, "interpolation": "linear", "guess": [1, 2, -1, 0.5]},
    ],
    "cost": [
        {"name": "running", "at": "always", "squares": "[ball.velocity, time * hinge.rate, 0.1 * duration]"},
        {"name": "of inputs", "at": "always", "value": "hinge.command**2 + arm.accelerometer[0]**2", "weight": 0.01},
        {"name": "whole", "value": "integral(norm(ball.velocity)) / end.time + duration"},
    ],
    "target": [{"name": "there", "value": "ball.position - [1, 0, 0.1] * time", "tolerance": 0.01}],
    "constraint": [{"name": "low", "at": "always", "value": "ball.position[2]", "upper": 0.35}],
    "output": [{"name": "end", "value": "time"}],
}


@pytest.fixture(scope="module")
def made() -> Transcription:
    """At the duration of its guess, 0.7 s."""
    return transcribe(problem_of_tables(TABLES), backend="casadi")


@pytest.fixture(scope="module")
def other() -> Transcription:
    """The same where 0.7 s are the duration of the file."""
    fixed = {**TABLES, "simulation": {"duration": 0.7, "dt": 0.7 / 30}}
    fixed["variable"] = [each for each in TABLES["variable"] if each["name"] != "T"]
    return transcribe(problem_of_tables(fixed), backend="casadi")


@pytest.mark.slow
def test_the_motion_is_that_of_the_fixed_duration(made: Transcription, other: Transcription) -> None:
    motion, expected = made.simulate(made.shooting.start(0)), other.simulate(other.shooting.start(0))
    assert motion.time == pytest.approx(expected.time, rel=1e-14)
    for field in ("position", "velocity", "force", "contact_force", "joint_value"):
        assert getattr(motion, field) == pytest.approx(getattr(expected, field), rel=1e-9, abs=1e-10, nan_ok=True), (
            field
        )
    judged, known = made.judge(made.shooting.start(0)), other.judge(other.shooting.start(0))
    assert judged.costs == pytest.approx(known.costs, rel=1e-9)


def free(name: str, **settings: Any) -> Problem:
    text = problems.find(name).read_text(encoding="utf-8")
    path = settings.pop("folder") / f"{name}.toml"
    path.write_text(f'{text}\n[[variable]]\nname = "how_long"\nsets = "simulation.duration"\n', encoding="utf-8")
    return load_problem(path, settings)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["parcel", "quadruped_shift"])
def test_a_free_duration_at_the_value_of_the_file_changes_nothing(name: str, tmp_path: Any) -> None:
    settings = {"simulation.duration": 0.2}
    made = transcribe(free(name, folder=tmp_path, **settings), backend="casadi")
    other = transcribe(load_problem(problems.find(name), settings), backend="casadi")
    motion, expected = made.simulate(made.shooting.start(0)), other.simulate(other.shooting.start(0))
    assert motion.position == pytest.approx(expected.position, rel=1e-9, abs=1e-10)


def test_steps_give_the_merit_of_the_whole_and_its_gradient() -> None:
    """Penalties of what holds always grow with the duration."""
    tables = {name: TABLES[name] for name in ("ground", "target", "force")}
    tables |= {
        "simulation": {"duration": 0.2, "dt": 0.02},
        "body": TABLES["body"][:1],
        "variable": TABLES["variable"][:2],
    }
    tables |= {"constraint": [{"name": "low", "at": "always", "value": "ball.position[2]", "upper": 0.2}]}
    shooting = transcribe(problem_of_tables(tables), backend="casadi").shooting
    assert shooting.by_steps is not None
    z = shooting.start(0)[None]
    found, expected = (each.gradient(z, 0.0) for each in (shooting.by_steps, shooting.evaluator))
    assert found.merit > found.objective
    assert found.merit == pytest.approx(expected.merit, rel=1e-10)
    assert found.gradient == pytest.approx(expected.gradient, rel=1e-8, abs=1e-8)


@pytest.mark.thorough
def test_an_examination_is_of_the_duration_of_z(made: Transcription, other: Transcription) -> None:
    found = examine(made, made.shooting.start(0))
    expected = survey(other, other.record(other.shooting.start(0)))
    assert found["growth"]["time"][-1] == pytest.approx(0.7, rel=0.05)
    for part, values in expected["energy"].items():
        assert found["energy"][part] == pytest.approx(values, rel=1e-6, abs=1e-8), part
    assert max(row["error"] for row in found["gradient"]) < 1e-6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"target": [{"name": "t", "value": "time", "at": 0.3, "tolerance": 1}]},
            r'"t".at: .*since',
        ),
        ({"variable": [{"name": "T", "sets": "simulation.duration", "lower": 0}]}, r"must be greater than 0"),
        ({"variable": [{"name": "T", "sets": "simulation.duration", "knots": 3}]}, r'"T".knots: .*force'),
        ({"variable": [{"name": "T", "sets": ["simulation.duration", "ball.mass"]}]}, r"different kinds"),
        ({"variable": [{"name": "T", "sets": "simulation.dt"}]}, '"simulation.duration"'),
    ],
)
def test_what_cannot_be_names_table_and_key(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        problem_of_tables({**TABLES, **change})


def test_a_single_step_has_no_free_duration() -> None:
    with pytest.raises(SymphysError, match=r"duration.*single step"):
        compile_open_step(problem_of_tables(TABLES), backend="casadi")
