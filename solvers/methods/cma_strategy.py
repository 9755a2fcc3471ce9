"""pycma's evolution strategy over the free variables: options, ask and tell, replay."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.options import nearest, refuse
from symphys.types import Array

RESERVED = {
    "bounds": "the bounds of the problem's variables are used",
    "fixed_variables": "a variable is held by equal bounds",
    "seed": "the seed of the solve is used",
    "randn": "the seed of the solve is used",
    "popsize": "use population",
    "maxfevals": "use evaluations",
    "signals_filename": "no files are read",
    "verbose": "pycma is kept silent, see the trace",
}
"""Options of pycma that are not passed on, each with the reason."""
TEXT_OPTIONS = {"BoundaryHandler": ("BoundTransform", "BoundPenalty")}
"""The options that take a name of pycma's, and which. It evaluates any other text as Python: so none can be allowed."""
SILENT_OPTIONS = {"verbose": -9, "verb_log": 0, "verb_disp": 0, "signals_filename": "", "seed": math.nan}
PLATEAU_CRITERION = "tolflatfitness"
"""The criterion that ends a search on a plateau: more generations in a row without a difference than this option."""
DEFAULT_OPTIONS = {PLATEAU_CRITERION: 50}
"""Defaults that differ from pycma's own."""
MAX_FULL_COVARIANCE = 2000
"""Largest number of variables with a full covariance; beyond it is diagonal (Ros, Hansen 2008)."""
PLATEAU_CRITERIA = {"tolfun", "tolfunhist", "tolfunrel", "flat fitness"}
"""Criteria of pycma that take a plateau for convergence."""
REPLAY_DIFFERS = "this checkpoint leads elsewhere with the present versions of pycma and numpy: start afresh without it"


@dataclass(frozen=True)
class CmaState:
    """The state between two generations, from which pycma's strategy is replayed.

    Attributes:
        start: (n,) z where the strategy began.
        merits: (population,) of every generation so far, in the order in which its candidates were asked for.
        mean, sigma: where that led, to compare; mean (free,) as pycma stores it.
    """

    start: Array
    merits: tuple[tuple[float, ...], ...]
    mean: Array
    sigma: float


class PycmaStrategy:
    """pycma's CMAEvolutionStrategy in x = z / scale, without variables whose bounds are equal."""

    def __init__(
        self,
        evaluator: CountingEvaluator,
        start: Array,
        sigma: float,
        population: int,
        options: Mapping[str, Any],
        stream: np.random.Generator,
    ) -> None:
        """Begin at ``start`` (n,) with the standard deviation ``sigma``; SymphysError for invalid options."""
        cma = load()
        check(options, cma.CMAOptions.defaults())
        self.stream = stream
        self.start, self.scale, self.free = start, evaluator.scale, evaluator.lower < evaluator.upper
        bounds = [sides(bound / evaluator.scale, self.free) for bound in (evaluator.lower, evaluator.upper)]
        named = {name: getattr(cma, options[name]) for name in TEXT_OPTIONS if name in options}
        diagonal = {"CMA_diagonal": True} if self.free.sum() > MAX_FULL_COVARIANCE else {}
        own = {
            **DEFAULT_OPTIONS,
            **diagonal,
            **options,
            **named,
            **SILENT_OPTIONS,
            "bounds": bounds,
            "randn": self.draw,
        }
        if population:
            own["popsize"] = population
        with pycma():
            kind = single(cma) if self.free.sum() == 1 else cma.CMAEvolutionStrategy
            self.es = kind((start / evaluator.scale)[self.free], sigma, own)
        self.merits: tuple[tuple[float, ...], ...] = ()
        self._reasons: set[str] | None = None

    def draw(self, *shape: int) -> Array:
        """Draw standard normals."""
        return self.stream.standard_normal(shape)

    def ask(self) -> list[Array]:
        """Return a generation of z (n,)."""
        self.stopped()  # pycma counts the generations of a plateau there
        with pycma():
            self.asked = self.es.ask()
        return [self.full(x) for x in self.asked]

    def tell(self, merits: tuple[float, ...]) -> None:
        """Update the strategy with the merits of the generation; inf ranks last."""
        with pycma():
            self.es.tell(self.asked, list(merits))
        self.es.sm.randn = self.draw  # a sampler that pycma makes on its way would draw from numpy's global stream
        self.merits, self._reasons = (*self.merits, merits), None

    def stopped(self) -> set[str]:
        """Return which of pycma's own criteria hold; evaluated once a generation."""
        if self._reasons is None:
            with pycma():
                reasons = set(self.es.stop())
            plateau = bool(self.merits) and min(self.merits[-1]) == max(self.merits[-1])
            self._reasons = reasons - PLATEAU_CRITERIA if plateau else reasons
        return self._reasons

    def state(self) -> CmaState:
        """Return the data that a replay needs."""
        return CmaState(self.start, self.merits, self.es.mean.copy(), self.sigma)

    def replay(self, state: CmaState) -> None:
        """Replay the generations of a state; SymphysError if the result differs."""
        for merits in state.merits:
            self.ask()
            self.tell(merits)
        same = self.es.mean.shape == state.mean.shape and np.allclose(self.es.mean, state.mean, rtol=1e-6)
        if not same or not math.isclose(self.sigma, state.sigma, rel_tol=1e-6):
            raise SymphysError(REPLAY_DIFFERS)
        self.merits = state.merits

    @property
    def sigma(self) -> float:
        """The present step size."""
        return float(self.es.sigma)

    @property
    def centre(self) -> Array:
        """Return z (n,) of the mean."""
        return self.full(self.es.result.xfavorite)

    def full(self, x: Array) -> Array:
        """Return z (n,) of a candidate (free,)."""
        z = self.start.copy()
        z[self.free] = np.asarray(x) * self.scale[self.free]
        return z


