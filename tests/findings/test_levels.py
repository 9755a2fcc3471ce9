"""Levels of findings follow the numbers; advice on a sound solution changes with each number that is not sound."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from symphys.findings.advice import advice, answers, findings, slopes
from symphys.findings.examination import Energy, Examination, Gain, GradientCheck, Growth, Refined, Smoothed
from symphys.findings.levels import BAD, FAIR, GOOD, UNKNOWN, Judged, graded
from symphys.findings.numerics import slope_finding, smoothed_findings
from symphys.findings.physics import depth_finding, residual_finding

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


def test_levels() -> None:
    assert [graded(x, (1, 3)) for x in (0.5, 1, 2, 4, math.inf, math.nan)] == [GOOD, GOOD, FAIR, BAD, BAD, UNKNOWN]
    assert residual_finding(Examination(residual=1e-3, impulse=0.1), MET).level == FAIR
    assert residual_finding(Examination(residual=1e-3), MET).level == UNKNOWN
    assert depth_finding(Examination(deepest=0.02, size=0.1)).level == BAD
    assert depth_finding(Examination(deepest=-1e-9)).level == GOOD
    named = depth_finding(Examination(deepest=0.02, size=0.1, depth_contact="box-ground", depth_time=1.5))
    assert "box-ground at t = 1.5 s" in named.number


def test_a_sound_solution_has_only_good_findings() -> None:
    assert {line.level for line in findings(SOUND, MET)} == {GOOD}


@pytest.mark.parametrize(
    ("change", "level", "named"),
    [
        ({"fault": "cost 'c' is not finite at t = 1 s: 1 / 0"}, BAD, "cost 'c'"),
        ({"gradient": (GradientCheck("throw", 0.3, 1.0),)}, BAD, "gradient"),
        ({"refined": (Refined("dt / 2", 1.0, 9.0),)}, BAD, "time step"),
        ({"refined": (Refined("dt / 2", 1.0, 0.5, {"throw": 0.9}),)}, BAD, "time step"),
        ({"growth": Growth(np.arange(9.0), 10.0 ** np.arange(8, -1, -1))}, BAD, "horizon"),
        ({"growth": Growth(np.arange(9.0), np.geomspace(1e3, 1, 9))}, FAIR, "small steps"),
        ({"growth": Growth(np.arange(3.0), np.array([np.nan, 2.0, 1.0]))}, BAD, "t = 1 s"),
        ({"smoothed": (Smoothed(0.1, True, 9.0, 4.0),)}, BAD, "smoothing"),
        ({"gained": 0.1, "gains": (Gain(7, 0.7, 0.1, ("a-b",)),)}, BAD, "a-b at t = 0.7 s, step 7"),
        ({"momentum": 1.0}, BAD, "engine"),
        ({"residual": 1.0, "impulse": 1.0}, BAD, "contacts"),
    ],
)
def test_what_is_wrong_lowers_the_level_and_changes_the_advice(change: dict[str, Any], level: str, named: str) -> None:
    energy = Energy(*(np.array([0.0, 1.0]) for _ in range(5)))
    wrong = replace(SOUND, energy=energy, **change)
    assert level in {line.level for line in findings(wrong, MET)}
    assert advice(wrong, MET) != advice(SOUND, MET)
    assert named in advice(wrong, MET)


def test_the_gradient_under_refinement() -> None:
    rows = (Refined("dt / 2", 1.0, 0.5, {"a": 0.01, "b": np.nan}), Refined("dt / 4", 1.0, 0.5, {"a": 0.6, "b": 0.0}))
    (line,) = slope_finding(Examination(refined=rows, order={"gradient": 1.04}))
    assert line.level == BAD
    assert "60 %" in line.number
    assert slope_finding(Examination(refined=(Refined("dt / 2", 1.0, 0.5),))) == []


def test_smoothing_of_the_problem_and_smoothing_that_would_do_no_harm() -> None:
    tried = tuple(
        Smoothed(smoothing, False, 1.0, worst) for smoothing, worst in ((1e-3, 0.5), (1e-2, 0.9), (1e-1, 4.0))
    )
    assert "0.01 m/s" in smoothed_findings(tried, MET)[0].meaning
    assert smoothed_findings(tried[2:], MET)[0].level == UNKNOWN
    assert smoothed_findings((Smoothed(1e-2, True, 1.0, 0.9),), MET)[0].level == GOOD
    assert smoothed_findings((Smoothed(1e-2, True, 5.0, 9.0),), MET)[0].level == BAD


def test_tables_of_refinement_have_a_row_or_column_for_each_refinement() -> None:
    header, rows = answers(SOUND, MET)
    assert len(header) == len(rows[0]) == 4
    assert [row[0] for row in rows] == ["as asked", "dt / 2", "sweeps x 2", "smoothed 0.001 m/s"]
    header, rows = slopes(SOUND)
    assert header[-2:] == ["dt / 2", "sweeps x 2"]
    assert [row[0] for row in rows] == ["throw"] and rows[0][-2:] == ["1 %", "0 %"]
