"""How far a solver had come after each iteration: step functions of work or time, exact numbers only."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from symphys.results.result import StageRecord, smoothed
from symphys.results.run import Run
from symphys.results.trace import OUTPUT
from symphys.trajectory import Array

GRID = 300


@dataclass(frozen=True)
class Curve:
    """A quantity as a step function: ``y[i]`` holds from ``x[i]`` on."""

    x: Array
    y: Array


def best_so_far(run: Run) -> Array:
    """(rows,): the lowest objective up to each iteration, as the solver recorded it where it did."""
    recorded = run.trace["best"]
    known = recorded if np.isfinite(recorded).any() else run.trace["objective"]
    return falling(run, known, "objective", lambda stage: stage.exact_objective)


def miss_so_far(run: Run) -> Array:
    """(rows,): the smallest largest error / tolerance up to each iteration."""
    return falling(run, run.trace["max_violation"], "worst", lambda stage: stage.exact_worst)


def told(name: str) -> Quantity:
    """(rows,): what the problem tells of the best point so far."""
    return lambda run: np.where(run.trace["smoothing"] > 0, np.nan, run.trace[OUTPUT + name])


Quantity = Callable[[Run], Array]
QUANTITIES: tuple[tuple[str, Quantity], ...] = (
    ("Lowest objective so far", best_so_far),
    ("Largest error / tolerance, smallest so far", miss_so_far),
)


def falling(run: Run, recorded: Array, name: str, exact: Callable[[StageRecord], float]) -> Array:
    """(rows,): the lowest of what is known to hold exactly.

    A row of a stage of smoothing tells of another problem: of such a stage only its start and its end count, judged
    exactly. ``name``: the quantity among those of the guess; ``exact``: that of a stage.
    """
    smoothing = run.trace["smoothing"]
    known = np.where(smoothing > 0, np.nan, recorded)
    if smoothed(run.stages) and known.size:
        known[0] = run.guess.get(name, np.nan)
    for stage in run.stages:
        rows = np.flatnonzero(smoothing == stage.smoothing)
        if stage.smoothing > 0 and rows.size:
            known[rows[-1]] = exact(stage)
    return np.fmin.accumulate(known) if known.size else known


def curve(run: Run, along: str, quantity: Quantity) -> Curve | None:
    """One run's curve; None if nothing of it is finite."""
    x, y = run.trace[along], quantity(run)
    known = np.isfinite(x) & np.isfinite(y)
    return Curve(x[known], y[known]) if known.any() else None


def median_curve(curves: Sequence[Curve]) -> Curve:
    """The median of step functions from where all have begun; a curve that has ended keeps its last value."""
    if len(curves) == 1:
        return curves[0]
    grid = np.unique(np.concatenate([c.x for c in curves]))
    grid = grid[grid >= max(c.x[0] for c in curves)]
    if grid.size > GRID:
        grid = grid[np.linspace(0, grid.size - 1, GRID).round().astype(int)]
    values = [c.y[np.searchsorted(c.x, grid, side="right") - 1] for c in curves]
    return Curve(grid, np.median(values, axis=0))
