"""Trajectory optimisation through contact.

    import symphys
    solution = symphys.solve("ball_throw")

``load``, ``solve``, ``simulate``, ``compile`` and ``read`` are the front door; the other functions do what the command
line does. ``symphys.model`` builds worlds and ``symphys.results`` finds runs. ``symphys.problems.catalogue()`` lists
the shipped problems, ``symphys.solvers.SOLVERS`` the solvers. Three modules need an extra each: ``symphys.torch``,
``symphys.jax`` and ``symphys.env``. Everything is imported when it is first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from symphys.deprecated import NAMES, Facade, deprecated
from symphys.version import __version__

if TYPE_CHECKING:
    from symphys import model, problems, results, solvers
    from symphys.api.checking import Checked, check
    from symphys.api.compiled import CompiledRollout, CompiledStep, compile, compile_step
    from symphys.api.robot import Robot, load_robot
    from symphys.api.showing import show
    from symphys.api.simulation import simulate
    from symphys.api.solution import Solution, read
    from symphys.api.solving import solve
    from symphys.api.sweeping import solve_all
    from symphys.api.tools import cache, new, schema
    from symphys.dynamics.functions import step_function
    from symphys.errors import ProblemError, SymphysError
    from symphys.export.writing import export_problem
    from symphys.machine import doctor
    from symphys.mpc.controller import Controller
    from symphys.prediction.identifying import identify
    from symphys.problem import Problem
    from symphys.problem.problem import load
    from symphys.report.making.batch import write_report
    from symphys.trajectory import Trajectory

__all__ = [
    "Checked",
    "CompiledRollout",
    "CompiledStep",
    "Controller",
    "Problem",
    "ProblemError",
    "Robot",
    "Solution",
    "SymphysError",
    "Trajectory",
    "__version__",
    "cache",
    "check",
    "compile",
    "compile_step",
    "doctor",
    "export_problem",
    "identify",
    "load",
    "load_robot",
    "model",
    "new",
    "problems",
    "read",
    "results",
    "schema",
    "show",
    "simulate",
    "solve",
    "solve_all",
    "solvers",
    "step_function",
    "write_report",
]

_HOMES = {
    "api.checking": ("Checked", "check"),
    "api.compiled": ("CompiledRollout", "CompiledStep", "compile", "compile_step"),
    "api.robot": ("Robot", "load_robot"),
    "api.showing": ("show",),
    "api.simulation": ("simulate",),
    "api.solution": ("Solution", "read"),
    "api.solving": ("solve",),
    "api.sweeping": ("solve_all",),
    "api.tools": ("cache", "new", "schema"),
    "dynamics.functions": ("step_function",),
    "errors": ("ProblemError", "SymphysError"),
    "export.writing": ("export_problem",),
    "machine": ("doctor",),
    "mpc.controller": ("Controller",),
    "prediction.identifying": ("identify",),
    "problem": ("Problem",),
    "problem.problem": ("load",),
    "report.making.batch": ("write_report",),
    "trajectory": ("Trajectory",),
}
_PACKAGES = ("env", "export", "jax", "model", "problems", "report", "results", "solvers", "torch")
"""Packages and modules that need no import statement; ``env``, ``jax`` and ``torch`` need an extra."""

sys.modules[__name__].__class__ = Facade


def __getattr__(name: str) -> Any:
    """Return a public name from the module where it lives, or a deprecated one."""
    if name in _PACKAGES:
        return import_module(f"symphys.{name}")
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"symphys.{home}"), name)
    if name in NAMES:
        return deprecated(name)
    raise AttributeError(f"module 'symphys' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)
