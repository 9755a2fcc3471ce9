"""The search finds a lower minimum where there is one, and says so where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from data.analytic_recordings import TRUTHS, AnalyticRecordings, Truth, recordings

from symphys.identification import (
    FitOptions,
    IdentificationError,
    IdentificationOptions,
    SearchOptions,
    fit,
    fit_parameters,
    identify,
)

SEARCH = SearchOptions(evaluations=60, own_steps=1)


def trapped() -> AnalyticRecordings:
    """Waves that begin at known times, with own offsets: a frequency far off is another minimum."""
    wave = Truth(
        lambda shared, own, time: (np.sin(shared[0] * time) + own[0])[:, None],
        ("frequency",),
        np.array([6.0]),
        np.array([[0.1], [0.2]]),
        3.0,
        np.array([0.1]),
        30,
    )
    problem = recordings(wave, 1)
    problem.shared = fit_parameters(("frequency",), [9.5], lower=0, upper=20, scale=2.0)
    return problem


def test_a_lower_minimum_is_found_and_fitted() -> None:
    problem = trapped()
    alone = fit(problem, FitOptions()).outcome
    assert abs(alone.state.shared[0] - 6.0) > 0.5
    found = identify(problem, IdentificationOptions(draws=0, search=SEARCH))
    assert found.search is not None and found.search.lower and found.search.merit == alone.merit
    assert found["frequency"].value == pytest.approx(6.0, abs=0.1)
    assert found.merit == pytest.approx(found.search.found, rel=1e-6)
    assert found.search.values["frequency"] == pytest.approx(found["frequency"].value, rel=1e-6)


def test_where_there_is_none_the_fit_stays() -> None:
    problem = recordings(TRUTHS["slide"], 2)
    plain = identify(problem, IdentificationOptions(draws=0))
    found = identify(problem, IdentificationOptions(draws=0, search=SEARCH))
    assert found.search is not None and not found.search.lower and "nothing lower" in found.search.text
    assert found["friction"].value == pytest.approx(plain["friction"].value, rel=1e-6)


def test_the_seed_alone_decides() -> None:
    """Not numpy's global stream."""
    results = []
    for seed in (1, 1, 2):
        np.random.seed(seed + len(results))
        options = IdentificationOptions(draws=0, search=replace(SEARCH, seed=seed, evaluations=12, starts=1))
        results.append(identify(trapped(), options).search)
    assert results[0] == results[1] != results[2]


def test_options_say_what_is_valid() -> None:
    with pytest.raises(IdentificationError, match=r"starts is 0.* 1"):
        SearchOptions(starts=0)
