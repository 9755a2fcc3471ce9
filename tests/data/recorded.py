"""Small problems with recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomli_w

from symphys.problem import Problem, load_problem, problem_of_tables

BALL: dict[str, Any] = {
    "simulation": {"duration": 1.0, "dt": 0.01},
    "body": [{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "position": [0, 0, 1]}],
    "ground": {"restitution": 0.5},
    "variable": [{"name": "bounce", "sets": "ground.restitution"}],
}
HEIGHT = {"value": "ball.position[2]", "columns": "z"}
TABLE = {"time": [0.0, 0.1, 0.2], "z": [1.0, 0.95, 0.8]}


def with_recording(*tables: dict[str, Any], **others: Any) -> dict[str, Any]:
    """The tables of a problem about a ball with these [[recording]] tables; a name and a height are added."""
    return {**BALL, "recording": [{"name": "drop", "measured": [HEIGHT], **table} for table in tables], **others}


def loaded(*tables: dict[str, Any], **others: Any) -> Problem:
    """That problem."""
    return problem_of_tables(with_recording(*tables, **others))


def beside(folder: Path, *tables: dict[str, Any], **others: Any) -> Problem:
    """That problem as a file in a folder, where its files are."""
    file = folder / "problem.toml"
    file.write_text(problem_text(*tables, **others), encoding="utf-8")
    return load_problem(file)


def problem_text(*tables: dict[str, Any], **others: Any) -> str:
    """Its text."""
    return tomli_w.dumps(with_recording(*tables, **others))
