"""Optimisers: each takes a shooting problem and returns an outcome; none depends on the physics.

``SOLVERS`` lists them; ``solver(name)`` finds one. All follow one interface, ``Solver``, and stop at the first
evaluated point that meets every target, unless the problem says otherwise.
"""

from __future__ import annotations

if __name__ != "symphys.solvers":
    raise ImportError(f"this package installs as symphys.solvers: import that, not {__name__!r}")

from difflib import get_close_matches
from typing import Any

from symphys.errors import SymphysError
from symphys.solvers.core.checkpoint import OUTCOME, plain_outcome, revived_outcome
from symphys.solvers.core.interface import Solver
from symphys.solvers.core.multi_start import solve_multi_start
from symphys.solvers.core.options import recorded_options
from symphys.solvers.core.outcome import Counts, Keep, Monitor, Outcome, StageResult, Status, TraceRow
from symphys.solvers.methods.cma_es import CMA, CmaOptions
from symphys.solvers.methods.evolution import EVOLUTION, EvolutionOptions
from symphys.solvers.methods.gradient import GRADIENT, GradientOptions
from symphys.solvers.methods.ilqr import ILQR, IlqrOptions
from symphys.solvers.methods.ipopt import IPOPT, IpoptOptions
from symphys.solvers.methods.least_squares import LEAST_SQUARES, LeastSquaresOptions
from symphys.solvers.methods.multiple_shooting import MULTIPLE_SHOOTING, MultipleShootingOptions
from symphys.solvers.methods.stochastic import STOCHASTIC, StochasticOptions

__all__ = [
    "OUTCOME",
    "SOLVERS",
    "CmaOptions",
    "Counts",
    "EvolutionOptions",
    "GradientOptions",
    "IlqrOptions",
    "IpoptOptions",
    "Keep",
    "LeastSquaresOptions",
    "Monitor",
    "MultipleShootingOptions",
    "Outcome",
    "Solver",
    "StageResult",
    "Status",
    "StochasticOptions",
    "TraceRow",
    "plain_outcome",
    "recorded_options",
    "revived_outcome",
    "solve_multi_start",
    "solver",
]

SOLVERS: dict[str, Solver[Any]] = {
    each.name: each for each in (GRADIENT, LEAST_SQUARES, IPOPT, ILQR, MULTIPLE_SHOOTING, CMA, STOCHASTIC, EVOLUTION)
}
solve_together = solve_multi_start
"""Deprecated: the old name of ``solve_multi_start``."""


def solver(name: str) -> Solver[Any]:
    """Return the solver called ``name``; raise SymphysError, which names the nearest ones, if there is none."""
    if name not in SOLVERS:
        close = get_close_matches(name.lower(), SOLVERS)
        guess = f"did you mean {close[0]!r}? " if close else ""
        raise SymphysError(f"there is no solver {name!r}; {guess}valid: {', '.join(SOLVERS)}")
    return SOLVERS[name]
