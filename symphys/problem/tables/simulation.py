"""The [simulation] table."""

from __future__ import annotations

from math import ceil, floor

from symphys.problem.model import Simulation
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.physics import SimulationTable

MAX_STEPS = 1_000_000
WHOLE = 1e-9
"""Relative slack for a whole number of steps."""


def read_simulation(table: SimulationTable, faults: Faults) -> Simulation:
    """The simulation; notes a step that does not fit."""
    check_steps(table.duration, table.dt, faults)
    return Simulation(**{**table.model_dump(), "smoothing": tuple(table.smoothing)})


def check_steps(duration: float, dt: float, faults: Faults, place: Place = ("simulation", "dt")) -> None:
    """The duration must be a whole number of steps, and not too many."""
    ratio = duration / dt
    if dt > duration:
        faults.add(place, f"the step {dt:g} s is longer than the duration {duration:g} s")
    elif ratio > MAX_STEPS * (1 + WHOLE):
        least = duration / MAX_STEPS
        faults.add(place, f"{ratio:.4g} steps are too many, {MAX_STEPS} are allowed; take dt = {least:.6g} or more")
    elif abs(ratio - round(ratio)) > WHOLE * ratio:
        below, above = floor(ratio), ceil(ratio)
        faults.add(
            place,
            f"duration / dt = {ratio:.10g} is no whole number of steps; nearest: dt = {duration / below:.10g} "
            f"({below} steps) or {duration / above:.10g} ({above} steps), "
            f"or duration = {below * dt:.10g} or {above * dt:.10g}",
        )


def check_moment(at: str | float, simulation: Simulation, place: tuple[str | int, ...], faults: Faults) -> None:
    """A time must be that of a step."""
    if isinstance(at, str):
        return
    if not 0 <= at <= simulation.duration:
        faults.add(
            place, f"the time {at:g} s is outside the simulation, which goes from 0 to {simulation.duration:g} s"
        )
        return
    step = at / simulation.dt
    if abs(step - round(step)) > 1e-6:
        near = [floor(step) * simulation.dt, ceil(step) * simulation.dt]
        faults.add(place, f"the time {at:g} s falls between two steps; nearest: {near[0]:.10g} or {near[1]:.10g} s")
