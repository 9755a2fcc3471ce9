"""Raw solver tables against the dataclasses of solvers."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import pytest

from symphys.errors import ProblemError
from symphys.problem import json_schema, require_solvers, validate_options


class Method(Enum):
    PLAIN = "plain"
    ADAM = "adam"


@dataclass(frozen=True)
class Options:
    iterations: int = 100
    rate: float = 0.1
    schedule: tuple[float, ...] = (1.0,)
    method: Method = Method.PLAIN
    mode: Literal["a", "b"] = "a"
    clip: float | None = None
    verbose: bool = False
    extra: dict[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise ValueError("iterations must be at least 1")


@dataclass(frozen=True)
class Needy:
    population: int


def read(table: dict[str, object]) -> Options:
    return validate_options(Options, table, "file.toml", "solver.gradient")


def test_defaults() -> None:
    assert read({}) == Options()


def test_values() -> None:
    table: dict[str, object] = {
        "iterations": 5,
        "rate": 1,
        "schedule": [2, 1, 0.5],
        "method": "adam",
        "mode": "b",
        "clip": float("inf"),
        "verbose": True,
        "extra": {"CMA_mu": 3, "deep": {"x": [1, "2"]}},
    }
    expected = Options(
        5, 1.0, (2, 1, 0.5), Method.ADAM, "b", float("inf"), True, {"CMA_mu": 3, "deep": {"x": [1, "2"]}}
    )
    assert read(table) == expected
    assert isinstance(read(table).rate, float)
    assert isinstance(read(table).schedule, tuple)


@pytest.mark.parametrize(
    ("table", "where", "message"),
    [
        ({"iteratons": 5}, "solver.gradient.iteratons", '"iterations"'),
        ({"iterations": "5"}, "solver.gradient.iterations", '"5"'),
        ({"iterations": 2.5}, "solver.gradient.iterations", "whole number, not 2.5"),
        ({"iterations": True}, "solver.gradient.iterations", "whole number, not true"),
        ({"iterations": 0}, "solver.gradient", "iterations must be at least 1"),
        ({"rate": "fast"}, "solver.gradient.rate", "must be a number"),
        ({"rate": float("nan")}, "solver.gradient.rate", "must be a number, not nan"),
        ({"schedule": 1}, "solver.gradient.schedule", "must be a list"),
        ({"schedule": [1, "2"]}, "solver.gradient.schedule[1]", "must be a number"),
        ({"method": "adm"}, "solver.gradient.method", "'plain' or 'adam'"),
        ({"mode": "c"}, "solver.gradient.mode", "'a' or 'b'"),
        ({"clip": "x"}, "solver.gradient.clip", "must be a number"),
        ({"extra": 3}, "solver.gradient.extra", "must be a table"),
    ],
)
def test_refused(table: dict[str, object], where: str, message: str) -> None:
    with pytest.raises(ProblemError) as caught:
        read(table)
    (issue,) = caught.value.issues
    assert issue.where == where
    assert message in issue.message
    assert caught.value.file == "file.toml"


def test_a_required_option() -> None:
    with pytest.raises(ProblemError, match=r"solver\.x\.population: .*required"):
        validate_options(Needy, {}, "file.toml", "solver.x")


def test_names_of_solvers() -> None:
    require_solvers(["cma"], ["gradient"], ["cma", "gradient"], "file.toml")
    with pytest.raises(ProblemError, match=r'solver\.gradeint: .*"gradient"'):
        require_solvers(["cma", "gradeint"], [], ["cma", "gradient"], "file.toml")
    with pytest.raises(ProblemError, match=r'solvers\[1\]: .*"cma"'):
        require_solvers([], ["gradient", "cmaes"], ["cma", "gradient"], "file.toml")


@dataclass(frozen=True)
class Renamed:
    adjoint_discount: float = field(default=2.0, metadata={"was": "forget"})


def renamed(table: dict[str, object]) -> Renamed:
    return validate_options(Renamed, table, "file.toml", "solver.gradient")


def test_old_names_go_on_working() -> None:
    assert renamed({"forget": 5}) == renamed({"adjoint_discount": 5}) == Renamed(5.0)
    with pytest.raises(ProblemError, match=r"solver.gradient.forget: .*adjoint_discount"):
        renamed({"forget": 5, "adjoint_discount": 5})


def test_the_schema_marks_old_names_as_deprecated() -> None:
    schema = json_schema({"gradient": Renamed})
    marked = schema["$defs"]["Renamed"]["properties"]
    assert marked["forget"]["deprecated"] is True
    assert "deprecated" not in marked["adjoint_discount"]
    assert schema["properties"]["fall"]["deprecated"] is True
