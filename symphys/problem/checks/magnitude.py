"""How light and how heavy a body may be: beyond these, inverses and products of masses leave the range of doubles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symphys.model.shapes.inertia import specific
from symphys.problem.parametric.parts import ParametricBody
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.physics import BodyTable

MASSES = (1e-100, 1e100)
"""[kg]"""
MOMENTS = (1e-140, 1e140)
"""[kg m^2], of the principal moments of inertia."""


def check_magnitudes(place: tuple[str, int], table: BodyTable, body: ParametricBody, faults: Faults) -> None:
    """Mass and inertia, given or following from density and shape, must be numbers that can be computed with."""
    if not within(body.mass, MASSES):
        key, origin = ("mass", "") if table.mass is not None else ("density", "the mass that follows from it ")
        faults.add((*place, key), f"{origin}must be {spelled(MASSES)} kg, not {body.mass:g}")
        return
    key, origin = ("inertia", "the principal moments ")
    if table.inertia is None:
        key, origin = ("shape", "the principal moments of the inertia that follows from it ")
    moments = principal(body)
    if not within(moments, MOMENTS):
        listed = ", ".join(f"{moment:g}" for moment in moments)
        faults.add((*place, key), f"{origin}must be {spelled(MOMENTS)} kg m^2, not {listed}")


def check_mass(where: Place, mass: float, faults: Faults) -> None:
    """A mass that a variable begins with."""
    if not within(mass, MASSES):
        faults.add(where, f"a mass must be {spelled(MASSES)} kg, not {mass:g}")


def principal(body: ParametricBody) -> NDArray[np.float64]:
    """(3,) [kg m^2]; not finite where the tensor is not."""
    own = body.inertia is not None
    tensor = np.asarray(body.inertia if own else specific(body.shapes), float)
    if tensor.ndim == 2 and np.isfinite(tensor).all():
        tensor = np.linalg.eigvalsh(tensor)
    elif tensor.ndim == 2:
        tensor = np.diagonal(tensor)
    with np.errstate(over="ignore", under="ignore"):
        return np.asarray(np.broadcast_to(tensor, 3) * (1.0 if own else body.mass))


def within(values: float | Sequence[float] | NDArray[np.float64], limits: tuple[float, float]) -> bool:
    """Whether all of them are; NaN is not."""
    given = np.asarray(values, float)
    return bool(np.all((given >= limits[0]) & (given <= limits[1])))


def spelled(limits: tuple[float, float]) -> str:
    """``from 1e-100 to 1e+100``."""
    return f"from {limits[0]:g} to {limits[1]:g}"
