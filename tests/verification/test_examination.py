"""The examination of a solution: right gradients pass, wrong ones do not, coarse answers are told apart from fine."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from symphys.problem import load_problem
from symphys.problems import find
from symphys.shooting import VariableBlock
from symphys.transcription import transcribe
from symphys.transcription.judge import Assessment, Criterion
from symphys.verification import examine, finer_errors, finer_values
from symphys.verification.examination import _compare_block, compare_gradient
from symphys.verification.refinement import FINER_DT, FINEST_DT, MORE_SWEEPS, finer_problem, follows, order

THROW = np.array([3.0, 0.1, 3.0, 0.0, -9.0, 0.5])


SHOT = {"simulation.dt": 0.02, "simulation.duration": 3, "simulation.cuts": 0}


def shot(**settings):
    """The bank shot with a coarse step: what it comes to depends on steps and on sweeps."""
    changed = {f"simulation.{key}": value for key, value in settings.items()}
    return transcribe(load_problem(find("bank_shot"), SHOT | changed), backend="casadi")


@pytest.fixture(scope="module")
def coarse():
    """The shot, where it is looked at, and its examination."""
    made = shot()
    z = made.shooting.start(1)
    return made, z, examine(made, z)["refined"]


@pytest.fixture(scope="module")
def halved():
    return shot(dt=0.01)


@pytest.fixture(scope="module")
def throw():
    return transcribe(load_problem(find("ball_throw")), backend="casadi")


def test_right_gradients_pass(throw):
    for row in compare_gradient(throw, THROW):
        assert row["error"] < 1e-6
        assert row["scale"] > 0


def test_wrong_gradients_are_rejected(throw):
    """The derivative of another problem (weaker gravity) does not pass as this one's."""
    other = transcribe(load_problem(find("ball_throw"), {"world.gravity": [0, 0, -8]}), backend="casadi")
    wrong = other.probe.gradient(THROW)
    errors = [_compare_block(throw.probe.values, block, THROW, wrong)["error"] for block in throw.shooting.blocks]
    assert max(errors) > 1e-2


@pytest.mark.thorough
def test_a_jump_is_told_from_a_wrong_gradient():
    """The kick of the guess meets the crate after 0.05 s, the very end of a step: either side agrees."""
    knock = transcribe(load_problem(find("knock"), {"simulation.duration": 0.3}), backend="casadi")
    kick, side = compare_gradient(knock, np.array([5.0, 0.0, -0.05]))
    assert kick["error"] < 1e-4
    assert 0 < kick["jump"] < 1e-4
    assert (side["error"], side["jump"]) == (pytest.approx(0, abs=1e-6), 0)


@pytest.mark.parametrize(("slope", "passes"), [(2.0, True), (1.0, False)])
def test_a_kink_is_no_jump(slope, passes):
    """The slope of one side of a kink is not that of both; a jump leaves both as they are."""
    z = ca.SX.sym("z")
    values = {True: 2 * z + 1e-6 * (z > 0), False: ca.fabs(z)}
    value, one = ca.Function("f", [z], [values[passes]]), np.ones(1)
    block = VariableBlock("v", 0, (1, 1), 0 * one, -one, one, one, one)
    row = _compare_block(lambda Z: np.array(value(Z.T)).ravel(), block, np.zeros(1), np.array([slope]))
    assert (row["error"] < 1e-6) == passes
    assert (row["jump"] == pytest.approx(1e-6 / 2, rel=1e-3)) == passes


def test_examination_reports_refinements_and_contacts(throw):
    found = examine(throw, THROW)
    assert [row["what"] for row in found["refined"]] == ["dt / 2", "dt / 4", "sweeps x 2"]
    assert found["refined"][0]["objective"] == pytest.approx(throw.judge(THROW).objective, rel=1e-2)
    assert found["residual"] < 1e-9
    assert found["deepest"] < 1e-9
    assert found["multiple_impacts"] == 0
    assert found["fault"] == ""


@pytest.mark.parametrize("loose", [True, False])
def test_what_a_search_has_met_is_examined_by_values(throw, loose):
    """Its derivatives are only where finer simulations, or the motion itself, miss something."""
    problem, made = throw.problem, throw
    if loose:
        wide = [
            tuple(replace(each, tolerance=1e3) for each in group) for group in (problem.targets, problem.constraints)
        ]
        made = transcribe(replace(problem, targets=wide[0], constraints=wide[1]), backend="casadi")
    found, whole = examine(made, THROW, whole=False, slopes=False), examine(made, THROW, whole=False)
    assert made.judge(THROW).solved is loose
    assert [bool(each["gradient"]) for each in (found, whole)] == [not loose, True]
    assert ["growth" in each for each in (found, whole)] == [not loose, True]
    assert [row["worst"] for row in found["refined"]] == [row["worst"] for row in whole["refined"]]
    assert (found["residual"], found["misses"]) == (whole["residual"], whole["misses"])


