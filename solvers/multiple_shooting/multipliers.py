"""Multipliers of multiple shooting by their meaning, from which another solve, by either library, starts.

They are those of the defects, each in the tangent of its own node, of the limits, and of the bounds of z, unscaled. In
the layout in stages the rows of copies have multipliers too, which follow from these and are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from symphys.solvers.multiple_shooting.nlp import MultipleShootingNlp
from symphys.types import Array

STARTS, DEFECTS, LIMITS, BOUNDS, BARRIER = "starts", "defects", "limits", "bounds", "barrier"
"""Names of the arrays: (M + 1,), (M, n), (c,), (len(z),) and ()."""


@dataclass(frozen=True)
class NlpMultipliers:
    """Multipliers in the layout of a program.

    Attributes:
        bounds: (size,) of w's bounds; empty: there are none, as for the rows.
        rows: (rows,), those of defects for tangents that begin at the nodes.
        barrier: mu there.
    """

    bounds: Array
    rows: Array
    barrier: float

    def by_name(self, nlp: MultipleShootingNlp) -> dict[str, Array]:
        """Return the multipliers as named arrays; empty if there are none."""
        if not self.rows.size:
            return {}
        layout = nlp.layout
        return {
            STARTS: np.asarray(nlp.plan.grid.starts, float),
            DEFECTS: self.rows[layout.defects],
            LIMITS: self.rows[layout.limits],
            BOUNDS: self.bounds[layout.home] / nlp.scale,
            BARRIER: np.asarray(self.barrier),
        }


def fitted(nlp: MultipleShootingNlp, saved: Mapping[str, Array]) -> NlpMultipliers | None:
    """Arrange named multipliers in the layout of a program; None if nodes or limits differ.

    Steps may be shorter or longer: nodes are compared as shares of the duration.
    """
    layout, starts = nlp.layout, nlp.plan.grid.starts
    shapes = {
        STARTS: starts.shape,
        DEFECTS: layout.defects.shape,
        LIMITS: layout.limits.shape,
        BOUNDS: nlp.scale.shape,
        BARRIER: (),
    }
    if any(name not in saved or np.shape(saved[name]) != shape for name, shape in shapes.items()):
        return None
    if not all(np.isfinite(saved[name]).all() for name in shapes):
        return None
    if not np.allclose(saved[STARTS] * starts[-1], starts * saved[STARTS][-1]):
        return None
    bounds, rows = np.zeros(layout.size), np.zeros(layout.rows)
    bounds[layout.home] = saved[BOUNDS] * nlp.scale
    rows[layout.defects], rows[layout.limits] = saved[DEFECTS], saved[LIMITS]
    return NlpMultipliers(bounds, rows, float(saved[BARRIER]))


def at_nodes(nlp: MultipleShootingNlp, w: Array, rows: Array) -> Array:
    """Transform the rows (rows,) of the defects from tangents at w's references to tangents at its nodes."""
    moved = rows.copy()
    if rows.size:
        turns, defects = nlp.shots(w).turns, nlp.layout.defects
        moved[defects] = np.linalg.solve(turns.transpose(0, 2, 1), rows[defects][:, :, None])[:, :, 0]
    return moved


def barrier_at(nlp: MultipleShootingNlp, lower: Array, upper: Array, w: Array, bounds: Array, rows: Array) -> float:
    """Return the mean product of multipliers and distances from their bounds, clipped for IPOPT's start.

    Bounds (len(z),) are those of z; w (size,) is the iterate, ``bounds`` (size,) and ``rows`` its multipliers.
    """
    products = []
    limits = (nlp.bounds(lower, upper), nlp.row_bounds())
    for at, duals, (low, high) in zip((w, nlp.constraints(w)), (bounds, rows), limits, strict=True):
        bounded = (low < high) & (np.isfinite(low) | np.isfinite(high))
        if duals.size and bounded.any():
            distance = np.minimum((at - low)[bounded], (high - at)[bounded])
            products.append(np.abs(duals[bounded]) * distance.clip(min=0))
    return float(np.clip(np.mean(np.concatenate(products)), 1e-9, 0.1)) if products else 1e-2
