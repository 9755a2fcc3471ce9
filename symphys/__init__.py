"""Trajectory optimisation through contact.

Rigid bodies with contact as casadi expressions, problem files about them, and what solves and reports them. The names
below are the public surface; solvers are in ``symphys.solvers``, runs in ``symphys.runs``, reports in
``symphys.report``. Everything is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from symphys.dynamics.functions import step_function
    from symphys.dynamics.horizon import roll_out
    from symphys.errors import ProblemError, SymphysError
    from symphys.model.shapes import Box, Capsule, Fixture, Plane, Sphere, Terrain
    from symphys.model.state_layout import Layout, initial_state
    from symphys.model.world import Body, Law, Scheme, World, make_world
    from symphys.problem import Problem, load_problem
    from symphys.shooting import ShootingProblem
    from symphys.trajectory import Trajectory
    from symphys.transcription import Transcription
    from symphys.transcription.transcribe import transcribe

__version__ = "0.1.0"

__all__ = [
    "Body",
    "Box",
    "Capsule",
    "Fixture",
    "Law",
    "Layout",
    "Plane",
    "Problem",
    "ProblemError",
    "Scheme",
    "ShootingProblem",
    "Sphere",
    "SymphysError",
    "Terrain",
    "Trajectory",
    "Transcription",
    "World",
    "__version__",
    "initial_state",
    "load_problem",
    "make_world",
    "roll_out",
    "step_function",
    "transcribe",
]

_HOMES = {
    "errors": ("ProblemError", "SymphysError"),
    "problem": ("Problem", "load_problem"),
    "dynamics.horizon": ("roll_out",),
    "shooting": ("ShootingProblem",),
    "model.state_layout": ("Layout", "initial_state"),
    "dynamics.functions": ("step_function",),
    "trajectory": ("Trajectory",),
    "transcription": ("Transcription", "transcribe"),
    "model.shapes": ("Box", "Capsule", "Fixture", "Plane", "Sphere", "Terrain"),
    "model.world": ("Body", "Law", "Scheme", "World", "make_world"),
}


def __getattr__(name: str) -> object:
    """A public name, from the room where it lives."""
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"symphys.{home}"), name)
    raise AttributeError(f"module 'symphys' has no attribute {name!r}")
