"""CMA-ES on the published measure, the same for each engine, and a file with what it found."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cma
import numpy as np

from symphys.types import Array

SIGMA, POPULATION = 1.0, 12


@dataclass(frozen=True)
class Number:
    """A number that is fitted.

    Attributes:
        name: of it.
        guess: where the search starts.
        step: first standard deviation of the search; of one that is a factor, of its logarithm.
        factor: whether it is above 0, and searched as a logarithm.
    """

    name: str
    guess: float
    step: float
    factor: bool = True

    def at(self, x: float) -> float:
        """Its value x standard deviations from the guess."""
        return float(self.guess * np.exp(self.step * x) if self.factor else self.guess + self.step * x)


def values(numbers: Sequence[Number], x: Array) -> dict[str, float]:
    """By name."""
    return {each.name: each.at(float(at)) for each, at in zip(numbers, x, strict=True)}


def search(
    numbers: Sequence[Number], errors: Callable[[Mapping[str, float]], Array], evaluations: int, seed: int = 1
) -> tuple[dict[str, float], int]:
    """Numbers with the least sum of the mean errors [% and degrees], and how many evaluations it took."""
    options = {"popsize": POPULATION, "maxfevals": evaluations, "seed": seed, "verbose": -9}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of plots that are not asked for
        strategy = cma.CMAEvolutionStrategy(np.zeros(len(numbers)), SIGMA, options)
    start = float(errors({each.name: each.guess for each in numbers}).mean(axis=0).sum())
    best, least = np.zeros(len(numbers)), start
    while not strategy.stop():
        asked = strategy.ask()
        merits = [float(errors(values(numbers, x)).mean(axis=0).sum()) for x in asked]
        strategy.tell(asked, merits)
        if min(merits) < least:
            best, least = asked[int(np.argmin(merits))], min(merits)
        print(f"\r{strategy.countevals:5d} evaluations, {start:.2f} -> {least:.2f}", end="", flush=True)
    last = strategy.result.xfavorite
    if errors(values(numbers, last)).mean(axis=0).sum() < least:
        best = last
    print()
    return values(numbers, best), int(strategy.countevals) + 2


def kept(path: Path, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What a file has, or what is made and written to it; a benchmark of an hour goes on where it was stopped."""
    if path.exists():
        return dict(json.loads(path.read_text()))
    began, busy = time.perf_counter(), time.process_time()
    found = make()
    found |= {"seconds": time.perf_counter() - began, "processor_seconds": time.process_time() - busy}
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(found, indent=1))
    partial.rename(path)
    return found
