"""Units of targets and constraints: given, else those of their formulas; also through variables and joints."""

from __future__ import annotations

from pathlib import Path

import pytest

from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import transcribe

TEXT = """
[simulation]
duration = 0.1
dt = 0.05
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
[[variable]]
name = "throw"
sets = "ball.velocity"
[[variable]]
name = "start"
sets = "ball.position[0]"
"""


def targets(tmp_path: Path, *tables: str) -> list[str]:
    path = tmp_path / "units.toml"
    path.write_text(TEXT + "".join(tables), encoding="utf-8")
    problem = load_problem(path)
    return [each.unit for each in (*problem.targets, *problem.constraints)]


def target(value: str, more: str = "") -> str:
    return f"[[target]]\nname = '{value}'\nvalue = '{value}'\ntolerance = 1\n{more}\n"


def test_variables_have_the_unit_of_what_they_set_and_a_given_unit_beats_that_of_the_formula(tmp_path: Path) -> None:
    found = targets(
        tmp_path,
        target("throw - 1"),
        target("start - ball.position[0]"),
        target("ball.position[1] / 7", 'unit = "weeks"'),
        "[[constraint]]\nname = 'c'\nvalue = 'ball.contact_force'\nupper = 1\n",
        "[[constraint]]\nname = 'd'\nvalue = 'ball.gyro'\nupper = 1\nunit = 'rpm'\n",
    )
    assert found == ["m/s", "m", "weeks", "N", "rpm"]


def test_checks_carry_the_units_of_what_they_check() -> None:
    """Angles of a hinge and ways of a slider; one target that has both has none."""
    problem = load_problem(find("cart_pole"))
    checks = transcribe(problem, backend="casadi").judge(problem.variables[0].guess).checks
    assert {check.name: check.unit for check in checks} == {
        **{"upright": "", "in its place": "m", "at rest": ""},
        "objective": "",
    }


@pytest.mark.parametrize(("name", "units"), [("bank_shot", ["m", "m", "m/s"]), ("juggle", ["", ""])])
def test_shipped_problems(name: str, units: list[str]) -> None:
    """Of the second each target joins metres with a tenth of a speed, which hides a unit of time."""
    assert [target.unit for target in load_problem(find(name)).targets] == units
