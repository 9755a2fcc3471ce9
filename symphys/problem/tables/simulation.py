"""The tables of time: [simulation], the [[phase]] tables that divide its duration, and [mpc]."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import ceil, floor, isfinite
from typing import Any

import numpy as np

from symphys.dynamics.observation import SENSOR_KINDS
from symphys.expression import Formula
from symphys.problem.model import Phase, PlantSettings, RecedingHorizon, Sensor, Simulation, Termination
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.quantities import Quantity, unknown
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema import Document
from symphys.problem.schema.mpc import MpcTable
from symphys.problem.schema.objectives import PhaseTable
from symphys.suggest import hint, quote

MAX_STEPS = 1_000_000
STEP_RATIO_TOLERANCE = 1e-9
"""Relative slack for a whole number of steps."""
CLOSED_LOOP_DURATIONS = 5
"""Durations of the problem that the closed loop lasts, unless the file says otherwise."""


def check_steps(duration: float, dt: float, faults: Faults, place: Place = ("simulation", "dt")) -> None:
    """The duration must be a whole number of steps, and not too many."""
    ratio = duration / dt
    if dt > duration:
        faults.add(place, f"the step {dt:g} s is longer than the duration {duration:g} s")
    elif ratio > MAX_STEPS * (1 + STEP_RATIO_TOLERANCE):
        least = duration / MAX_STEPS
        faults.add(place, f"{ratio:.4g} steps are too many, {MAX_STEPS} are allowed; take dt = {least:.6g} or more")
    elif abs(ratio - round(ratio)) > STEP_RATIO_TOLERANCE * ratio:
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


def find_phase(name: str, phases: Mapping[str, Phase], place: Place, faults: Faults) -> Phase | None:
    """The phase of that name; notes where there is none."""
    if name not in phases:
        known = hint(name, phases) if phases else "there is no [[phase]]"
        faults.add(place, f"there is no phase {quote(name)}; {known}")
    return phases.get(name)


def read_sets(
    tables: Sequence[PhaseTable], parametric: ParametricWorld, faults: Faults
) -> dict[str, dict[str, tuple[float, ...]]]:
    """Read the numbers that hold in each phase alone; note those that cannot change from step to step."""
    nominal, known = parametric.parameters(), parametric.numbers
    able = [name for name in nominal if known[name].phase]
    found: dict[str, dict[str, tuple[float, ...]]] = {table.name: {} for table in tables}
    for index, table in enumerate(tables):
        for name, value in dotted(table.sets):
            numbers, place = row_of(value), ("phase", index, "sets")
            if name not in nominal:
                faults.add(place, f"there is no parameter {quote(name)}; {unknown(name, nominal)}")
            elif name not in able:
                faults.add(place, f"{name} is the same all along; a phase may set {', '.join(able)}")
            elif numbers is None or len(numbers) != nominal[name].size:
                count = nominal[name].size
                faults.add(place, f"{name} takes {'a number' if count == 1 else f'{count} numbers'}, not {value!r}")
            elif not all(known[name].least <= number <= known[name].most for number in numbers):
                faults.add(place, f"{name} must lie in [{known[name].least:g}, {known[name].most:g}], not {value!r}")
            else:
                found[table.name][name] = numbers
    faults.stop_if_any()
    return found


def row_of(value: object) -> tuple[float, ...] | None:
    """A number or a list of numbers as numbers; None for anything else."""
    row = value if isinstance(value, list) else [value]
    plain = all(isinstance(each, int | float) and not isinstance(each, bool) and isfinite(each) for each in row)
    return tuple(map(float, row)) if plain else None


def phase_quantities(
    sets: Mapping[str, Mapping[str, tuple[float, ...]]], parametric: ParametricWorld
) -> dict[str, Quantity]:
    """The numbers of all phases by the names that variables and formulas use, such as ``ice.ground.friction``."""
    return {
        f"{phase}.{name}": Quantity("weight", np.array(numbers), parametric.numbers[name])
        for phase, own in sets.items()
        for name, numbers in own.items()
    }


def check_read_at_start(
    phases: Iterable[Phase], sensors: Sequence[Sensor], ending: tuple[str, Termination | None], faults: Faults
) -> None:
    """Sensors and [termination] look at a state alone, which does not say in which phase it is."""
    names = {name for phase in phases for name in phase.sets}
    depends = tuple(f".{kind.key}" for kind in SENSOR_KINDS if kind.parameters & names)
    read: list[tuple[Place, Formula]] = []
    for k, sensor in enumerate(sensors):
        read += [(("sensor", k, "reads"), formula) for formula in sensor.formulas]
    read += [] if ending[1] is None else [((ending[0], "margin"), ending[1].margin)]
    for place, formula in read:
        felt = {name for name in formula.names if name.endswith(depends)}
        for name in sorted(formula.names & names | felt):
            faults.add(place, f"looks at {name}, which a phase changes; a state does not tell its phase")
    faults.stop_if_any()


def read_phases(
    tables: Sequence[PhaseTable],
    sets: Mapping[str, Mapping[str, tuple[float, ...]]],
    simulation: Simulation,
    free: bool,
    faults: Faults,
) -> dict[str, Phase]:
    """The phases by name.

    Args:
        tables: as they are in the file.
        sets: see ``read_sets``.
        simulation: how time passes.
        free: whether a variable sets the duration, so that times are not known.
        faults: gets what is wrong.
    """
    found, start = dict[str, Phase](), 0.0
    for index, table in enumerate(tables):
        place = ("phase", index)
        key = "share" if table.share is not None else "until"
        if table.until is not None and table.share is not None:
            faults.add((*place, "share"), "stands instead of until; leave one of them out")
        elif table.until is not None and free:
            faults.add((*place, "until"), "is not known, since a variable sets the duration; give share")
        elif table.until is not None:
            check_moment(table.until, simulation, (*place, "until"), faults)
        elif table.share is None and index + 1 < len(tables):
            faults.add((*place, "until"), "is needed, or share: only the last phase goes on until the end")
        end = 1.0 if table.until is None else table.until / simulation.duration
        phase = Phase(table.name, start, end if table.share is None else table.share, sets[table.name])
        first, last = phase.ticks(simulation.steps)
        if last <= first:
            ended = f"{first * simulation.dt:g} s" if key == "until" else f"{start:g}"
            faults.add((*place, key), f"the phase before ends at {ended}, and one step more is the least")
        found[table.name], start = phase, phase.end
    return found


def read_time(document: Document, faults: Faults) -> tuple[Simulation, RecedingHorizon | None]:
    """Read the time step of the problem and of its controller's horizon; note a step that does not fit."""
    table = document.simulation
    assert table.duration is not None, "recordings or the file say it"
    check_steps(table.duration, table.dt, faults)
    simulation = Simulation(**{**table.model_dump(), "smoothing": tuple(table.smoothing)})
    return simulation, read_mpc(document.mpc, simulation, faults)


