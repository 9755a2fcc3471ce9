"""What is no formula is refused, with the piece at fault and what would be valid."""

from __future__ import annotations

import re

import casadi as ca
import pytest

from symphys.expression import FormulaError, parse

NAMES = {"ball.position": [1, 2, 3], "ball.velocity": [0, 0, 0], "ball.mass": 1.0, "pair": [1, 2]}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        (" \n\t", "empty"),
        ("1 +", "cannot read the formula"),
        ("norm(ball.position", "never closed"),
        ("a b", "cannot read"),
        ("a;b", "cannot read"),
        ("a = 1", "cannot read"),
        ("1if 2else 3", "cannot read"),
        ("nrm(ball.position)", '"norm"'),
        ("__import__('os').system('true')", "only functions by plain name are called"),
        ("__import__('os')", "unknown function"),
        ("eval('1')", "unknown function"),
        ("().__class__", "at most one dot"),
        ("ball.position.x", r"at most one dot; components are \[0\]"),
        ("ball.norm()", "only functions by plain name"),
        ("(lambda: 1)()", "only functions by plain name"),
        ("lambda: 1", "not allowed"),
        ("[x for x in y]", "not allowed"),
        ("(x := 1)", "not allowed"),
        ("{1: 2}", "not allowed"),
        ("{1, 2}", "not allowed"),
        ("'text'", "not allowed"),
        ("f'{x}'", "not allowed"),
        ("b'x'", "not allowed"),
        ("...", "not allowed"),
        ("None", "not allowed"),
        ("True", "not allowed"),
        ("1j", "not allowed"),
        ("(1, 2)", "square brackets"),
        ("1 < 2", "no comparisons"),
        ("1 if time else 2", "no conditions"),
        ("a and b", "not allowed"),
        ("not a", "not allowed"),
        ("~1", "not allowed"),
        ("2 ^ 3", r"powers are written \*\*"),
        ("7 % 3", "operators are"),
        ("7 // 3", "operators are"),
        ("a @ b", "operators are"),
        ("sin", r"is a function; write sin\(x\)"),
        ("sin()", r"has 0 arguments; write sin\(x\)"),
        ("atan2(1)", r"write atan2\(y, x\)"),
        ("norm(x=1)", "arguments are plain values"),
        ("max(*pair)", "arguments are plain values"),
        ("[]", "at least one component"),
        ("pair[0.5]", "an index is one integer"),
        ("pair[time]", "an index is one integer"),
        ("pair[True]", "an index is one integer"),
        ("pair[0, 1]", "an index is one integer"),
        ("1e999", "too large"),
        ("9" * 400, "too large"),
        ("9" * 5000, "cannot read"),
        ("9**9**9", "not a finite real number"),
        ("1 / 0", "not a finite real number"),
        ("sqrt(-1)", "not a finite real number"),
        ("log(0)", "not a finite real number"),
        ("[1, 2] + [1, 2, 3]", "a vector of 2 and a vector of 3"),
        ("[1, 2][2]", r"no component 2: .* 0 to 1"),
        ("[1, 2][0:3]", "reaches 3"),
        ("[1, 2][1:1]", "range is empty"),
        ("[1, 2][::0]", "step of the range is 0"),
        ("[1, 2][99999999999999999999]", "no component"),
        ("dot([1, 2], [1, 2, 3])", "same length"),
        ("cross([1, 2], [1, 2])", "3 components"),
        ("rotate([1, 2, 3], [1, 2, 3])", "quaternion must have 4"),
        ("2 \u00d7 3", r"write \*$"),
        ("\u03c0", "write pi"),
        ("1 # one", "character '#'"),
        ("1\x00", "not allowed"),
        ("\ud800", "not allowed"),
        ("a\\\nb", "not allowed"),
        ("1" * 10_001, "10001 characters"),
        ("(" * 5_000, "cannot read|too deep"),
        ("[" * 150 + "]" * 150, "too deep"),
        ("-" * 150 + "1", "too deep"),
        ("-" * 9_000 + "1", "too deep"),
        ("a" + "[0]" * 3_000, "too deep"),
        ("2**" * 3_000 + "1", "too deep"),
        ("+".join("a" * 4_000), "too deep"),
        ("[" + "a," * 4_000 + "]", "too long"),
    ],
)
def test_refused_when_read(text: str, message: str) -> None:
    with pytest.raises(FormulaError) as caught:
        parse(text)
    assert re.search(message, str(caught.value), re.DOTALL), str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("smooth_max(pair, 0)", "the width, the last argument, must be a number above 0"),
        ("smooth_max(ball.mass, pair)", "the width, the last argument, must have 1 component"),
        ("ball.velocty", '"ball.velocity"'),
        ("bll.mass", '"ball.mass"'),
        ("ball", "unknown name"),
        ("ball.position + pair", 'in "ball.position . pair": a vector of 3 and a vector of 2'),
        ("ball.position[5]", "no component 5"),
        ("cross(pair, ball.position)", "first vector must have 3 components, but is a vector of 2"),
    ],
)
def test_refused_when_evaluated(text: str, message: str) -> None:
    with pytest.raises(FormulaError, match=message):
        parse(text).evaluate(NAMES)


def test_a_matrix_is_no_value() -> None:
    with pytest.raises(FormulaError, match="2 x 3 matrix"):
        parse("a").evaluate({"a": ca.DM(2, 3)})
