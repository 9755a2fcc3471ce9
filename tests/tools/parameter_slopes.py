"""A cost with its slopes, exact and by differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from symphys.problem import load_problem
from symphys.transcription import transcribe
from symphys.types import Array


def slopes_of(file: Path, step: float = 0.0) -> tuple[float, Array, Array]:
    """The cost at the guess, its exact gradient (n,), and that by central differences.

    ``step``: of all variables; 0: a millionth of each, for those that are not 0.
    """
    made = transcribe(load_problem(file), backend="casadi")
    z = np.concatenate([block.guess for block in made.shooting.blocks])
    steps = np.diag(np.full(z.size, step) if step else 1e-6 * np.abs(z))
    evaluator = made.shooting.evaluator
    gradient = evaluator.gradient(z[None], 0.0).gradient
    assert gradient is not None
    value, *merits = evaluator.value(np.vstack([z, z + steps, z - steps]), 0.0).merit
    differences = (np.array(merits[: z.size]) - merits[z.size :]) / (2 * steps.diagonal())
    return float(value), np.asarray(gradient[0]), differences


def slopes(file: Path) -> tuple[float, float, float]:
    """The same of a problem with one variable."""
    value, (exact,), (differences,) = slopes_of(file)
    return value, float(exact), float(differences)
