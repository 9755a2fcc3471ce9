"""Trajectory optimisation through contact.

    import symphys
    solution = symphys.solve("ball_throw")

``load``, ``solve``, ``simulate``, ``compile`` and ``read`` are the front door; the classes below build worlds. Solvers
are in ``symphys.solvers``, reports in ``symphys.report``. Everything is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from symphys.version import __version__

if TYPE_CHECKING:
    from symphys.api.compiled import CompiledRollout, compile
    from symphys.api.loading import load
    from symphys.api.simulation import simulate
    from symphys.api.solution import Solution, read
    from symphys.api.solving import solve
    from symphys.dynamics.functions import step_function
    from symphys.dynamics.horizon import roll_out
    from symphys.errors import ProblemError, SymphysError
    from symphys.model.body import Body
    from symphys.model.heightfield import Heightfield
    from symphys.model.joints import (
        BallJoint,
        FixedJoint,
        Hinge,
        Servo,
        Slider,
        Spring,
        TorqueMotor,
        UniversalJoint,
        VelocityMotor,
    )
    from symphys.model.shapes import Box, Capsule, Fixture, Plane, Sphere, Terrain
    from symphys.model.state_layout import Layout, initial_state
    from symphys.model.world import Law, Scheme, World, make_world
    from symphys.problem import Problem, load_problem
    from symphys.shooting import ShootingProblem
    from symphys.trajectory import Trajectory
    from symphys.transcription import Transcription
    from symphys.transcription.transcribe import transcribe

__all__ = [
    "BallJoint",
    "Body",
    "Box",
    "Capsule",
    "CompiledRollout",
    "FixedJoint",
    "Fixture",
    "Heightfield",
    "Hinge",
    "Law",
    "Layout",
    "Plane",
    "Problem",
    "ProblemError",
    "Scheme",
    "Servo",
    "ShootingProblem",
    "Slider",
    "Solution",
    "Sphere",
    "Spring",
    "SymphysError",
    "Terrain",
    "TorqueMotor",
    "Trajectory",
    "Transcription",
    "UniversalJoint",
    "VelocityMotor",
    "World",
    "__version__",
    "compile",
    "initial_state",
    "load",
    "load_problem",
    "make_world",
    "read",
    "roll_out",
    "simulate",
    "solve",
    "step_function",
    "transcribe",
]

_HOMES = {
    "api.compiled": ("CompiledRollout", "compile"),
    "api.loading": ("load",),
    "api.simulation": ("simulate",),
    "api.solution": ("Solution", "read"),
    "api.solving": ("solve",),
    "errors": ("ProblemError", "SymphysError"),
    "problem": ("Problem", "load_problem"),
    "dynamics.horizon": ("roll_out",),
    "shooting": ("ShootingProblem",),
    "model.state_layout": ("Layout", "initial_state"),
    "dynamics.functions": ("step_function",),
    "trajectory": ("Trajectory",),
    "transcription": ("Transcription", "transcribe"),
    "model.shapes": ("Box", "Capsule", "Fixture", "Plane", "Sphere", "Terrain"),
    "model.body": ("Body",),
    "model.heightfield": ("Heightfield",),
    "model.joints": (
        "BallJoint",
        "FixedJoint",
        "Hinge",
        "Slider",
        "UniversalJoint",
        "Servo",
        "Spring",
        "TorqueMotor",
        "VelocityMotor",
    ),
    "model.world": ("Law", "Scheme", "World", "make_world"),
}


def __getattr__(name: str) -> object:
    """A public name, from the room where it lives."""
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"symphys.{home}"), name)
    raise AttributeError(f"module 'symphys' has no attribute {name!r}")


def __dir__() -> list[str]:
    """The public names."""
    return sorted(__all__)
