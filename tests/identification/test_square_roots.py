"""Errors are those of the Jacobian to its rounding: whatever its condition, and whatever stands beside them."""

from __future__ import annotations

import numpy as np
import pytest
from data.analytic_recordings import AnalyticRecordings

from symphys.identification import FitOptions, FitStatus, fit, fit_parameters
from symphys.types import Array

RNG = np.random.default_rng(5)


class LinearRecordings(AnalyticRecordings):
    """Residuals J (x - truth) + noise of unit size; ``rounding``: of the derivatives, as a share of each column."""

    def __init__(self, tables: list[Array], truth: Array, shared: int, scale: Array | None = None, rounding: float = 0):
        n = tables[0].shape[1]
        names, own = [f"p{k}" for k in range(shared)], [f"q{k}" for k in range(n - shared)]
        scale = np.ones(n) if scale is None else scale
        count = len(tables)
        super().__init__(
            model=lambda s, o, t: t,
            shared=fit_parameters(names, truth[:shared] * 1.5 + scale[:shared], scale=scale[:shared]),
            own=fit_parameters(
                own, np.tile(truth[shared:] * 1.5, (count, 1)), scale=np.tile(scale[shared:], (count, 1))
            ),
            times=[np.arange(float(len(table))) for table in tables],
            measured=[np.zeros((len(table), 1)) for table in tables],
            noise=np.array([1.0]),
        )
        self.tables, self.truth, self.count, self.rounding = tables, truth, shared, rounding
        self.errors = [RNG.standard_normal(len(table)) for table in tables]

    def _row(self, k: int, shared: Array, own: Array) -> Array:
        return np.asarray(self.tables[k] @ (np.concatenate([shared, own]) - self.truth) + self.errors[k])

    def jacobian(self, shared: Array, own: Array, which: Array) -> list[tuple[Array, Array, Array]]:
        found = []
        for k in map(int, which):
            bits = np.frombuffer(np.concatenate([shared, own[k]]).tobytes(), np.uint32)
            noise = np.random.default_rng(bits).standard_normal(self.tables[k].shape)
            table = self.tables[k] * (1 + self.rounding * noise)
            found.append((self._row(k, shared, own[k]), table[:, : self.count], table[:, self.count :]))
        return found


def conditioned(m: int, sizes: Array) -> tuple[Array, Array]:
    """A table (m, n) with these singular values, and the standard errors that go with it."""
    left = np.linalg.qr(RNG.standard_normal((m, len(sizes))))[0]
    right = np.linalg.qr(RNG.standard_normal((len(sizes), len(sizes))))[0]
    return (left * sizes) @ right.T, np.sqrt(np.sum((right / sizes) ** 2, axis=1))


def known(problem: AnalyticRecordings) -> tuple[Array, Array]:
    found = fit(problem, FitOptions()).uncertainty
    assert found is not None
    return found.error, found.own_error


@pytest.mark.parametrize("condition", [1e5, 1e8, 1e12])
def test_errors_and_estimates_of_an_ill_conditioned_jacobian(condition: float) -> None:
    """J = U S V' with known factors: the error of number j is the length of row j of V S^-1."""
    table, expected = conditioned(60, np.geomspace(1e8, 1e8 / condition, 5))
    problem = LinearRecordings([table], RNG.uniform(1, 2, 5), 5)
    found = fit(problem, FitOptions())
    assert found.uncertainty is not None
    np.testing.assert_allclose(found.uncertainty.error, expected, rtol=1e-2)
    assert found.outcome.status is FitStatus.CONVERGED and "not determine" not in found.outcome.reason
    assert np.all(np.abs(found.outcome.state.shared - problem.truth) < 5 * expected)


def test_a_number_without_effect_changes_no_other_error() -> None:
    """Its column is rounding, 1e-17 of the others; its own error is inf."""
    table, expected = conditioned(60, np.geomspace(1e4, 1e-2, 4))
    idle = 1e-13 * RNG.standard_normal((60, 1))
    problem = LinearRecordings([np.hstack([table, idle])], np.ones(5), 5)
    found, _ = known(problem)
    np.testing.assert_allclose(found[:4], expected, rtol=1e-8)
    assert np.isinf(found[4])


@pytest.mark.parametrize("rounding", [0.0, 1e-12])
def test_of_two_numbers_whose_sum_alone_counts_neither_is_determined(rounding: float) -> None:
    """The others are; derivatives have rounding, by which two equal columns differ."""
    table, expected = conditioned(60, np.array([30.0, 20.0, 10.0]))
    problem = LinearRecordings([np.hstack([table, table[:, :1]])], np.ones(4), 4, rounding=rounding)
    found, _ = known(problem)
    assert np.isinf(found[[0, 3]]).all()
    np.testing.assert_allclose(found[1:3], expected[1:], rtol=1e-6)


