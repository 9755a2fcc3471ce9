"""Recordings of models with closed forms, as the problem of identification that a simulator would make of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from symphys.identification.interface import FitParameters, ResidualRows, fit_parameters
from symphys.types import Array

Model = Callable[[Array, Array, Array], Array]
"""Of shared (s,), own (o,) and time (n,): what is measured, (n, q), also of complex numbers."""
TINY = 1e-30


@dataclass
class AnalyticRecordings:
    """K recordings of a model, with noise; derivatives by complex steps, exact to rounding."""

    model: Model
    shared: FitParameters
    own: FitParameters
    times: Sequence[Array]
    measured: Sequence[Array]
    noise: Array
    quantities: tuple[str, ...] = ("place",)
    units: tuple[str, ...] = ("m",)
    noise_known: NDArray[np.bool_] = field(default_factory=lambda: np.array([True]))
    impacts: Sequence[float] = ()
    evaluated: int = 0

    def __post_init__(self) -> None:
        self.recordings = tuple(f"toss/{k:04d}" for k in range(len(self.times)))
        self.held_back = np.zeros(len(self.times), bool)

    def _kept(self, k: int) -> NDArray[np.bool_]:
        return ~np.isnan(self.measured[k])

    def rows(self, recording: int) -> ResidualRows:
        kept, time = self._kept(recording), self.times[recording]
        grid = np.broadcast_to(np.arange(kept.shape[1]), kept.shape)
        since = time - self.impacts[recording] if self.impacts else np.full(time.shape, np.nan)
        since = np.where(since >= 0, since, np.nan)
        times, since = (np.broadcast_to(each[:, None], kept.shape)[kept] for each in (time, since))
        which = grid[kept] if len(self.quantities) > 1 else np.zeros(kept.sum(), int)
        component = np.zeros(kept.sum(), int) if len(self.quantities) > 1 else grid[kept]
        return ResidualRows(which, component, times, np.broadcast_to(self.noise, kept.shape)[kept], since)

    def _row(self, k: int, shared: Array, own: Array) -> Array:
        kept = self._kept(k)
        with np.errstate(invalid="ignore"):  # of complex numbers that are not finite
            return ((self.model(shared, own, self.times[k]) - self.measured[k]) / self.noise)[kept]

    def residuals(self, shared: Array, own: Array, which: NDArray[np.int64]) -> list[Array]:
        self.evaluated += len(which)
        found = [self._row(int(k), shared, own[k]) for k in which]
        return [r if np.isfinite(r).all() else np.full(r.shape, np.inf) for r in found]

    def jacobian(self, shared: Array, own: Array, which: NDArray[np.int64]) -> list[tuple[Array, Array, Array]]:
        found = []
        for k in map(int, which):
            columns = []
            for j in range(len(shared) + own.shape[1]):
                both = np.concatenate([shared, own[k]]).astype(complex)
                both[j] += TINY * 1j
                columns.append(np.imag(self._row(k, both[: len(shared)], both[len(shared) :])) / TINY)
            table = np.array(columns).reshape(len(columns), -1).T
            found.append((self._row(k, shared, own[k]), table[:, : len(shared)], table[:, len(shared) :]))
        return found


def projectile(shared: Array, own: Array, time: Array) -> Array:
    """Drag linear in the speed: shared gravity g [m/s^2] and drag c [1/s], own velocities (2,) [m/s]; places (n, 2)."""
    g, c = shared
    faded = (1 - np.exp(-c * time)) / c
    return np.stack([own[0] * faded, (own[1] + g / c) * faded - g / c * time], axis=1)


def oscillator(shared: Array, own: Array, time: Array) -> Array:
    """Shared frequency w [rad/s] and damping ratio d, own start (2,): x [m] and v [m/s]; places (n, 1)."""
    w, d = shared
    turned = w * np.sqrt(1 - d * d)
    faded = np.exp(-d * w * time)
    return (faded * (own[0] * np.cos(turned * time) + (own[1] + d * w * own[0]) / turned * np.sin(turned * time)))[
        :, None
    ]


def bounce(shared: Array, own: Array, time: Array) -> Array:
    """A ball that bounces with shared gravity [m/s^2] and restitution e, from the own height [m]; places (n, 1).

    The instants of impact are known in closed form: which one is the last is decided by their real parts.
    """
    g, e = shared
    fall = np.sqrt(2 * own[0] / g)
    height = own[0] - g * time**2 / 2
    since, speed, found = fall, g * fall, np.where(time < fall.real, height, 0 * height)
    for _ in range(6):
        speed = e * speed
        flight = 2 * speed / g
        there = (time >= since.real) & (time < (since + flight).real)
        left = time - since
        found = np.where(there, speed * left - g * left**2 / 2, found)
        since = since + flight
    return found[:, None]


def slide(shared: Array, own: Array, time: Array) -> Array:
    """A block that friction stops: shared friction, own speed [m/s]; places (n, 1)."""
    (friction,) = shared
    slowing = friction * 9.81
    stop = own[0] / slowing
    moving = time < stop.real
    return np.where(moving, own[0] * time - slowing * time**2 / 2, own[0] ** 2 / (2 * slowing))[:, None]


def tumble(shared: Array, own: Array, time: Array) -> Array:
    """A ball on a floor of bumps: own height [m] and speed [m/s], shared gravity and restitution; places (n, 2).

    A bump turns the speed along the floor by its slope where the ball lands: chaos, in closed form between impacts.
    """
    g, e = shared
    since = np.sqrt(2 * own[0] / g)
    x, along, up = own[1] * since, own[1], g * since
    falling = time < since.real
    height, place = np.where(falling, own[0] - g * time**2 / 2, 0 * g), np.where(falling, own[1] * time, 0 * g)
    for _ in range(8):
        up = e * up
        along, flight = along + 0.25 * np.sin(40 * x) * up, 2 * up / g
        there, left = (time >= since.real) & (time < (since + flight).real), time - since
        height = np.where(there, up * left - g * left**2 / 2, height)
        place = np.where(there, x + along * left, place)
        x, since = x + along * flight, since + flight
    return np.stack([place, height], axis=1)


@dataclass(frozen=True)
class Truth:
    """A model with its true numbers: shared (s,), own (K, o), where the fit starts, and samples of each recording."""

    model: Model
    names: tuple[str, ...]
    shared: Array
    own: Array
    duration: float
    noise: Array
    samples: int = 40


TRUTHS = {
    "projectile": Truth(
        projectile,
        ("gravity", "drag"),
        np.array([9.81, 0.4]),
        np.array([[3.0, 4.0], [5.0, 2.0], [4.0, 6.0]]),
        1.2,
        np.array([0.01, 0.01]),
    ),
    "oscillator": Truth(
        oscillator,
        ("frequency", "damping"),
        np.array([6.0, 0.05]),
        np.array([[0.1, 0.0], [0.05, 0.4], [0.02, -0.5]]),
        3.0,
        np.array([0.003]),
    ),
    "bounce": Truth(
        bounce,
        ("gravity", "restitution"),
        np.array([9.81, 0.8]),
        np.array([[1.0], [0.7], [1.4]]),
        1.8,
        np.array([0.005]),
    ),
    "slide": Truth(slide, ("friction",), np.array([0.3]), np.array([[1.0], [1.5], [2.2]]), 0.9, np.array([0.004])),
}


def recordings(truth: Truth, seed: int, off: float = 1.05, **given: object) -> AnalyticRecordings:
    """Noisy recordings; the fit starts ``off`` times the truth."""
    stream = np.random.default_rng(seed)
    times = [np.linspace(0, truth.duration, truth.samples)] * len(truth.own)
    clean = [truth.model(truth.shared, own, time) for own, time in zip(truth.own, times, strict=True)]
    measured = [each + truth.noise * stream.standard_normal(each.shape) for each in clean]
    own_names = [f"own {j}" for j in range(truth.own.shape[1])]
    shared = fit_parameters(truth.names, truth.shared * off, lower=0, upper=100)
    own = fit_parameters(own_names, truth.own * off)
    return AnalyticRecordings(truth.model, shared, own, times, measured, truth.noise, **given)  # type: ignore[arg-type]
