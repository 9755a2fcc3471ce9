"""Bounds that hold an answer back: where z lies at one, and what is minimised falls beyond it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.shooting import VariableBlock
from symphys.transcription import Transcription
from symphys.types import Array

AT = 1e-9
"""A component lies at a bound within this share of 1 + the bound."""
FALLS = 1e-6
"""Gain of a change by the scale, as a share of 1 + |merit|, below which a bound does not count as active."""


def held_bounds(transcription: Transcription, z: Array) -> list[dict[str, Any]]:
    """Return the bounds at ``z`` (n,) beyond which the merit would fall, the largest gain first.

    Returns:
        Each with its "variable", "component" of "components", "side" ("lower" or "upper"), and "bound", NaN where it is
        not the same at all of these knots; "knots" that lie there, "of" all; "gain", what the change of the component
        by its scale at all of these knots would gain, to first order.
    """
    shooting = transcription.shooting
    lower, upper = shooting.stacked("lower"), shooting.stacked("upper")
    free = lower < upper
    sides = {side: free & lies_at(z, bound) for side, bound in (("lower", lower), ("upper", upper))}
    if not any(at.any() for at in sides.values()):
        return []
    values = shooting.evaluator.gradient(z[None], 0.0)
    if values.gradient is None or not np.isfinite(values.gradient).all():
        return []
    slope = values.gradient[0] * shooting.stacked("scale")
    least = FALLS * (1 + abs(float(values.merit[0])))
    gains = {"lower": np.where(sides["lower"], slope, 0.0), "upper": np.where(sides["upper"], -slope, 0.0)}
    rows = [row for block in shooting.blocks for side in gains for row in _rows(block, side, gains[side], least)]
    return sorted(rows, key=lambda row: -float(row["gain"]))


def lies_at(z: Array, bound: Array) -> NDArray[np.bool_]:
    """Return whether z lies at a bound (n,), which may be infinite."""
    finite = np.where(np.isfinite(bound), bound, 0.0)
    return np.asarray(np.isfinite(bound) & (np.abs(z - finite) <= AT * (1 + np.abs(finite))))


def _rows(block: VariableBlock, side: str, gains: Array, least: float) -> list[dict[str, Any]]:
    """Return the rows of one variable; ``gains`` (n,): of each component of z."""
    components, knots = block.shape
    gain = gains[block.start : block.stop].reshape(knots, components)
    bounds = getattr(block, side).reshape(knots, components)
    rows = []
    for i in range(components):
        held = gain[:, i] > least
        if held.any():
            same = bounds[held, i]
            bound = float(same[0]) if np.ptp(same) == 0 else float("nan")
            found = {"variable": block.name, "component": i, "components": components, "side": side, "bound": bound}
            rows.append(found | {"knots": int(held.sum()), "of": knots, "gain": float(gain[held, i].sum())})
    return rows