def test_a_tiny_effect_that_is_measured_is_determined() -> None:
    """1e-8 of the others' effect, and known to a thousandth: an error of its own, and none of the others' business."""
    table, expected = conditioned(60, np.array([3e11, 2e11, 1e11]))
    tiny = np.linalg.qr(np.hstack([table, RNG.standard_normal((60, 1))]))[0][:, 3:] * 1e3
    found, _ = known(LinearRecordings([np.hstack([table, tiny])], np.ones(4), 4))
    np.testing.assert_allclose(found, [*expected, 1e-3], rtol=1e-6)


def test_units_change_errors_by_themselves_alone() -> None:
    """Numbers of 1e-6 and 1e6 of their units."""
    table, expected = conditioned(60, np.geomspace(100, 1e-3, 4))
    units = np.array([1e-6, 1.0, 1e6, 1e-3])
    found, _ = known(LinearRecordings([table / units], units, 4, scale=units))
    np.testing.assert_allclose(found, expected * units, rtol=1e-7)


def test_own_starts_of_many_recordings_are_eliminated_without_loss() -> None:
    """Against singular values of all columns at once, with a condition of 1e8 in each recording's own numbers."""
    tables = [conditioned(30, np.geomspace(1e6, 1e-2, 5))[0] for _ in range(4)]
    shared, own = known(LinearRecordings(tables, np.ones(5), 2))
    whole = np.zeros((120, 2 + 12))
    for k, table in enumerate(tables):
        whole[30 * k : 30 * k + 30, :2] = table[:, :2]
        whole[30 * k : 30 * k + 30, 2 + 3 * k : 5 + 3 * k] = table[:, 2:]
    lengths = np.linalg.norm(whole, axis=0)
    _, sizes, right = np.linalg.svd(whole / lengths, full_matrices=False)
    expected = np.sqrt(np.sum((right.T / sizes) ** 2, axis=1)) / lengths
    np.testing.assert_allclose(shared, expected[:2], rtol=1e-6)
    given = np.isfinite(own.ravel())
    np.testing.assert_allclose(own.ravel()[given], expected[2:][given], rtol=1e-6)


def double_pendulum(shared: Array, own: Array, time: Array) -> Array:
    """Two points on rods of 1 m: shared second mass and gravity, the first mass is 1; own angles (2,), from rest."""
    m, g = shared

    def rate(x: Array) -> Array:
        a, b, u, v = x
        sin, cos = np.sin(a - b), np.cos(a - b)
        down = 1 + m * sin * sin
        first = -(1 + m) * g * np.sin(a) - m * sin * v * v
        second = m * g * np.sin(b) - m * sin * u * u
        du = (first + cos * second) / down
        dv = -cos * du + sin * u * u - g * np.sin(b)
        return np.array([u, v, du, dv])

    x, found, dt = np.array([own[0], own[1], 0 * g, 0 * g]), [], time[1] / 4
    for _ in time:
        found.append(x[:2])
        for _ in range(4):
            k1 = rate(x)
            k2 = rate(x + dt / 2 * k1)
            k3 = rate(x + dt / 2 * k2)
            x = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + dt * k3))
    return np.array(found)


@pytest.mark.slow
def test_five_seconds_of_a_double_pendulum_have_the_errors_of_differences() -> None:
    """Within a factor of 2: the motion makes of changes of its start a thousand times as much."""
    truth, own, time = np.array([0.7, 9.81]), np.array([[2.0, 2.6]]), np.linspace(0, 5, 251)
    clean = double_pendulum(truth, own[0], time)
    noise = 1e-6
    problem = AnalyticRecordings(
        double_pendulum,
        fit_parameters(["mass", "gravity"], truth),
        fit_parameters(["a", "b"], own),
        [time],
        [clean + noise * RNG.standard_normal(clean.shape)],
        np.array([noise, noise]),
    )
    shared, starts = known(problem)
    numbers, columns = np.concatenate([truth, own[0]]), []
    for k in range(4):
        ends = [double_pendulum(x[:2], x[2:], time) for x in numbers + 1e-7 * np.outer([-1, 1], np.eye(4)[k])]
        columns.append(((ends[1] - ends[0]) / 2e-7 / noise).ravel())
    lengths = np.linalg.norm(columns, axis=1)
    _, sizes, right = np.linalg.svd(np.array(columns).T / lengths, full_matrices=False)
    expected = np.sqrt(np.sum((right.T / sizes) ** 2, axis=1)) / lengths
    ratio = np.concatenate([shared, starts.ravel()]) / expected
    assert np.all((ratio > 0.5) & (ratio < 2)), ratio