def load() -> Any:
    """Import and return pycma, whose first import takes a second or two."""
    import cma

    return cma


def single(cma: Any) -> Any:
    """Return pycma's strategy class for one variable.

    Where a standard deviation leaves its limits, as in narrow bounds, pycma (4.5) changes the scaling of that variable,
    which it refuses to do where there is one only: it takes a scaling of length 1 for one that has no length yet.
    """

    def limited(strategy: Any, *arguments: Any, **named: Any) -> Any:
        strategy.sigma_vec.set_i = partial(rescale, strategy.sigma_vec)
        return cma.CMAEvolutionStrategy._stds_into_limits(strategy, *arguments, **named)

    return type("Single", (cma.CMAEvolutionStrategy,), {"_stds_into_limits": limited})


def rescale(scaling: Any, index: int, value: float) -> None:
    """Do what pycma's ``DiagonalDecoding.set_i`` does."""
    scaling.is_identity = False
    scaling.scaling[index] = value


def check(options: Mapping[str, Any], defaults: Mapping[str, Any]) -> None:
    """Raise SymphysError for the first option that pycma does not have, or that cannot be passed on."""
    for name, value in options.items():
        if name in RESERVED or name.startswith("verb_"):
            raise refuse("cma", name, f"cannot be set: {RESERVED.get(name, RESERVED['verbose'])}")
        if name not in defaults:
            raise refuse("cma", name, f"pycma has no such option; {nearest(name, defaults)}")
        if not plain(value) and value not in TEXT_OPTIONS.get(name, ()):
            valid = " or ".join(TEXT_OPTIONS.get(name, ("numbers", "true", "false", "lists of these")))
            raise refuse("cma", name, f"valid are {valid}, not {value!r}")


def plain(value: Any) -> bool:
    """Whether a value is a number, a truth value or a list of these, which pycma does not evaluate."""
    if isinstance(value, list | tuple):
        return all(plain(each) for each in value)
    return isinstance(value, bool | int | float)


def sides(bound: Array, free: NDArray[np.bool_]) -> list[float | None]:
    """Return one side of the bounds in pycma's form: None where there is none."""
    return [float(value) if math.isfinite(value) else None for value in bound[free]]


@contextmanager
def pycma() -> Iterator[None]:
    """Suppress the warnings of pycma and numpy about infinite merits; turn its errors into RuntimeError."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            yield
        except (ValueError, TypeError, AssertionError, AttributeError, IndexError) as error:
            raise RuntimeError(f"pycma: {error}") from error
