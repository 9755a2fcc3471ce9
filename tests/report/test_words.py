"""Numbers, durations and lists are worded to their precision; text is escaped once; levels follow the numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symphys import json_values as values
from symphys.findings.advice import advice, answers, findings, slopes
from symphys.findings.contacts import depth_finding, residual_finding
from symphys.findings.examination import Energy, Examination, Gain, GradientCheck, Growth, Refined, Smoothed
from symphys.findings.levels import BAD, FAIR, GOOD, UNKNOWN, Judged, graded
from symphys.findings.numerics import slope_finding, smoothed_findings
from symphys.report.pages.markup import Html, slug, tag
from symphys.report.pages.sections import variable_rows
from symphys.report.pages.words import count, listed, seconds, show
from symphys.results.result import VariableRecord


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
    assert residual_finding(Examination(residual=1e-3, impulse=0.1), MET).level == FAIR
    assert residual_finding(Examination(residual=1e-3), MET).level == UNKNOWN
    assert depth_finding(Examination(deepest=0.02, size=0.1)).level == BAD
    assert depth_finding(Examination(deepest=-1e-9)).level == GOOD
    named = depth_finding(Examination(deepest=0.02, size=0.1, depth_contact="box-ground", depth_time=1.5))
    assert "box-ground at t = 1.5 s" in named.number


SOUND = Examination(
    gradient=(GradientCheck("throw", 1e-9, 1.0),),
    refined=(Refined("dt / 2", 1.01, 0.5, {"throw": 0.01}), Refined("sweeps x 2", 1.0, 0.5, {"throw": 0.0})),
    smoothed=(Smoothed(1e-3, False, 1.0, 0.5),),
    growth=Growth(np.array([0.0, 1, 2]), np.array([3.0, 2, 1])),
    gained=0.0,
    drift=0.0,
    momentum=1e-16,
    residual=0.0,
    deepest=0.0,
    multiple_impacts=0.0,
)
MET = Judged(1.0, 0.5, True, True)


def test_advice_of_a_sound_solution() -> None:
    assert {line.level for line in findings(SOUND, MET)} == {GOOD}
    assert advice(SOUND, MET) == (
        "The gradient is right: it agrees with differences. It reaches over the whole horizon, since changes hardly "
        "grow on the way. The result still meets every check when it is simulated more finely, so it is not an "
        "accident of the time grid. The contacts are resolved cleanly."
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fault": "cost 'c' is not finite at t = 1 s: 1 / 0"}, "Mend this first"),
        ({"gradient": (GradientCheck("throw", 0.3, 1.0),)}, "the gradient misleads"),
        ({"refined": (Refined("dt / 2", 1.0, 9.0),)}, "falls apart"),
        ({"refined": (Refined("dt / 2", 1.0, 0.5, {"throw": 0.9}),)}, "falls apart"),
        ({"growth": Growth(np.arange(9.0), 10.0 ** np.arange(8, -1, -1))}, "shorten the horizon to less than that"),
        ({"growth": Growth(np.arange(9.0), np.geomspace(1e3, 1, 9))}, "small steps are to be expected"),
        ({"growth": Growth(np.arange(3.0), np.array([np.nan, 2.0, 1.0]))}, "break off going back from the end"),
        ({"smoothed": (Smoothed(0.1, True, 9.0, 4.0),)}, "Without the smoothing"),
        ({"gained": 0.1, "gains": (Gain(7, 0.7, 0.1, ("a-b",)),)}, "a-b at t = 0.7 s, step 7"),
        ({"momentum": 1.0}, "fault of the engine"),
        ({"residual": 1.0, "impulse": 1.0}, "mend that before anything else"),
    ],
)
def test_advice_names_what_is_wrong(change: dict[str, Any], words: str) -> None:
    assert words not in advice(SOUND, MET)
    energy = Energy(*(np.array([0.0, 1.0]) for _ in range(5)))
    assert words in advice(replace(SOUND, energy=energy, **change), MET)


def test_the_gradient_under_refinement() -> None:
    rows = (Refined("dt / 2", 1.0, 0.5, {"a": 0.01, "b": np.nan}), Refined("dt / 4", 1.0, 0.5, {"a": 0.6, "b": 0.0}))
    (line,) = slope_finding(Examination(refined=rows, order={"gradient": 1.04}))
    assert line.level == BAD
    assert "60 % with dt" in line.number
    assert "dt to the power 1" in line.meaning
    assert slope_finding(Examination(refined=(Refined("dt / 2", 1.0, 0.5),))) == []


def test_smoothing_of_the_problem_and_smoothing_that_would_do_no_harm() -> None:
    tried = tuple(
        Smoothed(smoothing, False, 1.0, worst) for smoothing, worst in ((1e-3, 0.5), (1e-2, 0.9), (1e-1, 4.0))
    )
    assert "Up to 0.01 m/s" in smoothed_findings(tried, MET)[0].meaning
    assert smoothed_findings(tried[2:], MET)[0].level == UNKNOWN
    assert smoothed_findings((Smoothed(1e-2, True, 1.0, 0.9),), MET)[0].level == GOOD
    assert smoothed_findings((Smoothed(1e-2, True, 5.0, 9.0),), MET)[0].level == BAD


def test_tables_of_refinement() -> None:
    header, rows = answers(SOUND, MET)
    assert len(header) == len(rows[0]) == 4
    assert [row[0] for row in rows] == ["as asked", "dt / 2", "sweeps x 2", "smoothed 0.001 m/s"]
    header, rows = slopes(SOUND)
    assert header[-2:] == ["dt / 2", "sweeps x 2"]
    assert rows == [["throw", "1", "1 × 10⁻⁹", "agrees", "1 %", "0 %"]]  # noqa: RUF001


def test_weights_of_a_net_take_one_row() -> None:
    """The range of the guess and of what was found, and how far they are apart."""
    guess, free = np.linspace(-1, 2, 500)[:, None], np.full((500, 1), np.inf)
    (row,) = variable_rows(VariableRecord("w", ("brain.weights",), guess + 0.5, guess, -free, free))
    text = " ".join(row)
    assert "500 numbers" in text and "brain.weights" in text
    assert "1 to 2" in text and "0.5 to 2.5" in text and "changed by 0.5 (rms)" in text
