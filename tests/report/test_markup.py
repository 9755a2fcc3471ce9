"""Shown numbers are near their values; text is escaped once; names can be written; numbers are read with care."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symphys import json_values as values
from symphys.report.pages.markup import Html, slug, tag
from symphys.report.pages.sections import variable_rows
from symphys.report.pages.words import show
from symphys.results.result import VariableRecord


@settings(max_examples=200, deadline=None)
@given(st.floats(-1e300, 1e300))
def test_shown_number_is_near_the_value(value: float) -> None:
    text = show(value).replace("\N{NARROW NO-BREAK SPACE}", "").replace("−", "-")  # noqa: RUF001
    mantissa, _, power = text.partition(" × 10")  # noqa: RUF001
    exponent = int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
    assert float(f"{mantissa}e{exponent}") == pytest.approx(value, rel=6e-3)


def test_numbers_that_are_not_finite_are_told_apart() -> None:
    shown = {show(value) for value in (math.nan, math.inf, -math.inf)}
    assert len(shown) == 3 and not any(character.isdigit() for text in shown for character in text)


def test_text_is_escaped_once() -> None:
    inner = tag("b", "a < b & c")
    assert tag("p", inner, title='"x"') == '<p title="&quot;x&quot;"><b>a &lt; b &amp; c</b></p>'
    assert isinstance(inner, Html)
    assert tag("p", str(inner)) == "<p>&lt;b&gt;a &amp;lt; b &amp;amp; c&lt;/b&gt;</p>"


@pytest.mark.parametrize(
    ("value", "read"),
    [(1, 1.0), ("inf", math.inf), ("-inf", -math.inf), (True, math.nan), (None, math.nan), ("x", math.nan),
     ([], math.nan), (10**400, math.nan)],
)  # fmt: skip
def test_numbers_are_read_with_care(value: object, read: float) -> None:
    assert np.array_equal(values.number(value), read, equal_nan=True)


@settings(max_examples=200, deadline=None)
@given(st.text())
def test_names_can_be_written(text: str) -> None:
    line = values.name(text)
    assert "\n" not in line
    assert len(line) <= values.NAME_LENGTH
    line.encode()
    assert set(slug(text)) <= set("abcdefghijklmnopqrstuvwxyz0123456789_-")


def test_weights_of_a_net_take_one_row() -> None:
    """The range of the guess and of the result, and the distance between them."""
    guess, free = np.linspace(-1, 2, 500)[:, None], np.full((500, 1), np.inf)
    (row,) = variable_rows(VariableRecord("w", ("brain.weights",), guess + 0.5, guess, -free, free))
    text = " ".join(row)
    assert "500" in text and "brain.weights" in text
    assert "1 to 2" in text and "0.5 to 2.5" in text and "by 0.5" in text
