"""What stands in the way is said where it does, and nowhere else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from symphys.findings.advice import advice, findings
from symphys.findings.examination import Examination, GradientCheck, Growth, HeldBound, Refined
from symphys.findings.levels import FAIR, UNKNOWN, Judged
from symphys.findings.obstacles import BOUNDS, TARGETS, bound_words, obstacle_findings, obstacles

MISSED = Judged(1.0, 5.0, False, True, 0.0)
MET = Judged(1.0, 0.5, True, True, 0.0)
BOUND = HeldBound("throw", 0, 3, "upper", 5.0, 1, 1, 0.4)
PUSH = HeldBound("push", 0, 1, "lower", math.nan, 12, 40, 0.3)


def test_contradicting_targets_are_named_unless_they_are_met() -> None:
    trust = Examination(contradicting=("near", "far"))
    (line,) = obstacle_findings(trust, MISSED)
    assert (line.about, line.level) == (TARGETS, FAIR)
    assert line.meaning.startswith('"near" and "far" cannot both be met near this point')
    assert line.meaning in advice(trust, MISSED)
    assert obstacle_findings(trust, MET) == [] and obstacles(trust, MET) == ()
    three = obstacles(Examination(contradicting=("a", "b", "c")), MISSED)
    assert three[0].startswith('"a", "b" and "c" cannot all be met')


def test_opposed_targets_are_named_unless_they_contradict_each_other_anyway() -> None:
    trust = Examination(opposed=("near", "far"))
    assert obstacles(trust, MISSED)[0].startswith('the gradients of "near" and "far" cancel here')
    assert len(obstacles(replace(trust, contradicting=("far", "near", "side")), MISSED)) == 1
    assert len(obstacles(replace(trust, contradicting=("far", "side")), MISSED)) == 2
    assert obstacles(trust, MET) == ()


def test_targets_that_costs_hold_back_are_said_to_be_penalties() -> None:
    trust = Examination(outweighed=("there",))
    (clause,) = obstacles(trust, MISSED)
    assert 'outweigh "there"' in clause and "[[constraint]]" in clause and "`weight`" in clause
    assert [line.what for line in obstacle_findings(trust, MISSED)] == ["Targets that the costs outweigh"]
    assert obstacles(trust, MET) == ()


@pytest.mark.parametrize(("equations", "unknowns", "said"), [(8, 3, True), (3, 3, False), (math.nan, math.nan, False)])
def test_more_equations_than_unknowns_are_a_note_with_both_numbers(
    equations: float, unknowns: float, said: bool
) -> None:
    trust = Examination(equations=equations, unknowns=unknowns)
    lines = obstacle_findings(trust, MISSED)
    assert [(line.number, line.level) for line in lines] == ([("8 for 3 unknowns", UNKNOWN)] if said else [])
    assert obstacle_findings(trust, MET) == [] and obstacles(trust, MISSED) == ()


def test_bounds_that_hold_an_answer_back_are_named() -> None:
    assert bound_words(BOUND) == "the upper bound 5 of throw[0]"
    assert bound_words(PUSH) == "the lower bound of push (at 12 of 40 knots)"
    assert bound_words(PUSH, knots=False) == "the lower bound of push"
    assert obstacles(Examination(bounds=(BOUND,)), MISSED) == (
        "the upper bound 5 of throw[0] is active: the objective would improve beyond it",
    )
    five = Examination(bounds=(BOUND, PUSH, *(replace(BOUND, component=k) for k in (1, 2))))
    assert obstacles(five, MISSED)[0].endswith(
        "of throw[1] and 1 more are active: the objective would improve beyond them"
    )
    lines = [(line.about, line.what, line.number) for line in obstacle_findings(five, MISSED)]
    assert lines[:2] == [(BOUNDS, "Upper bound of throw[0]", "5"), (BOUNDS, "Lower bound of push", "12 of 40 knots")]
    assert len(lines) == 3


@pytest.mark.parametrize(
    ("judged", "said"),
    [
        (MET, False),  # what is met and minimises nothing may lie where it does
        (replace(MET, costs=math.nan), False),  # a goal that is reached
        (replace(MET, costs=1.0), True),
        (replace(MET, checked=False), True),
        (MISSED, True),
    ],
)
def test_a_bound_matters_where_something_could_be_better(judged: Judged, said: bool) -> None:
    assert bool(obstacles(Examination(bounds=(BOUND,)), judged)) == said


def test_a_gradient_of_what_nothing_depends_on_is_neither_right_nor_far_reaching() -> None:
    """Nor does it depend on the discretisation."""
    growth = Growth(np.arange(2.0), np.ones(2))
    refined = (Refined("dt / 2", 1.0, 5.0, {"push": 0.9}),)
    none = Examination(gradient=(GradientCheck("push", 0.0, 1e-12, felt=1e-12),), growth=growth, refined=refined)
    text = advice(none, MISSED)
    assert text.startswith("The gradient of push is zero")
    assert "right" not in text and "reliable" not in text
    assert not any("gradient" in line.what.lower() and "change" in line.what.lower() for line in findings(none, MISSED))
    felt = replace(none, gradient=(*none.gradient, GradientCheck("kick", 0.0, 1.0, felt=1.0)))
    assert "The gradient is right" in advice(felt, MISSED) and "It is reliable over the whole" in advice(felt, MISSED)
    assert any(line.what == "Change of the gradient" for line in findings(felt, MISSED))


def test_a_gradient_that_misleads_does_not_reach() -> None:
    growth = Growth(np.arange(2.0), np.ones(2))
    wrong = Examination(gradient=(GradientCheck("push", 0.5, 1.0, felt=1.0),), growth=growth)
    assert "The gradient is misleading" in advice(wrong, MISSED) and "reliable" not in advice(wrong, MISSED)