@pytest.mark.slow
def test_refined_answers_are_those_of_the_refined_problem(coarse, halved):
    """The same numbers as a file with half the step, or twice the sweeps; on a shot that depends on both."""
    made, z, found = coarse
    half, doubled = halved.judge(z), shot(sweeps=2 * made.problem.simulation.sweeps).judge(z)
    assert [row["objective"] for row in found[::2]] == [half.objective, doubled.objective]
    assert [row["worst"] for row in found[::2]] == [half.worst, doubled.worst]
    assert half.objective != pytest.approx(made.judge(z).objective, rel=1e-6)


def test_errors_of_finer_steps_are_those_of_the_judge():
    """The larger one of half and a quarter of the step; of half of it alone where that refutes a point already."""
    made = shot()
    Z = np.array([made.shooting.start(seed) for seed in (1, 2)])
    half, quarter = (finer_problem(made, what) for what in (FINER_DT, FINEST_DT))
    both = np.array([[[check.ratio for check in each.judge(z).checks] for z in Z] for each in (half, quarter)])
    assert (both[1] > 1.0001 * both[0]).any()
    assert finer_errors(made, Z, np.inf) == pytest.approx(both.max(axis=0), rel=1e-12)
    assert finer_errors(made, Z, 0.0) == pytest.approx(both[0], rel=1e-12)


def test_a_point_is_confirmed_with_more_sweeps_where_impulses_have_not_settled(throw):
    """As a shot's have not with one sweep, and a throw's have."""
    made = shot(sweeps=1, newton_start=False)
    found = [[row["what"] for row in finer_values(each, each.shooting.start(0))] for each in (throw, made)]
    assert found == [[FINER_DT, FINEST_DT], [FINER_DT, FINEST_DT, MORE_SWEEPS]]


@pytest.mark.slow
def test_changes_of_the_gradient_are_those_of_the_refined_problem(coarse, halved):
    """Against the probe of a file with half the step, in the variables' scales."""
    made, z, refined = coarse
    before, after = (np.array(each.probe.gradient(z)).ravel() for each in (made, halved))
    found = refined[0]["gradient"]
    spin = slice(2, 4)
    expected = np.linalg.norm((after - before)[spin]) / np.linalg.norm(before[spin])
    assert found["spin"] == pytest.approx(expected, rel=1e-9)
    assert expected > 1e-3


def test_order_of_convergence():
    assert order([1 + 0.1**2, 1 + 0.05**2, 1 + 0.025**2]) == pytest.approx(2)
    assert order([[1.1, 2], [1.05, 2], [1.025, 2]]) == pytest.approx(1)
    assert order([1.0, 1.0, 1.0]) is None
    assert order([np.nan, 1.0, 1.0]) is None


@pytest.mark.slow
def test_smoothed_answers_are_those_of_the_smoothed_rollout(throw):
    rows = examine(throw, THROW)["smoothed"]
    assert [row["smoothing"] for row in rows] == [1e-3, 1e-2, 1e-1]
    assert rows[2]["objective"] == float(throw.functions.value(THROW, 0.1)[1])
    assert rows[2]["objective"] != pytest.approx(throw.judge(THROW).objective, rel=1e-6)
    own = transcribe(load_problem(find("ball_throw"), {"simulation.smoothing": 0.02}), backend="casadi")
    assert [(row["smoothing"], row["own"]) for row in examine(own, THROW)["smoothed"]] == [(0.02, True)]


def test_a_run_leaves_out_what_hardly_says_more(coarse, throw):
    """A ball that flies changes little by dt / 2; the coarse shot changes much, and its impulses settle."""
    whole, short = examine(throw, THROW), examine(throw, THROW, whole=False)
    assert [row["what"] for row in whole["refined"]] == ["dt / 2", "dt / 4", "sweeps x 2"]
    assert short["refined"] == whole["refined"][:1] and short["order"] == {"objective": None, "gradient": None}
    assert short["smoothed"] == []  # of no smoothing of its own
    left = dict.fromkeys(("refined", "order", "smoothed"))
    assert {**short, **left} == {**whole, **left}
    made, z, rows = coarse
    found = examine(made, z, whole=False)
    assert [row["what"] for row in found["refined"]][:2] == ["dt / 2", "dt / 4"]
    assert found["refined"][0] == rows[0]
    plain = [{**row, "gradient": {}} for row in rows]
    assert all(row in plain for row in found["refined"][1:])


@pytest.mark.parametrize(
    ("ratio", "worst", "objective", "slope", "expected"),
    [
        (0.5, 0.8, 9.0, 0.06, True),  # 0.5 + 1.5 * 0.3 of a tolerance
        (0.5, 0.9, 1.0, 0.0, False),
        (0.5, 0.2, 1.0, None, True),
        (0.5, 0.5, 1.0, 0.07, False),
        (0.5, 0.5, 1.0, np.nan, False),
        (0.5, np.nan, 1.0, 0.0, False),
        (2.0, 2.0, 1.03, 0.0, True),  # not met: by the objective
        (2.0, 2.0, 1.04, 0.0, False),
        (2.0, 2.0, np.nan, 0.0, False),
    ],
)
def test_what_follows_from_half_the_step(ratio, worst, objective, slope, expected):
    judged = Assessment(1.0, {}, (Criterion("target", "there", ratio, 1.0, ratio),), {})
    assert follows(judged, {"worst": worst, "objective": objective, "gradient": {"throw": slope}}) is expected
