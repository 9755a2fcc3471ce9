"""Charts of the node states: a node is a reference state with a tangent at it, and slopes transform with the chart.

A problem gives slopes in the tangent of the state itself. A node that is ``retract(reference, d)`` with d other than 0
needs the slope of that tangent by d; a defect that is measured at the reference of the next node needs the slope of
``difference(reference, state)`` by the tangent of the state. Both are the unit matrix but for the columns of rotations,
which are differences of fourth order, with an error like that of rounding: retract and difference are smooth and cheap.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from symphys.shooting import StagedProblem
from symphys.types import Array, Ints

DIFFERENCE_STEP = 1e-3
"""Step of the differences in tangents [rad], [m]; the error is below 1e-12 for rotations of some radians."""
UNIT_TOLERANCE = 1e-7
"""Deviation at random offsets up to which a column counts as one of the unit matrix everywhere."""
STENCIL = ((1, 8 / 12), (-1, -8 / 12), (2, -1 / 12), (-2, 1 / 12))
"""(offset, weight) of the fourth-order central difference."""


def curved_columns(problem: StagedProblem, states: Array) -> Ints:
    """Return the tangent entries whose columns differ from the unit matrix, at random offsets from (M, nx)."""
    tangents = np.random.default_rng(0).standard_normal((len(states), problem.tangent_size))
    every, there = np.arange(problem.tangent_size), problem.retract(states, tangents)
    found = np.zeros(problem.tangent_size, bool)
    for matrix in (pulled(problem, states, there, tangents, every), transported(problem, states, there, every)):
        off = np.abs(matrix - np.eye(problem.tangent_size)).max(axis=(0, 1))
        found |= ~(off < UNIT_TOLERANCE)
    return np.flatnonzero(found)


def slopes(moved: Callable[[Array], Array], count: int, size: int, columns: Ints) -> Array:
    """Differentiate ``moved``, (rows, count, size) -> the same, at offset 0: (count, size, size).

    Of the columns that are not asked for the slope is that of the unit matrix.
    """
    matrix = np.broadcast_to(np.eye(size), (count, size, size)).copy()
    if len(columns):
        offsets = DIFFERENCE_STEP * np.eye(size)[columns][:, None, :] * np.ones((1, count, 1))
        total = np.zeros((len(columns), count, size))
        for factor, weight in STENCIL:
            total += weight / DIFFERENCE_STEP * moved(factor * offsets)
        matrix[:, :, columns] = total.transpose(1, 2, 0)
    return matrix


def pulled(problem: StagedProblem, reference: Array, nodes: Array, tangents: Array, columns: Ints) -> Array:
    """Return (M, n, n): a node's own tangent by the tangent d at its reference; reference, nodes (M, nx), d (M, n)."""
    count, size = tangents.shape
    if not np.any(tangents):
        columns = columns[:0]

    def moved(offsets: Array) -> Array:
        rows = len(offsets)
        there = problem.retract(np.tile(reference, (rows, 1)), (tangents + offsets).reshape(-1, size))
        return problem.difference(np.tile(nodes, (rows, 1)), there).reshape(rows, count, size)

    return slopes(moved, count, size, columns)


def transported(problem: StagedProblem, reference: Array, states: Array, columns: Ints) -> Array:
    """Return (M, n, n): ``difference(reference, state)`` by the state in its own tangent; both (M, nx)."""
    count, size = len(reference), problem.tangent_size

    def moved(offsets: Array) -> Array:
        rows = len(offsets)
        there = problem.retract(np.tile(states, (rows, 1)), offsets.reshape(-1, size))
        return problem.difference(np.tile(reference, (rows, 1)), there).reshape(rows, count, size)

    return slopes(moved, count, size, columns)


def interpolated(problem: StagedProblem, states: Array, fractions: Array) -> Array:
    """Interpolate states (rows, nx) at fractions (B,), 0 to 1, linearly in tangents: (B, nx)."""
    position = np.clip(fractions, 0, 1) * (len(states) - 1)
    before = np.minimum(position.astype(int), len(states) - 2)
    ahead = problem.difference(states[before], states[before + 1])
    return problem.retract(states[before], (position - before)[:, None] * ahead)
