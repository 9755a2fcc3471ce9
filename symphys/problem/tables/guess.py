"""The [guess] table: where a motion is guessed to pass, as states at some times, or as formulas of time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from symphys.expression import FormulaError, parse
from symphys.model.orientation import ANGLES, unit_quaternion
from symphys.model.world import World
from symphys.problem.guess import GuessedMotion, guessable, is_orientation
from symphys.problem.model import Simulation
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.references import ReferenceTrajectory, reference_values
from symphys.problem.schema.objectives import GuessTable
from symphys.suggest import hint, quote

AT = "at"
MAX_SAMPLES = 200
"""Of a formula, over the duration."""
TURNED = f"a unit quaternion w x y z, or turns about fixed axes such as {{ yaw_deg = 90 }}; valid: {', '.join(ANGLES)}"


def read_guess(
    table: GuessTable | None,
    simulation: Simulation,
    world: World,
    references: Sequence[ReferenceTrajectory],
    faults: Faults,
) -> GuessedMotion | None:
    """The motion that is guessed; None without a table. ProblemError for all faults that were found."""
    if table is None:
        return None
    if not (table.states or table.follows):
        faults.add(("guess",), 'names nothing; write states = [{ at = 2.0, "knee.angle" = 1.2 }], or follows')
        faults.stop_if_any()
    sizes, points = guessable(world), dict[str, dict[float, list[float]]]()
    for index, state in enumerate(table.states):
        _read_state(index, state, sizes, simulation.duration, points, faults)
    columns = {}
    for name, known in points.items():
        times = sorted(known)
        columns[name] = np.array(times), np.array([known[time] for time in times])
    for name, text in table.follows.items():
        place: Place = ("guess", "follows", name)
        if name in points:
            faults.add(place, f"{name} is named in states too; leave one of the two out")
        elif _check_name(name, sizes, place, faults):
            values = _followed(name, text, sizes[name], simulation, references, place, faults)
            columns |= {} if values is None else {name: values}
    faults.stop_if_any()
    return GuessedMotion(columns)


def _read_state(
    index: int,
    state: Mapping[str, Any],
    sizes: Mapping[str, int],
    duration: float,
    points: dict[str, dict[float, list[float]]],
    faults: Faults,
) -> None:
    """Add what a state names to ``points``, by name and time."""
    place: Place = ("guess", "states", index)
    at = state.get(AT)
    if not isinstance(at, int | float) or isinstance(at, bool) or not 0 <= at <= duration:
        faults.add((*place, AT), f"must be a time [s] from 0 to the duration, {duration:g}")
        return
    for name, value in _flat(state):
        if name == AT or not _check_name(name, sizes, (*place, name), faults):
            continue
        try:
            numbers = _numbers(name, value, sizes[name])
        except ValueError as fault:
            faults.add((*place, name), str(fault))
            continue
        if float(at) in points.setdefault(name, {}):
            faults.add((*place, name), f"another state names it at {at:g} s; leave one of the two out")
        else:
            points[name][float(at)] = numbers


def _numbers(name: str, value: Any, size: int) -> list[float]:
    """Return the value of a quantity in a state; ValueError for an impossible one."""
    turns = isinstance(value, Mapping)
    numbers = list(value.values()) if turns else value if isinstance(value, list) else [value]
    right = all(isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in numbers)
    if not right or (not turns and len(numbers) != size):
        raise ValueError(
            f"must be {TURNED if is_orientation(name) else 'a number' if size == 1 else f'{size} numbers'}"
        )
    return unit_quaternion(value).tolist() if is_orientation(name) else [float(x) for x in numbers]


def _flat(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Keys and values; those of tables within are dotted, as TOML reads ``knee.angle = 1``, but for orientations."""
    for key, value in table.items():
        if isinstance(value, Mapping) and not is_orientation(before + key):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield before + key, value


def _check_name(name: str, sizes: Mapping[str, int], place: Place, faults: Faults) -> bool:
    """Whether a guess may name it; a fault if not."""
    if name not in sizes:
        what = (
            "coordinates and rates of joints, orientation and angular_velocity of ball joints and of bodies that no "
            "joint holds, and the position and velocity of such bodies"
        )
        faults.add(place, f"a guess cannot name {quote(name)}, only {what}; {hint(name, sizes)}")
    return name in sizes


def _followed(
    name: str,
    text: str,
    size: int,
    simulation: Simulation,
    references: Sequence[ReferenceTrajectory],
    place: Place,
    faults: Faults,
) -> tuple[Any, Any] | None:
    """Times and values (K, size) of a formula; None after a fault."""
    times, rows = np.linspace(0, simulation.duration, min(simulation.steps, MAX_SAMPLES) + 1), []
    try:
        formula = parse(text)
        for time in times.tolist():
            named = {"time": ca.DM(time), "duration": ca.DM(simulation.duration)}
            rows.append(np.array(formula.evaluate({**named, **reference_values(references, ca.DM(time))})).ravel())
    except FormulaError as error:
        faults.add(place, str(error))
        return None
    values = np.array(rows)
    if values.shape[1] != size or not np.isfinite(values).all():
        faults.add(place, f"must be {size} finite number{'s' * (size > 1)} at all times from 0 to the duration")
        return None
    if not is_orientation(name):
        return times, values
    lengths = np.linalg.norm(values, axis=1, keepdims=True)
    if not lengths.all():
        faults.add(place, f"must be {TURNED} at all times")
        return None
    return times, values / lengths
