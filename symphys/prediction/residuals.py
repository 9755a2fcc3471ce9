"""From predictions to residuals: (predicted - measured) / standard deviation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from symphys.expression.units import unit_of
from symphys.identification import FitParameters, IdentificationError, ResidualRows
from symphys.model.world import World
from symphys.prediction.parameters import fit_numbers
from symphys.prediction.predictor import PredictedSamples, Predictor
from symphys.prediction.rotations import rotation_slopes, rotation_vectors
from symphys.problem import Measured, Problem, Recording
from symphys.problem.quantities import quantity_unit
from symphys.types import Array, Bools, Ints

WHOLE_TURN = 2 * np.pi
LENGTHS = ("m", "m/s", "m/s^2")
"""Units that a scale of lengths multiplies."""
GUESSED_NOISE_SHARE, GUESSED_NOISE_ANGLE, MIN_NOISE = 0.01, 0.02, 1e-9
"""Where the noise is not given, it begins as a share of the spread of what was measured, or as an angle [rad]."""


class RecordingResiduals:
    """The residuals of a problem's recordings, in the units of the measurement; see ``RecordedResiduals``.

    Attributes:
        predictor: of the recordings.
        noise: by quantity (residuals of a sample,) what residuals are divided by.
    """

    def __init__(self, problem: Problem, predictor: Predictor) -> None:
        """Look up units, noise and missing samples."""
        self.predictor = predictor
        taken = predictor.recordings
        self.recordings = tuple(each.name for each in taken)
        self.held_back = np.array([each.held_back for each in taken])
        self.shared: FitParameters = fit_numbers(problem, predictor.shared, predictor.guesses(own=False))
        self.own: FitParameters = fit_numbers(problem, predictor.own, predictor.guesses(own=True))
        keys = dict.fromkeys(_key(recording, each) for recording in taken for each in recording.measured)
        self._places = {key: place for place, key in enumerate(keys)}
        self.quantities = quantity_names(list(keys))
        world, first = problem.world(), {_key(r, m): m for r in taken for m in r.measured}
        self._units = [_unit(each, world) for each in first.values()]
        self.units = tuple(
            "rad" if each.orientation else unit for each, unit in zip(first.values(), self._units, strict=True)
        )
        self.noise_known = np.array([each.noise is not None for each in first.values()])
        self.noise = [self._noise(key, each) for key, each in first.items()]
        self._present = [[present(each) for each in recording.measured] for recording in taken]

    def _noise(self, key: tuple[str, str], first: Measured) -> Array:
        if first.noise is not None:
            return first.noise
        if first.orientation:
            return np.full(3, GUESSED_NOISE_ANGLE)
        found = [m.values for r in self.predictor.recordings for m in r.measured if _key(r, m) == key]
        values = np.concatenate(found)
        spread = np.nanstd(values, axis=0)
        largest = float(np.nanmax(np.abs(values)))
        return np.asarray(np.maximum(GUESSED_NOISE_SHARE * np.where(spread > 0, spread, largest), MIN_NOISE))

    def rows(self, recording: int) -> ResidualRows:
        """Describe the residuals of a recording."""
        taken, parts = self.predictor.recordings[recording], list[tuple[Any, ...]]()
        for each, kept in zip(taken.measured, self._present[recording], strict=True):
            place = self._places[_key(taken, each)]
            component = np.broadcast_to(np.arange(kept.shape[1]), kept.shape)[kept]
            time = np.broadcast_to(taken.time[:, None], kept.shape)[kept]
            parts.append((np.full(component.size, place), component, time, self.noise[place][component]))
        quantity, component, time, noise = (np.concatenate(each) for each in zip(*parts, strict=True))
        return ResidualRows(quantity, component, time, noise)

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return the residuals (m_k,) of each recording in ``which``."""
        found = self.predictor.values(shared, own, which.tolist())
        return [self._residuals(int(k), sampled) for k, sampled in zip(which, found, strict=True)]

    def jacobian(self, shared: Array, own: Array, which: Ints) -> list[tuple[Array, Array, Array]]:
        """Return residuals and derivatives of each recording in ``which``."""
        found = []
        for k, sampled in zip(which, self.predictor.slopes(shared, own, which.tolist()), strict=True):
            by = self._slopes(int(k), sampled)
            found.append((self._residuals(int(k), sampled), by[:, : len(shared)], by[:, len(shared) :]))
        return found

    def simulated_impacts(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return (i,) [s] the instants of the simulated impacts of each recording in ``which``."""
        return list(self.predictor.impacts(shared, own, which.tolist()))

    def _residuals(self, k: int, sampled: PredictedSamples) -> Array:
        taken, parts = self.predictor.recordings[k], []
        for each, kept, place, columns in self._parts(k):
            off = difference(each, sampled.values[:, columns] / self._scale(place, sampled)) / self.noise[place]
            parts.append(off[kept])
        joined = np.sqrt(taken.weight) * np.concatenate(parts)
        return joined if np.isfinite(joined).all() else np.full(joined.shape, np.inf)

    def _slopes(self, k: int, sampled: PredictedSamples) -> Array:
        assert sampled.slopes is not None, "slopes were asked for"
        taken, parts = self.predictor.recordings[k], []
        for each, kept, place, columns in self._parts(k):
            values, by, scale = sampled.values[:, columns], sampled.slopes[:, columns], self._scale(place, sampled)
            if each.orientation:
                by = rotation_slopes(each.values, values) @ by
            elif self._units[place] in LENGTHS:
                by = by / scale - (values / scale**2)[:, :, None] * sampled.by_scale
            parts.append((by / self.noise[place][:, None])[kept])
        return np.asarray(np.sqrt(taken.weight) * np.concatenate(parts))

    def _parts(self, k: int) -> Iterator[tuple[Measured, Bools, int, slice]]:
        """Yield what was measured, where there is a number, its index among quantities, and its predicted columns."""
        taken = self.predictor.recordings[k]
        stops = np.cumsum(list(self.predictor.sizes.values())).tolist()
        columns = {
            text: slice(stop - size, stop)
            for (text, size), stop in zip(self.predictor.sizes.items(), stops, strict=True)
        }
        for each, kept in zip(taken.measured, self._present[k], strict=True):
            yield each, kept, self._places[_key(taken, each)], columns[each.value.text]

    def columns(self, k: int, sampled: PredictedSamples) -> Iterator[tuple[Measured, str, Array, float]]:
        """Yield what was measured, its unit, what is predicted, and the factor from measured to predicted."""
        for each, _, place, columns in self._parts(k):
            yield each, self._units[place], sampled.values[:, columns], self._scale(place, sampled)

    def _scale(self, place: int, sampled: PredictedSamples) -> float:
        return sampled.scale if self._units[place] in LENGTHS else 1.0


def residuals_of(problem: Problem, threads: int | None = None) -> RecordingResiduals:
    """Return the residuals of all recordings of a problem; IdentificationError where there is nothing to identify."""
    if not problem.recordings:
        raise IdentificationError(
            "there is no [[recording]] to identify from; the documentation has one, Identification"
        )
    if not problem.variables:
        raise IdentificationError("there is no [[variable]], so that nothing can be identified")
    return RecordingResiduals(problem, Predictor(problem, problem.recordings, threads))


def present(measured: Measured) -> Bools:
    """Return (n, residuals of a sample) where a number was measured."""
    finite: Bools = np.isfinite(measured.values)
    return np.repeat(np.all(finite, axis=1, keepdims=True), 3, axis=1) if measured.orientation else finite


def difference(measured: Measured, predicted: Array) -> Array:
    """Return (n, m) predicted less measured; for orientations the rotation vector (n, 3) [rad] to the prediction.

    Angles of joints are known up to whole turns, see ``without_turns``.
    """
    if measured.orientation:
        return rotation_vectors(measured.values, predicted)
    off: Array = predicted - measured.values
    return np.stack([without_turns(column) for column in off.T], axis=1) if measured.angle else off


def without_turns(off: Array) -> Array:
    """Remove whole turns from differences (n,) [rad] of an encoder with an arbitrary or changing origin.

    The first is the nearest of those that differ by whole turns, and none jumps by more than half a turn to the next.
    """
    found, known = off.copy(), np.isfinite(off)
    if known.any():
        turned = np.unwrap(off[known])
        found[known] = turned - WHOLE_TURN * np.round(turned[0] / WHOLE_TURN)
    return found


def quantity_names(keys: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Name the measured quantities; with the table's name where tables share a name for different formulas."""
    names = [name for name, _ in keys]
    return tuple(name if names.count(name) == 1 else f"{name}: {text}" for name, text in keys)


def _key(recording: Recording, measured: Measured) -> tuple[str, str]:
    """Return the key of a quantity: its name and formula."""
    return measured.name, measured.value.text


def _unit(measured: Measured, world: World) -> str:
    """Return the unit of a measurement, as far as it is known."""
    units = {name: unit for name in measured.value.names if (unit := quantity_unit(name, world)) is not None}
    return unit_of(measured.value, units)
