"""Trajectory optimisation through contact.

    import symphys
    solution = symphys.solve("ball_throw")

``load``, ``solve``, ``simulate``, ``compile`` and ``read`` are the front door; the classes below build worlds. What the
command line does is here in the same words: ``new``, ``show``, ``check``, ``solve_all``, ``schema`` and ``cache``, and
``report``, ``results``, ``export`` and ``doctor``, which are rooms that can be called. Shipped problems are in
``symphys.problems.catalogue()``, solvers in ``symphys.solvers.SOLVERS``. Everything is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from symphys.version import __version__

if TYPE_CHECKING:
    from symphys.api.checking import Checked, check
    from symphys.api.compiled import CompiledRollout, compile
    from symphys.api.robots.robot import Robot, load_robot
    from symphys.api.showing import show
    from symphys.api.simulation import simulate
    from symphys.api.solution import Solution, read
    from symphys.api.solving import solve
    from symphys.api.stepping import CompiledStep, compile_step
    from symphys.api.sweeping import solve_all
    from symphys.api.tools import cache, new, schema
    from symphys.doctor import doctor
    from symphys.dynamics.functions import step_function
    from symphys.dynamics.horizon import roll_out
    from symphys.errors import ProblemError, SymphysError
    from symphys.export.writing import export
    from symphys.model.body import Body
    from symphys.model.heightfield import Heightfield
    from symphys.model.joints import (
        AffineMotor,
        BallJoint,
        FixedJoint,
        HelicalJoint,
        Hinge,
        Servo,
        Slider,
        Spring,
        TorqueMotor,
        UniversalJoint,
        VelocityMotor,
    )
    from symphys.model.shapes import Box, Capsule, Convex, Cylinder, Ellipsoid, Fixture, Plane, Sphere, Terrain
    from symphys.model.state_layout import Layout, initial_state
    from symphys.model.world import Law, Scheme, World, make_world
    from symphys.mpc.controller import Controller
    from symphys.prediction.identifying import identify
    from symphys.problem import Problem, load_problem
    from symphys.problem.loading import load
    from symphys.report.making.batch import report
    from symphys.results import results
    from symphys.shooting import ShootingProblem
    from symphys.trajectory import Trajectory
    from symphys.transcription import Transcription
    from symphys.transcription.transcribe import transcribe

__all__ = [
    "AffineMotor",
    "BallJoint",
    "Body",
    "Box",
    "Capsule",
    "Checked",
    "CompiledRollout",
    "CompiledStep",
    "Controller",
    "Convex",
    "Cylinder",
    "Ellipsoid",
    "FixedJoint",
    "Fixture",
    "Heightfield",
    "HelicalJoint",
    "Hinge",
    "Law",
    "Layout",
    "Plane",
    "Problem",
    "ProblemError",
    "Robot",
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
    "cache",
    "check",
    "compile",
    "compile_step",
    "doctor",
    "export",
    "identify",
    "initial_state",
    "load",
    "load_problem",
    "load_robot",
    "make_world",
    "new",
    "read",
    "report",
    "results",
    "roll_out",
    "schema",
    "show",
    "simulate",
    "solve",
    "solve_all",
    "step_function",
    "transcribe",
]

_HOMES = {
    "api.checking": ("Checked", "check"),
    "api.showing": ("show",),
    "api.sweeping": ("solve_all",),
    "api.tools": ("cache", "new", "schema"),
    "api.compiled": ("CompiledRollout", "compile"),
    "api.robots.robot": ("Robot", "load_robot"),
    "prediction.identifying": ("identify",),
    "problem.loading": ("load",),
    "api.simulation": ("simulate",),
    "api.solution": ("Solution", "read"),
    "api.solving": ("solve",),
    "api.stepping": ("CompiledStep", "compile_step"),
    "errors": ("ProblemError", "SymphysError"),
    "problem": ("Problem", "load_problem"),
    "dynamics.horizon": ("roll_out",),
    "shooting": ("ShootingProblem",),
    "model.state_layout": ("Layout", "initial_state"),
    "dynamics.functions": ("step_function",),
    "trajectory": ("Trajectory",),
    "transcription": ("Transcription", "transcribe"),
    "model.shapes": ("Box", "Capsule", "Convex", "Cylinder", "Ellipsoid", "Fixture", "Plane", "Sphere", "Terrain"),
    "model.body": ("Body",),
    "model.heightfield": ("Heightfield",),
    "model.joints": (
        "BallJoint",
        "FixedJoint",
        "HelicalJoint",
        "Hinge",
        "Slider",
        "UniversalJoint",
        "Servo",
        "Spring",
        "TorqueMotor",
        "VelocityMotor",
        "AffineMotor",
    ),
    "mpc.controller": ("Controller",),
    "model.world": ("Law", "Scheme", "World", "make_world"),
}
_ROOMS = ("doctor", "export", "problems", "report", "results", "solvers")
"""Rooms that need no import of their own; ``doctor``, ``export``, ``report`` and ``results`` can be called."""

_EXTRAS = ("env", "jax", "torch")
"""Modules that need an extra."""


def __getattr__(name: str) -> object:
    """A public name, from the room where it lives."""
    if name in _ROOMS or name in _EXTRAS:
        return import_module(f"symphys.{name}")
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"symphys.{home}"), name)
    raise AttributeError(f"module 'symphys' has no attribute {name!r}")


def __dir__() -> list[str]:
    """The public names."""
    return sorted(__all__)