def read_mpc(table: MpcTable | None, simulation: Simulation, faults: Faults) -> RecedingHorizon | None:
    """Read the receding horizon; None without the table. Note a horizon that is no whole number of steps.

    What the plant sets in the file is validated when the plant is made.
    """
    if table is None:
        return None
    horizon = simulation.duration if table.horizon is None else table.horizon
    dt = simulation.dt if table.dt is None else table.dt
    check_steps(horizon, dt, faults, ("mpc", "horizon" if table.dt is None else "dt"))
    if 1 / table.rate > horizon:
        faults.add(("mpc", "rate"), f"ticks are {1 / table.rate:g} s apart, and a plan ends after {horizon:g} s")
    plant_dt = simulation.dt / 2 if table.plant.dt is None else table.plant.dt
    return RecedingHorizon(
        rate=table.rate,
        horizon=horizon,
        dt=dt,
        iterations=table.iterations,
        first_iterations=table.first_iterations,
        damping=table.damping,
        smoothing=simulation.smoothing[-1] if table.smoothing is None else table.smoothing,
        feedback=table.feedback,
        duration=CLOSED_LOOP_DURATIONS * simulation.duration if table.duration is None else table.duration,
        plant=PlantSettings(**{**table.plant.model_dump(), "dt": plant_dt, "set": dict(dotted(table.plant.set))}),
    )


def dotted(tables: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, object]]:
    """Values by dotted keys, as TOML and settings may nest them: { ground = { friction = 1 } } is ground.friction."""
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from dotted(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value
