"""Numbers in plain words, HTML from parts, levels from numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symphys.report import values
from symphys.report.markup import Html, tag
from symphys.report.output import slug
from symphys.report.records import Trust
from symphys.report.trust import BAD, FAIR, GOOD, UNKNOWN, Sizes, depth_finding, graded, residual_finding
from symphys.report.words import count, listed, seconds, show


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (1.0, "1"), (-2.5, "−2.5"), (0.00834, "0.00834"), (1.2e-5, "1.2 × 10⁻⁵"), (1e-9, "1 × 10⁻⁹"),  # noqa: RUF001
        (12345.0, "12\N{NARROW NO-BREAK SPACE}300"), (999.96, "1000"), (3e7, "3 × 10⁷"), (100.0, "100"),  # noqa: RUF001
        (math.nan, "–"), (math.inf, "∞"), (-math.inf, "−∞"),  # noqa: RUF001
    ],
)  # fmt: skip
def test_numbers_as_people_write_them(value: float, text: str) -> None:
    assert show(value) == text


@settings(max_examples=200, deadline=None)
@given(st.floats(-1e300, 1e300))
def test_shown_number_is_near_the_value(value: float) -> None:
    text = show(value).replace("\N{NARROW NO-BREAK SPACE}", "").replace("−", "-")  # noqa: RUF001
    mantissa, _, power = text.partition(" × 10")  # noqa: RUF001
    exponent = int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
    assert float(f"{mantissa}e{exponent}") == pytest.approx(value, rel=6e-3)


def test_durations_counts_and_lists() -> None:
    assert [seconds(s) for s in (0.0, 0.0123, 1.5, 900.0)] == ["0 ms", "12 ms", "1.5 s", "15 min"]
    assert count(1234567.0) == "1\N{NARROW NO-BREAK SPACE}234\N{NARROW NO-BREAK SPACE}567"
    assert count(54.5) == "54.5"
    assert [listed(parts) for parts in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == ["", "a", "a and b", "a, b and c"]


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


def test_levels() -> None:
    assert [graded(x, (1, 3)) for x in (0.5, 1, 2, 4, math.inf, math.nan)] == [GOOD, GOOD, FAIR, BAD, BAD, UNKNOWN]
    trust = Trust(residual=1e-3, deepest=0.02)
    assert residual_finding(trust, Sizes(impulse=0.1)).level == FAIR
    assert residual_finding(trust, Sizes()).level == UNKNOWN
    assert depth_finding(trust, Sizes(radius=0.1)).level == BAD
    assert depth_finding(Trust(deepest=-1e-9), Sizes()).level == GOOD
