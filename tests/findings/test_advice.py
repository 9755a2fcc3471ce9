"""Advice is given only where it can help, and nothing is called good that is not."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from symphys.findings.advice import advice, findings, slopes
from symphys.findings.examination import Energy, Examination, GradientCheck, Growth, Miss, Refined, Slide, Smoothed
from symphys.findings.levels import BAD, FAIR, GOOD, UNKNOWN, Judged
from symphys.findings.numerics import smoothed_findings
from symphys.findings.physics import IN_TIME, balance_finding, impact_findings, miss_findings, residual_finding, sliding
from symphys.findings.verdict import doubts

MET = Judged(1.0, 0.5, True, True, 1.0)
NO_CHECKS = Judged(1.0, math.nan, True, False, 1.0)
UNSETTLED = Examination(residual=0.5, impulse=1.0)


@pytest.mark.parametrize(("finer", "helps"), [(0.1, True), (0.5, False), (0.7, False), (math.inf, False)])
def test_more_sweeps_are_advised_only_where_they_settle_more(finer: float, helps: bool) -> None:
    line = residual_finding(replace(UNSETTLED, residual_finer=finer), MET)
    assert line.level == BAD
    assert ("raise the number of sweeps" in line.meaning) == helps
    assert ("oscillates or stagnates" in line.meaning) != helps


def test_of_more_sweeps_nothing_is_said_that_nobody_measured() -> None:
    assert residual_finding(UNSETTLED, MET).meaning == "The contact solver did not converge."


@pytest.mark.parametrize(
    ("worst", "level"), [((0.5, 0.9), FAIR), ((2.5, 0.5), FAIR), ((0.5, 4.0), BAD), ((math.nan, 0.5), BAD)]
)
def test_impulses_in_a_cycle_refute_what_does_not_hold_where_the_sweeps_end_elsewhere(
    worst: tuple[float, float], level: str
) -> None:
    rows = tuple(Refined(what, 1.0, x) for what, x in zip(("sweeps + 1", "sweeps x 2"), worst, strict=True))
    trust = replace(UNSETTLED, unsettled=285.0, steps=1000.0, resettled=rows)
    line = residual_finding(trust, MET)
    assert line.level == level and "in 285 of 1000 steps" in line.meaning
    assert bool(line.doubt) == (level == BAD) == bool(doubts(trust, MET))
    assert IN_TIME not in [each.meaning for each in impact_findings(replace(trust, multiple_impacts=0.0))]


@pytest.mark.parametrize(("left", "level"), [(0.0, GOOD), (5e-3, FAIR), (0.08, BAD)])
def test_a_velocity_that_more_sweeps_find_refutes_also_where_the_result_holds(left: float, level: str) -> None:
    """Of a residual below a thousandth of the largest impulse."""
    rows = (Refined("sweeps x 2", 1.0, 0.5),)
    trust = Examination(
        residual=5e-4, impulse=1.0, left=left, left_of="crate", left_time=0.4, left_speed=0.3, resettled=rows
    )
    line = residual_finding(trust, MET)
    assert line.level == level and bool(doubts(trust, MET)) == (level == BAD)
    assert ('"crate" is off by 0.3 m/s' in line.meaning) == (level != GOOD)


def test_the_doubt_says_what_another_number_of_sweeps_does() -> None:
    told = residual_finding(replace(UNSETTLED, resettled=(Refined("sweeps + 1", 1.0, 7.0),)), MET).doubt
    assert told.endswith("0.5 of 1 N s, and simulated with sweeps + 1 it misses by 7 × tolerance")  # noqa: RUF001


def test_a_variable_without_influence_is_named_first_and_its_gradient_not_called_right() -> None:
    none = Examination(gradient=(GradientCheck("push", 0.0, 0.0, felt=0.0),))
    assert advice(none, NO_CHECKS).startswith("The gradient of push is zero")
    assert "is right" not in advice(none, NO_CHECKS)
    assert slopes(none)[1][0][3] == "zero"
    (line,) = findings(none, NO_CHECKS)
    assert line.level == FAIR and "gradient-based solvers do not change it" in line.meaning
    both = Examination(gradient=(*none.gradient, GradientCheck("kick", 0.0, 1.0, felt=1.0)))
    assert advice(both, NO_CHECKS).startswith("The gradient of push is zero")
    assert "The gradient is right" in advice(both, NO_CHECKS)


def test_only_what_slid_beyond_rounding_is_said_to_have_slid() -> None:
    slide = Slide("sled-ground", 0.5, 1.0, 0.1)
    assert "sled-ground 0.5 m (up to 1 m/s)" in sliding(Examination(slides=(slide,)))
    assert sliding(Examination(slides=(replace(slide, distance=1e-18),))) == ""


def test_no_method_is_advised_that_there_is_not() -> None:
    for growth in (np.array([1e9, 1.0]), 10.0 ** np.arange(8, -1, -1)):
        far = Examination(growth=Growth(np.arange(float(growth.size)), growth))
        assert "shorten the horizon" in advice(far, MET)
        assert "multiple shooting" not in advice(far, MET)


def test_targets_are_not_spoken_of_where_there_are_none() -> None:
    same = Examination(refined=(Refined("dt / 2", 1.0, math.nan),))
    assert "changes little" in advice(same, NO_CHECKS)
    assert not {"target", "check"} & set(advice(same, NO_CHECKS).split())
    assert "still meets every check" in advice(Examination(refined=(Refined("dt / 2", 1.0, 0.5),)), MET)


@pytest.mark.parametrize(
    ("what", "words"), [("sweeps x 2", "add sweeps until"), ("dt / 2", "halve the time step until")]
)
def test_what_changes_the_answer_is_what_is_to_be_refined(what: str, words: str) -> None:
    assert words in advice(Examination(refined=(Refined(what, 9.0, 9.0),)), MET)


@pytest.mark.parametrize(
    ("row", "judged", "level"),
    [
        (Smoothed(0.1, True, 1.0, 0.9, 1.0, 0.0), MET, GOOD),
        (Smoothed(0.1, True, 1.0, 0.9, 0.5, 0.0), MET, BAD),
        (Smoothed(0.1, True, 1.0, 0.9, 1.2, 0.0), MET, FAIR),
        (Smoothed(0.1, True, 1.0, 0.9, 1.0, 0.5), MET, BAD),
        (Smoothed(0.1, True, 1.0, 2.0, 1.0, 0.0), MET, FAIR),
        (Smoothed(0.1, True, 9.0, 0.9, 9.0, 0.0), replace(MET, costs=math.nan), GOOD),
        (Smoothed(0.1, True, 1.0, 0.9, 1e-17, 0.0), replace(MET, costs=0.0), GOOD),
        (Smoothed(0.1, True, 1.5, math.nan, 1.5, 0.0), NO_CHECKS, BAD),
        (Smoothed(0.1, True, 1.0, math.nan, 1.0, 0.5), NO_CHECKS, BAD),
    ],
)
def test_smoothing_that_changes_cost_or_motion_is_not_good(row: Smoothed, judged: Judged, level: str) -> None:
    assert smoothed_findings((row,), judged)[0].level == level
    tried = smoothed_findings((replace(row, own=False),), judged)[0]
    assert tried.level == (GOOD if level == GOOD else UNKNOWN)


@pytest.mark.parametrize(
    "change",
    [
        {"multiple_impacts": 1.0},
        {"gained": 0.1},
        {"residual": 0.5, "impulse": 1.0},
        {"passed": 1.6},
        {"deepest": 1.0, "size": 0.1},
    ],
)
def test_impacts_are_called_resolved_only_where_nothing_speaks_against_it(change: dict[str, Any]) -> None:
    energy = Energy(*(np.array([0.0, 1.0]) for _ in range(5)))
    sound = Examination(
        multiple_impacts=0.0, steps=10.0, gained=0.0, residual=0.0, deepest=0.0, passed=0.0, energy=energy
    )
    assert [line.meaning for line in impact_findings(sound)] == [IN_TIME]
    assert IN_TIME not in [line.meaning for line in impact_findings(replace(sound, **change))]


def test_near_misses_are_told_where_a_small_step_or_a_seed_would_make_them_touch() -> None:
    miss = Miss("ball-wall", False, 0.7, 0.003, "vz", 0.004, 0.004, math.inf)
    assert miss_findings(Examination(misses=(miss,))) == []
    (by_step,) = miss_findings(Examination(misses=(replace(miss, steps=1e-4),)))
    (by_seed,) = miss_findings(Examination(misses=(replace(miss, spreads=0.5),)))
    (touch,) = miss_findings(Examination(misses=(replace(miss, spreads=0.5, touches=True),)))
    assert "clears by 0.003 m" in by_step.meaning and "vz by 0.004 makes it touch" in by_step.meaning
    assert "spread of seeds" in by_seed.meaning and "the objective jumps" in by_seed.meaning
    assert (touch.what, touch.level) == ("Glancing touch", FAIR) and "misses it" in touch.meaning
    assert advice(Examination(misses=(replace(miss, spreads=0.5),)), MET).startswith(
        "A small change of the variables changes the contacts."
    )


@pytest.mark.parametrize(
    ("numbers", "level", "doubted"),
    [
        ({"drift": 0.5, "unexplained": 0.5, "drifted": 0.5}, BAD, True),
        ({"drift": 0.5, "unexplained": 0.0, "drifted": 0.0}, FAIR, False),
        ({"drift": 1e-3, "unexplained": 1e-3, "drifted": 0.2}, BAD, True),
        ({"drift": 1e-3, "unexplained": 1e-3, "drifted": 0.01}, FAIR, False),
        ({"drift": 0.5}, BAD, True),
        ({"drift": 0.0, "unexplained": 0.0, "drifted": 0.0}, GOOD, False),
    ],
)
def test_energy_that_servos_may_have_done_refutes_nothing(numbers: dict[str, float], level: str, doubted: bool) -> None:
    """Of 1 J of motion; the last but one is of a file that tells one number only."""
    line = balance_finding(
        Examination(momentum=0.0, energy=Energy(*(np.array([0.0, 1.0]) for _ in range(5))), **numbers)
    )
    assert (line.level, bool(line.doubt)) == (level, doubted)


def test_rounding_of_what_stands_still_is_no_energy_from_nowhere() -> None:
    """A body of 100 J hangs still: what is left of its energies is rounding, however small the kinetic one is."""
    still, high = np.array([0.0, 1e-25]), np.array([100.0, 100.0])
    energy = Energy(still, still, high, still, still)
    assert (
        balance_finding(Examination(momentum=0.0, drift=1e-14, unexplained=1e-14, drifted=1e-14, energy=energy)).doubt
        == ""
    )
    lost = balance_finding(Examination(momentum=0.0, drift=1.0, unexplained=1.0, drifted=1.0, energy=energy))
    assert "1 J of energy are unaccounted for" in lost.doubt
