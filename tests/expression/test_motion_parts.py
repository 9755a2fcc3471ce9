"""What a formula takes of a whole motion: what is read, what is refused, and its units."""

from __future__ import annotations

import pickle

import pytest

from symphys.expression import FormulaError, parse
from symphys.expression.units import unit_of

GAIT = "end.knee.angle - start.knee.angle + end.time * integral(dot(ball.force, ball.velocity)) / average(ball.mass)"


def test_parts_have_the_names_of_what_they_need() -> None:
    formula = parse(GAIT, whole=True)
    assert [part.kind for part in formula.parts] == ["end", "start", "end", "integral", "average"]
    assert formula.needed == {"knee.angle", "time", "ball.force", "ball.velocity", "ball.mass"}
    assert pickle.loads(pickle.dumps(formula)).parts == formula.parts


def test_a_body_may_be_called_start() -> None:
    formula = parse("start.position[0] - end.start.position[0]", whole=True)
    assert formula.names == {"start.position", "end.start.position"}
    assert formula.needed == {"start.position"}


@pytest.mark.parametrize(
    ("text", "whole", "message"),
    [
        ("end.ball.position", False, "is of a whole motion; costs, targets, constraints and outputs"),
        ("integral(ball.mass)", False, "is of a whole motion"),
        ("integral(end.ball.mass)", True, "what has an integral is of one instant"),
        ("average(integral(time))", True, "what has an average is of one instant"),
        ("integral(1, 2)", True, "one formula is wanted; integral"),
        ("integral + 1", True, "write integral"),
        ("middle.ball.position", True, "only start. and end. add one"),
        ("integal(time)", True, "did you mean"),
    ],
)
def test_what_cannot_be_is_said(text: str, whole: bool, message: str) -> None:
    with pytest.raises(FormulaError, match=message):
        parse(text, whole)


def test_an_integral_has_the_unit_of_its_formula_times_seconds() -> None:
    units = {"a.power": "kg m^2/s^3", "a.mass": "kg", "a.velocity": "m/s", "a.position": "m"}
    assert unit_of(parse("integral(a.velocity)", True), units) == "m"
    assert unit_of(parse("average(a.velocity) - end.a.velocity", True), units) == "m/s"
    assert unit_of(parse("integral(a.velocity) / end.a.position", True), units) == ""
    assert unit_of(parse("integral(2) * a.mass", True), units) == ""
