"""Optimisers: each takes a shooting problem and returns an outcome; none depends on the physics.

``SOLVERS`` lists them; ``solver(name)`` finds one. All follow one interface, ``Solver``, and stop at the first
evaluated point that meets every target, unless the problem says otherwise.
"""

from __future__ import annotations

if __name__ != "symphys.solvers":
    raise ImportError(f"this package installs as symphys.solvers: import that, not {__name__!r}")

from collections import UserDict
from difflib import get_close_matches
from importlib import import_module
from typing import TYPE_CHECKING, Any

from symphys.errors import SymphysError
from symphys.later import later
from symphys.solvers.core.checkpoint import OUTCOME, plain_outcome, revived_outcome
from symphys.solvers.core.interface import Solver
from symphys.solvers.core.multi_start import solve_multi_start
from symphys.solvers.core.options import recorded_options
from symphys.solvers.core.outcome import Counts, Keep, Monitor, Outcome, StageResult, Status, TraceRow

if TYPE_CHECKING:
    from symphys.solvers.methods.cma_es import CmaOptions
    from symphys.solvers.methods.evolution import EvolutionOptions
    from symphys.solvers.methods.gradient import GradientOptions
    from symphys.solvers.methods.ilqr import IlqrOptions
    from symphys.solvers.methods.ipopt import IpoptOptions
    from symphys.solvers.methods.least_squares import LeastSquaresOptions
    from symphys.solvers.methods.multiple_shooting import MultipleShootingOptions
    from symphys.solvers.methods.stochastic import StochasticOptions

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


class Catalogue(UserDict[str, Any]):
    """Solvers by name. The module of each, in ``methods``, is imported when it is first asked for."""

    def __getitem__(self, name: str) -> Solver[Any]:
        """Return the solver called ``name``; its module has it under this name in capitals."""
        if isinstance(self.data[name], str):
            self.data[name] = getattr(import_module(f"{__name__}.methods.{self.data[name]}"), name.upper())
        found: Solver[Any] = self.data[name]
        return found


MODULES = {
    "gradient": "gradient",
    "least_squares": "least_squares",
    "ipopt": "ipopt",
    "ilqr": "ilqr",
    "multiple_shooting": "multiple_shooting",
    "cma": "cma_es",
    "stochastic": "stochastic",
    "evolution": "evolution",
    "race": "race",
}
"""The module of each solver in ``methods``."""
SOLVERS = Catalogue(MODULES)
OPTIONS = {f"methods.{home}": (f"{name.title().replace('_', '')}Options",) for name, home in MODULES.items()}
__getattr__ = later(__name__, OPTIONS)
solve_together = solve_multi_start
"""Deprecated: the old name of ``solve_multi_start``."""


def solver(name: str) -> Solver[Any]:
    """Return the solver called ``name``; raise SymphysError, which names the nearest ones, if there is none."""
    if name not in SOLVERS:
        close = get_close_matches(name.lower(), SOLVERS)
        guess = f"did you mean {close[0]!r}? " if close else ""
        raise SymphysError(f"there is no solver {name!r}; {guess}valid: {', '.join(SOLVERS)}")
    return SOLVERS[name]
