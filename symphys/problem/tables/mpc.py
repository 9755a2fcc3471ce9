"""The [mpc] table: a receding horizon."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from symphys.problem.model import Simulation
from symphys.problem.reading.faults import Faults
from symphys.problem.receding_horizon import PlantSettings, RecedingHorizon
from symphys.problem.schema import Document
from symphys.problem.schema.mpc import MpcTable, PlantTable
from symphys.problem.tables.simulation import check_steps, read_simulation

FIVE = 5
"""Durations of the problem that the closed loop lasts, unless the file says otherwise."""


def read_time(document: Document, faults: Faults) -> tuple[Simulation, RecedingHorizon | None]:
    """How time passes, in the problem and in the horizon of its controller."""
    simulation = read_simulation(document.simulation, faults)
    return simulation, read_mpc(document.mpc, simulation, faults)


def read_mpc(table: MpcTable | None, simulation: Simulation, faults: Faults) -> RecedingHorizon | None:
    """The receding horizon; None without the table. Notes a horizon that is no whole number of steps."""
    if table is None:
        return None
    horizon = simulation.duration if table.horizon is None else table.horizon
    dt = simulation.dt if table.dt is None else table.dt
    check_steps(horizon, dt, faults, ("mpc", "horizon" if table.dt is None else "dt"))
    if 1 / table.rate > horizon:
        faults.add(("mpc", "rate"), f"ticks are {1 / table.rate:g} s apart, and a plan ends after {horizon:g} s")
    return RecedingHorizon(
        rate=table.rate,
        horizon=horizon,
        dt=dt,
        iterations=table.iterations,
        first_iterations=table.first_iterations,
        damping=table.damping,
        smoothing=simulation.smoothing[-1] if table.smoothing is None else table.smoothing,
        feedback=table.feedback,
        duration=FIVE * simulation.duration if table.duration is None else table.duration,
        plant=read_plant(table.plant, simulation),
    )


def read_plant(table: PlantTable, simulation: Simulation) -> PlantSettings:
    """The plant; what it sets in the file is validated when it is made."""
    dt = simulation.dt / 2 if table.dt is None else table.dt
    return PlantSettings(**{**table.model_dump(), "dt": dt, "set": dict(dotted(table.set))})


def dotted(tables: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, object]]:
    """Values by dotted keys, as TOML and settings may nest them: { ground = { friction = 1 } } is ground.friction."""
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from dotted(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value
