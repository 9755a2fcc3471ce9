"""Lengths that were written in millimetres or centimetres, told by their size."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.recordings.columns import RecordingFault
from symphys.types import Array

TOO_LARGE = 30.0
"""Lengths that exceed what the world has by this factor are in another unit."""
NEAR = 3.0
"""How far a ratio of lengths may be off 100 or 1000. That to an upper bound is less than the factor of the unit."""
SOON = 0.05
"""Share of the recording in which its first sample is compared with the start of the simulation."""
LEAST = 1e-3
"""[m] of the start; what is smaller has no ratio."""


def longest(parametric: ParametricWorld, initial: Mapping[str, Array], duration: float) -> float:
    """[m]: a length that nothing in the world exceeds by far: sizes, places, and the way of a fall in that time."""
    world = parametric.world({})
    extents = [float(shape.extent) for body in world.bodies for shape in body.shapes]
    places = [float(np.linalg.norm(value)) for name, value in initial.items() if name.endswith(".position")]
    speeds = [float(np.linalg.norm(value)) for name, value in initial.items() if name.endswith(".velocity")]
    fall = float(np.linalg.norm(parametric.gravity)) * duration**2 / 2
    return max([*extents, *places, LEAST]) + max([*speeds, 0.0]) * duration + fall


def check_lengths(
    values: Array, at_start: Array | None, time: Array, world_length: float, where: str, key: tuple[str | int, ...]
) -> None:
    """RecordingFault where lengths are 100 or 1000 times those of the world.

    Args:
        values: (n, m) [m] as they were read.
        at_start: (m,) [m] of the simulation; None where the start is not given by the file.
        time: (n,) [s].
        world_length: see ``longest``.
        where: for messages.
        key: that has the unit.
    """
    size = np.linalg.norm(values, axis=1)
    known = size[np.isfinite(size)]
    if not known.size:
        return
    ratio, limit = float(np.median(known)) / world_length, 100.0
    compared = f"lengths in this world, up to about {world_length:.3g} m"
    if at_start is not None and np.isfinite(size[0]) and time[0] <= SOON * time[-1]:
        begin = float(np.linalg.norm(at_start))
        if begin > LEAST and size[0] / begin > TOO_LARGE:
            ratio, limit, compared = size[0] / begin, 100 * NEAR, f"the start of the simulation, {begin:.3g} m"
    if ratio <= TOO_LARGE:
        return
    factor, unit = (0.001, "mm") if ratio > limit else (0.01, "cm")
    name = "millimetres" if unit == "mm" else "centimetres"
    text = f"{where}: the numbers are {ratio:.0f} times {compared}; metres are wanted"
    raise RecordingFault(key, f'{text}; are these {name}? unit = "{unit}", or factor = {factor:g}')
