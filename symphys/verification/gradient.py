"""The gradient against central differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.shooting import VariableBlock
from symphys.transcription import Transcription

Array = NDArray[np.float64]
Values = Callable[[Array], Array]

DIFFERENCE_STEPS = (1e-4, 1e-5, 1e-6)
"""Steps of the central differences, as shares of the scale; the best counts, and a wrong slope passes none."""
EVERY_COMPONENT = 12
"""Variables up to this size are differenced component by component, larger ones along as many random directions."""
NOTICED = 1e-4
"""Relative error of central differences from which each side is examined by itself."""


def compare_gradient(transcription: Transcription, z: Array) -> list[dict[str, Any]]:
    """Adjoint against central differences, per variable.

    What is differentiated is the transcription's ``Probe``, whose gradient does not vanish at a solution.

    Returns:
        For each variable "error", |adjoint - difference| / scale; "scale", the norm of its slope; "step", the step of
        the best difference as a share of the variable's scale; NaN where one is not finite. "felt": what a change by
        the variable's scale changes, as a share of the value, of what the variable that is felt most changes, or of 1,
        whichever is largest; 0 where nothing depends on it. "jump" is 0 where central differences agree best. Where
        those of either side, without z itself, agree better, the value jumps at z, by as much as a change of the
        variable by "jump" of its scale brings about. An impact at the very end of a step does that: the time grid
        changes sides.
    """
    probe, blocks = transcription.probe, transcription.shooting.blocks
    slope = probe.gradient(z)
    rows = [_compare_block(probe.values, block, z, slope) for block in blocks]
    effects = [float(np.linalg.norm(slope[block.start : block.stop] * block.scale)) for block in blocks]
    size = max(abs(float(probe.values(z[None])[0])), *effects, 1.0)
    return [row | {"felt": effect / size} for row, effect in zip(rows, effects, strict=True)]


def _compare_block(value: Values, block: VariableBlock, z: Array, slope: Array) -> dict[str, Any]:
    norm = float(np.linalg.norm(slope[block.start : block.stop])) or 1.0
    directions = _directions(block, block.stop - block.start, z.size)
    middle, at = _best(lambda d, step: _mismatch(value, z, slope, d, step), directions)
    found = {"variable": block.name, "scale": float(np.linalg.norm(slope[block.start : block.stop]))}
    found |= {"error": middle / norm, "step": at, "jump": 0.0}
    if middle > NOTICED * norm:
        sides, near = _best(lambda d, step: _mismatch_beside(value, z, slope, d, step), directions)
        if sides < middle:
            jumps = [2 * near * _mismatch(value, z, slope, d, near) for d in directions]
            found |= {"error": sides / norm, "step": near, "jump": max_or_nan(jumps) / norm}
    return found


def _best(mismatch: Callable[[Array, float], float], directions: Array) -> tuple[float, float]:
    """(error, step): the least error of all steps, the worst of all directions; NaN if no step gives a number."""
    errors = [max_or_nan(mismatch(d, step) for d in directions) for step in DIFFERENCE_STEPS]
    known = [pair for pair in zip(errors, DIFFERENCE_STEPS, strict=True) if not np.isnan(pair[0])]
    return min(known, default=(np.nan, np.nan))


def max_or_nan(numbers: Any) -> float:
    """The largest; NaN if one is."""
    return float(np.max(np.fromiter(numbers, float), initial=0.0))


def _directions(block: VariableBlock, size: int, n: int) -> Array:
    """(k, n): unit steps in the scale of each component, or random combinations of many."""
    inside = np.eye(size)
    if size > EVERY_COMPONENT:
        inside = np.random.default_rng(1).standard_normal((EVERY_COMPONENT, size))
        inside /= np.linalg.norm(inside, axis=1, keepdims=True)
    whole = np.zeros((len(inside), n))
    whole[:, block.start : block.stop] = inside * block.scale
    return whole


def _mismatch(value: Values, z: Array, slope: Array, direction: Array, step: float) -> float:
    high, low = value(z + step * np.outer([1, -1], direction))
    return float(abs((high - low) / (2 * step) - slope @ direction) / np.linalg.norm(direction))


def _mismatch_beside(value: Values, z: Array, slope: Array, direction: Array, step: float) -> float:
    """The larger error of either side's derivative at z, from three points beside it: of second order."""
    errors = []
    for side in (step, -step):
        one, two, three = value(z + side * np.outer([1, 2, 3], direction))
        errors.append(abs((8 * two - 5 * one - 3 * three) / (2 * side) - float(slope @ direction)))
    return float(max(errors) / np.linalg.norm(direction))
