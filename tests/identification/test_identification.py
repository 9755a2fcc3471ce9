"""The record of an identification: written and read alike, in words, and without loss at an interruption."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from data.analytic_recordings import TRUTHS, AnalyticRecordings, Model, bounce, recordings, slide

from symphys import files
from symphys.errors import SymphysError
from symphys.identification import (
    FitOptions,
    FitState,
    FitStep,
    IdentificationError,
    IdentificationOptions,
    SearchOptions,
    fit_parameters,
    identify,
    revive_state,
)
from symphys.results.identification import ARRAYS, IDENTIFICATION, Identification, read_identification, summary


def bounces() -> AnalyticRecordings:
    """Nine recordings to fit to and three held back, with a gap, noise that is not given, and a bound that holds."""
    truth, stream = TRUTHS["bounce"], np.random.default_rng(3)
    own = truth.own[stream.integers(0, 3, 12)] * (1 + 0.2 * stream.random((12, 1)))
    problem = recordings(replace(truth, own=own), 1, off=1.0, noise_known=np.array([False]))
    problem.measured[3][7:9] = np.nan
    problem.held_back[-3:] = True
    problem.shared = fit_parameters(("gravity", "restitution"), [9.7, 0.8], lower=0, upper=[9.75, 1.0])
    return problem


@pytest.fixture(scope="module")
def found() -> Identification:
    options = IdentificationOptions(draws=200, refits=2, search=SearchOptions(evaluations=12, starts=1))
    return identify(bounces(), options, name="bounces", title="Bounces")


def test_files_hold_all_of_it(found: Identification, tmp_path: Path) -> None:
    found.write(tmp_path)
    read = read_identification(tmp_path)
    assert files.strict(read.to_json()) == files.strict(found.to_json())
    assert {path.name for path in tmp_path.iterdir()} == {IDENTIFICATION, ARRAYS}
    for name in ("own", "own_error", "correlation", "history", "draws", "residual", "residual_impact", "held_back"):
        np.testing.assert_array_equal(getattr(read, name), getattr(found, name))
    height, error = read.own_numbers("toss/0002")["own 0"]
    assert abs(height - bounces().own.guess[2, 0]) < 0.02 and 1e-4 < error < 1e-2
    assert np.isnan(read.own_numbers("toss/0011")["own 0"][1])
    assert read["restitution"] == found["restitution"] and summary(read) == summary(found)


def test_the_summary_has_what_one_reads_first(found: Identification) -> None:
    text = summary(found)
    for word in (
        "Bounces: 9 recordings, 3 more held back, 358 residuals",
        "converged",
        "restitution",
        "at its upper bound",
    ):
        assert word in text
    for word in ("fitted to (9)", "held back (3)", "of estimated", "worst recordings: toss/", "CMA-ES"):
        assert word in text


def test_undetermined_numbers_have_no_interval_in_the_summary() -> None:
    truth = replace(TRUTHS["slide"], model=lambda s, o, t: slide(s[:1] * s[1:2], o, t), names=("mass", "friction"))
    text = summary(identify(recordings(replace(truth, shared=np.array([0.6, 0.5])), 0), IdentificationOptions(draws=0)))
    assert "not determined: mass and friction appear only as their product mass * friction" in text
    assert text.count("any") >= 2 and "Record a collision with a body of known mass" in text


def test_what_is_no_record_is_an_error_that_names_the_file(found: Identification, tmp_path: Path) -> None:
    with pytest.raises(SymphysError, match=IDENTIFICATION):
        read_identification(tmp_path)
    found.write(tmp_path)
    table = json.loads((tmp_path / IDENTIFICATION).read_text(encoding="utf-8"))
    for damage, word in (({"format": 9}, "format 9"), ({"recordings": ["one"]}, ARRAYS)):
        (tmp_path / IDENTIFICATION).write_text(json.dumps(table | damage), encoding="utf-8")
        with pytest.raises(SymphysError, match=word):
            read_identification(tmp_path)
    del table["merit"]
    (tmp_path / IDENTIFICATION).write_text(json.dumps(table), encoding="utf-8")
    with pytest.raises(SymphysError, match="merit"):
        read_identification(tmp_path)
    with pytest.raises(KeyError, match="gravity, restitution"):
        found["friction"]


@pytest.mark.parametrize("from_end", [2, 6])
def test_an_interruption_loses_nothing_while_noise_is_estimated(from_end: int) -> None:
    """Whether within the first fit, or in a later one that has another noise."""
    quiet = IdentificationOptions(fit=FitOptions(threshold=1.345), draws=0)
    problem, told, states = bounces(), list[FitStep](), list[FitState]()
    problem.shared = fit_parameters(problem.shared.names, problem.shared.guess * 0.9)
    whole = identify(problem, quiet)
    assert len(whole.history) > 7

    def monitor(step: FitStep, state: FitState) -> None:
        told.append(step)
        states.append(state)

    half = identify(problem, quiet, monitor=monitor, stop=lambda: len(told) >= len(whole.history) - from_end)
    assert half.status == "interrupted" and "interrupted" in half.doubts[0]
    saved = json.loads(json.dumps(states[-1].plain()))
    rest = identify(problem, quiet, start=revive_state(saved, problem))
    assert rest.status == whole.status
    assert [each.value for each in rest.parameters] == [each.value for each in whole.parameters]
    assert np.array_equal(rest.history[:, :4], whole.history[:, :4])


def broken_below(height: float) -> Model:
    """Bounces that are not finite from lower than a height [m]."""
    return lambda shared, own, time: bounce(shared, own, time) + (0.0 if own[0].real >= height else np.inf)


def test_a_start_that_is_not_finite_is_an_error_with_the_recording() -> None:
    problem = bounces()
    problem.model, problem.own.guess[4] = broken_below(0.6), 0.5
    with pytest.raises(IdentificationError, match="toss/0004"):
        identify(problem)


def test_held_back_recordings_that_are_not_finite_are_inf() -> None:
    problem = bounces()
    problem.model, problem.own.guess[11] = broken_below(0.6), 0.5
    found = identify(problem, IdentificationOptions(draws=0))
    assert found.status == "converged" and found.worst(1) == (("toss/0011", np.inf),)
    assert np.isinf(found.held_back_errors[0].rmse)


def test_a_recording_without_a_sample_changes_nothing() -> None:
    """Its own number is not determined, and that is said."""
    problem = bounces()
    problem.measured[4][:] = np.nan
    found = identify(problem)
    without = bounces()
    without.held_back[4] = True
    expected = identify(without)
    assert found["restitution"].value == pytest.approx(expected["restitution"].value, rel=1e-9)
    assert found["restitution"].error == pytest.approx(expected["restitution"].error, rel=1e-2)
    assert np.isinf(found.own_error[4, 0]) and np.isnan(found.recording_ratio[4])
    assert "own 0 is not determined in 1 of 12 recordings, toss/0004 the first" in summary(found)
