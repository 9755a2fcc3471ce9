"""Public names of older versions: each still works, and a DeprecationWarning names what replaces it."""

from __future__ import annotations

import warnings
from importlib import import_module
from types import ModuleType
from typing import Any

WORLDS = (
    "AffineMotor", "BallJoint", "Body", "Box", "Capsule", "Convex", "Cylinder", "Ellipsoid", "FixedJoint", "Fixture",
    "Heightfield", "Hinge", "Law", "Layout", "Plane", "Scheme", "Servo", "Slider", "Sphere", "Spring", "Terrain",
    "TorqueMotor", "UniversalJoint", "VelocityMotor", "World", "initial_state", "make_world",
)  # fmt: skip
"""Names that are in ``symphys.model`` alone."""
NAMES = {name: ("symphys.model", f"symphys.model.{name}") for name in WORLDS} | {
    "ShootingProblem": ("symphys.shooting", "symphys.shooting.ShootingProblem"),
    "Transcription": ("symphys.transcription", "symphys.CompiledRollout"),
    "load_problem": ("symphys.problem", "symphys.load"),
    "roll_out": ("symphys.dynamics.functions", "symphys.step_function and its mapaccum"),
    "transcribe": ("symphys.transcription", "symphys.compile"),
}
"""The module that has each name, and its replacement."""
CALLS = {"export": "symphys.export_problem", "report": "symphys.write_report", "results": "symphys.results.runs"}
"""Packages that were called as functions, ``symphys.report(folder)``, and the function of each."""


def deprecated(name: str) -> Any:
    """Return what ``symphys.NAME`` was, with a warning at the line that asks for it."""
    module, replacement = NAMES[name]
    warnings.warn(f"symphys.{name} is deprecated; use {replacement}", DeprecationWarning, stacklevel=3)
    return getattr(import_module(module), name)


class CalledPackage(ModuleType):
    """A package that can still be called as a function."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the function that replaces it, with a warning."""
        replacement = CALLS[self.__name__.rpartition(".")[2]]
        warnings.warn(f"{self.__name__}(...) is deprecated; use {replacement}", DeprecationWarning, stacklevel=2)
        module, _, function = replacement.rpartition(".")
        return getattr(import_module(module), function)(*args, **kwargs)


class Facade(ModuleType):
    """The module ``symphys``, in which the import system binds each of its packages."""

    def __setattr__(self, name: str, value: object) -> None:
        """Let packages of ``CALLS`` be called."""
        if name in CALLS and type(value) is ModuleType:
            value.__class__ = CalledPackage
        super().__setattr__(name, value)
