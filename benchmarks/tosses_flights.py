"""What flights say: gravity in the lengths of the recordings, the centre of mass, and where each toss starts."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from tosses_data import CUBE, RATE, Tossed, Tosses, flights, joined
from tosses_symphys import CUBE_NUMBERS, ELBOW_NUMBERS, GRAVITY, cube_tables, elbow_tables, recording, write

import symphys
from symphys.results.identification import Identification, read_identification
from symphys.types import Array

Tables = dict[str, Any]
NOISE = {
    "cube": {"position": 1e-4, "orientation": 5e-4},
    "elbow": {"position": 4e-4, "orientation": 4e-3, "angle": 7e-3},
}
"""[m], [rad]: about what fits leave. Samples are not independent, so that intervals are those of a bootstrap."""
LEAST = 5
"""Frames that a flight must have, so that its start is told from noise."""


def shared_variables(tossed: Tossed) -> list[Tables]:
    """What all flights have in common; of masses only their ratio has an effect."""
    if tossed is CUBE:
        sets = {"g": "gravity[2]", "com": "cube.centre_of_mass"}
    else:
        sets = {"g": "gravity[2]", "mass": "two.mass", "dry": "hinge.friction", "viscous": "hinge.damping"}
    return [{"name": name, "sets": of} for name, of in sets.items()]


def own_variables(tossed: Tossed) -> dict[str, str]:
    """What each flight has for itself: its start."""
    name = "cube" if tossed is CUBE else "one"
    found = {key: f"{name}.{key}" for key in ("position", "orientation", "velocity", "angular_velocity")}
    return found | ({} if tossed is CUBE else {"angle": "hinge.start", "rate": "hinge.start_rate"})


def flights_problem(tossed: Tossed, parts: list[Tosses], path: Path) -> Tables:
    """All flights, those of the last part held back; shared numbers, and a start for each."""
    flying = [each.cut(np.maximum(flights(tossed, each), LEAST)) for each in parts]
    tosses = joined(flying)
    write(path, tosses, tosses.first())
    guess = {each.name: each.guess for each in (CUBE_NUMBERS if tossed is CUBE else ELBOW_NUMBERS)}
    tables = (cube_tables if tossed is CUBE else elbow_tables)(guess)
    for body in tables["body"]:
        del body["inertia"]  # follows masses
    own = own_variables(tossed)
    variables = shared_variables(tossed)
    variables += [{"name": f"start_{key}", "sets": sets, "each": "recording"} for key, sets in own.items()]
    columns = recording(tossed, path, [*own])
    for each in columns["measured"]:
        each["noise"] = NOISE[tossed.name][each["columns"]]
    held_back = list(range(len(flying[0]), len(tosses)))
    tables |= {"world": {"gravity": [0, 0, -GRAVITY]}, "simulation": {"dt": 1 / RATE}}
    return tables | {"variable": variables, "recording": [columns | {"held_back": held_back or False}]}


def starts(tossed: Tossed, parts: list[Tosses], found: Identification) -> list[dict[str, Array]]:
    """By part (K, ...) where tosses start, as their flights say."""
    measured = joined(parts).first()
    own, where, place = np.asarray(found.own), dict[str, Array](), 0
    for name in own_variables(tossed):
        width = 1 if name in ("angle", "rate") else 3
        where[name] = own[:, place] if width == 1 else own[:, place : place + width]
        place += width
    turn = Rotation.from_quat(measured["orientation"], scalar_first=True) * Rotation.from_rotvec(where["orientation"])
    where["orientation"] = turn.as_quat(scalar_first=True)
    ends = np.cumsum([0, *map(len, parts)])
    return [{key: values[a:b] for key, values in where.items()} for a, b in pairwise(ends)]


def fly(tossed: Tossed, parts: list[Tosses], path: Path, **settings: Any) -> Identification:
    """Identify all flights at once."""
    return symphys.identify(symphys.load(flights_problem(tossed, parts, path)), loss="huber", **settings)


def flights_of(tossed: Tossed, folder: Path) -> Identification:
    """What ``starts_of`` has kept of the flights."""
    return read_identification(folder / f"{tossed.name}_flights")


def starts_of(tossed: Tossed, parts: list[Tosses], folder: Path) -> list[dict[str, Array]]:
    """``starts`` of all flights, kept in a folder beside what else the flights say."""
    path = folder / f"{tossed.name}_starts.npz"
    if not path.exists():
        found = fly(tossed, parts, (folder / f"{tossed.name}_flights.npz").absolute(), bootstrap=1000)
        found.write(folder / f"{tossed.name}_flights")
        columns = {f"{k}/{name}": a for k, each in enumerate(starts(tossed, parts, found)) for name, a in each.items()}
        np.savez(path, **columns)  # type: ignore[arg-type]
    with np.load(path) as kept:
        names = [name.split("/", 1) for name in kept.files]
        return [{name: kept[f"{k}/{name}"] for part, name in names if int(part) == k} for k in range(len(parts))]
