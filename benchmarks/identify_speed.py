"""How long does a fit of 285 recorded tosses take, and how long with differences in place of derivatives?

    python benchmarks/identify_speed.py FOLDER [--tosses 285] [--small 30]

FOLDER has cube_fit.npz; see docs/results/tosses.md. Shared numbers of the cube, its contacts and gravity are fitted to
the first 40 frames of each toss, and each toss has a start of its own: 12 numbers. The fit is ``symphys.identify``,
by exact derivatives and elimination of each start. Then ``scipy.optimize.least_squares`` gets the same residuals from
the same guess, with two-point differences: dense, for the first tosses, and with the sparsity of the arrow, so that all
starts are moved in 12 evaluations. Both are compared at the least merit that both of them reach.
"""

from __future__ import annotations

import argparse
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import lil_matrix
from tosses_data import CUBE, RATE, Tosses, read
from tosses_symphys import CUBE_NUMBERS, GRAVITY, Options, assigned, recording, tables_of, write

import symphys
from symphys.identification import FitOptions, fit
from symphys.prediction.residuals import RecordingResiduals, residuals_of
from symphys.types import Array

FRAMES = 40
"""Of each toss: the flight and the first impacts."""
STARTS = ("position", "orientation", "velocity", "angular_velocity")
NOISE = {"position": 0.0005, "orientation": 0.005}
"""[m], [rad]."""


class Reached(Exception):
    """The merit that is wanted, or the end of the time."""


def problem_of(tosses: Tosses, path: Path) -> symphys.Problem:
    """Shared numbers of the cube, and the start of each toss."""
    write(path, tosses, tosses.first())
    guess = {each.name: each.guess for each in CUBE_NUMBERS}
    columns = recording(CUBE, path, STARTS)
    for each in columns["measured"]:
        each["noise"] = NOISE[each["columns"]]
    variables: list[dict[str, Any]] = [{"name": f"v{k}", "sets": sets} for k, sets in enumerate(assigned(CUBE, guess))]
    variables.append({"name": "g", "sets": "gravity[2]", "guess": -GRAVITY, "scale": 0.1})
    variables += [{"name": f"start_{key}", "sets": f"cube.{key}", "each": "recording"} for key in STARTS]
    return symphys.load(tables_of(CUBE, guess, Options()) | {"variable": variables, "recording": [columns]})


class Flat:
    """Residuals of all tosses as one vector of one vector of numbers, as a general solver wants them."""

    def __init__(self, residuals: RecordingResiduals) -> None:
        """Count from now on."""
        self.of, self.which = residuals, np.arange(len(residuals.recordings))
        self.width, self.count, self.began = len(residuals.shared.guess), 0, time.perf_counter()

    @property
    def guess(self) -> Array:
        """Shared numbers, then those of each toss, by their scales."""
        return np.concatenate([self.of.shared.guess, self.of.own.guess.ravel()]) / self.scale

    @property
    def scale(self) -> Array:
        """Typical changes."""
        return np.concatenate([self.of.shared.scale, self.of.own.scale.ravel()])

    def __call__(self, x: Array) -> Array:
        """(m,): all residuals."""
        numbers = x * self.scale
        own = numbers[self.width :].reshape(self.of.own.guess.shape)
        found = np.concatenate(self.of.residuals(numbers[: self.width], own, self.which))
        self.count += 1
        return found

    def sparsity(self) -> lil_matrix:
        """Where residuals of a toss depend on a number."""
        sizes = [len(self.of.rows(k).time) for k in self.which]
        own, first = self.of.own.guess.shape[1], np.concatenate([[0], np.cumsum(sizes)])
        found = lil_matrix((int(first[-1]), self.width + own * len(sizes)), dtype=np.int8)
        found[:, : self.width] = 1
        for k in self.which:
            place = self.width + own * int(k)
            found[int(first[k]) : int(first[k + 1]), place : place + own] = 1
        return found


Course = list[tuple[float, float]]
"""Seconds and the least merit so far."""


def by_exact_derivatives(residuals: RecordingResiduals) -> tuple[Course, str]:
    """The course of the fit after compiling, and how it ended."""
    residuals.jacobian(residuals.shared.guess, residuals.own.guess, np.arange(1))  # compiles
    outcome = fit(residuals, FitOptions(damping=1e-6)).outcome
    return [(step.seconds, step.merit) for step in outcome.state.history], outcome.status.value


def by_differences(residuals: RecordingResiduals, goal: float, sparse: bool, limit: float) -> tuple[Course, int]:
    """The course until the goal or the limit of seconds, and evaluations."""
    flat = Flat(residuals)
    pattern = flat.sparsity() if sparse else None
    method: dict[str, Any] = {"jac_sparsity": pattern, "tr_solver": "lsmr"} if sparse else {"method": "trf"}
    course: Course = []

    def until(x: Array) -> Array:
        found = flat(x)
        merit = float(found @ found)
        if not course or merit < course[-1][1]:
            course.append((time.perf_counter() - flat.began, merit))
        if merit <= goal or time.perf_counter() - flat.began > limit:
            raise Reached
        return found

    with suppress(Reached):
        least_squares(until, flat.guess, jac="2-point", diff_step=1e-6, **method)
    return course, flat.count


def first_below(course: Course, merit: float) -> float:
    """Seconds until the merit is reached."""
    return next(seconds for seconds, reached in course if reached <= merit)


def main() -> None:
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tosses", type=int, default=285)
    parser.add_argument("--small", type=int, default=30, help="tosses of the dense differences")
    parser.add_argument("--limit", type=float, default=1200.0, help="[s] of each fit by differences")
    given = parser.parse_args()
    every = read(given.folder, CUBE, "fit")
    for count, sparse in ((given.tosses, True), (given.small, False)):
        tosses = every.only(np.arange(count))
        tosses = tosses.cut(np.minimum(np.diff(tosses.start), FRAMES))
        with TemporaryDirectory() as folder:
            residuals = residuals_of(problem_of(tosses, Path(folder) / "tosses.npz"))
            sizes = f"{len(residuals.shared.guess)} shared numbers and {residuals.own.guess.shape[1]} of each"
            print(f"{count} tosses at {RATE:g} Hz, {sizes}")
            course, status = by_exact_derivatives(residuals)
            seconds, merit = course[-1]
            print(f"exact derivatives: {seconds:.1f} s, merit {merit:.5g}, {len(course) - 1} iterations, {status}")
            others, evaluations = by_differences(residuals, merit, sparse, given.limit)
            kind, (spent, least) = "sparse" if sparse else "dense", others[-1]
            print(f"{kind} differences: {spent:.1f} s, merit {least:.5g}, {evaluations} evaluations")
            same = max(least, merit)
            ours, theirs = first_below(course, same), first_below(others, same)
            print(f"to a merit of {same:.5g}: {ours:.1f} s and {theirs:.1f} s, {theirs / ours:.1f} times as long")


if __name__ == "__main__":
    main()
