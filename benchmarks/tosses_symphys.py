"""Tosses in this engine: the problem of a toss, its flights, and how far simulated tosses are from recorded ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from tosses_data import BOX, CUBE, HINGE, RATE, Tossed, Tosses, mean_errors
from tosses_search import Number

import symphys
from symphys.prediction.residuals import RecordingResiduals, residuals_of
from symphys.types import Array

Tables = dict[str, Any]
GRAVITY, MASS, MOMENT, HALF = 9.601, 0.37, 8.1e-4, 0.0524
"""[m/s^2] that flights give in the lengths of the recordings; published: [kg], [kg m^2], [m]."""
LAW = (
    Number("friction", 0.18, 0.1),
    Number("torsion", 0.003, 0.5),
    Number("rolling", 0.0005, 0.5),
    Number("frequency", 60.0, 0.3),
    Number("damping", 0.5, 0.3),
)
"""Of contacts: [m] torsion and rolling, [Hz] of a soft contact and its damping ratio."""
RESTITUTION = Number("restitution", 0.12, 0.3)
"""In place of the last two."""
CUBE_NUMBERS = (
    *LAW,
    Number("edge", 0.004, 0.3),
    Number("size", 2 * 0.0513, 0.004),
    Number("height", 0.0, 0.0005, factor=False),
    *[Number(f"moment{k}", MOMENT / 2, 0.05) for k in range(3)],
    *[Number(f"com{k}", guess, 0.0005, factor=False) for k, guess in enumerate((0.0, 0.0, 0.005))],
)
"""Of the cube: radius of its edges [m], length of an edge [m], z of the table [m], second moments [kg m^2] along each
axis, and its centre of mass [m]."""
ELBOW_NUMBERS = (
    *LAW,
    Number("edge", 0.003, 0.3),
    Number("share", 0.48, 0.1),
    Number("inertia", 1.0, 0.1),
    Number("height", 0.0, 0.0005, factor=False),
    Number("hinge_friction", 6.6e-4, 0.3),
    Number("hinge_damping", 8e-5, 0.5),
)
"""Of the elbow: the share of its mass that link 2 has, both inertias by those of homogeneous boxes, its hinge [N m]."""


def cube_tables(numbers: Mapping[str, float]) -> Tables:
    """A cube above a table; its frame lies in the middle, and its centre of mass beside it."""
    m = [numbers[f"moment{k}"] for k in range(3)]
    box = {"size": [numbers["size"]] * 3} | ({"edge": numbers["edge"]} if numbers["edge"] else {})
    body = {"name": "cube", "shape": {"box": box}, "mass": MASS}
    body |= {"inertia": [sum(m) - m[k] for k in range(3)], "position": [0, 0, 0.5]}
    return {"body": [body], "site": [{"name": "origin", "body": "cube"}]}


def elbow_tables(numbers: Mapping[str, float]) -> Tables:
    """Two boxes on a hinge; the frame of link 1 lies in the middle of its box."""
    bodies, place = list[Tables](), np.array([0.0, 0.0, 0.5])
    size = np.array([0.1, 0.05, 0.05])
    for name, share, at in (("one", 1 - numbers["share"], place), ("two", numbers["share"], place + HINGE + BOX)):
        mass = 2 * MASS * share
        moments = numbers["inertia"] * mass / 12 * (size @ size - size**2)
        shape = {"box": {"size": size.tolist(), "edge": numbers["edge"]}}
        bodies.append(
            {"name": name, "shape": shape, "mass": mass, "inertia": moments.tolist(), "position": at.tolist()}
        )
    hinge = {
        "name": "hinge",
        "hinge": {"axis": [0, 1, 0]},
        "between": ["one", "two"],
        "point": (place + HINGE).tolist(),
    }
    hinge |= {"friction": numbers["hinge_friction"], "spring": {"damping": numbers["hinge_damping"]}}
    return {"body": bodies, "joint": [hinge], "site": [{"name": "origin", "body": "one"}]}


def assigned(tossed: Tossed, numbers: Mapping[str, float], without: Sequence[str] = ()) -> dict[str, list[float]]:
    """What of a problem variables set, and to which values; an edge of 0 is none."""
    law = [*(each.name for each in LAW), RESTITUTION.name]
    found = {f"contact.{name}": [numbers[name]] for name in law if name in numbers and name not in without}
    found["ground.offset"] = [numbers["height"]]
    names = ("cube",) if tossed is CUBE else ("one", "two")
    if numbers["edge"]:
        found |= {f"{name}.edge": [numbers["edge"]] for name in names}
    if tossed is CUBE:
        moments, com = ([numbers[f"{key}{k}"] for k in range(3)] for key in ("moment", "com"))
        return found | {"cube.size": [numbers["size"]] * 3, "cube.second_moments": moments, "cube.centre_of_mass": com}
    for name, share in zip(names, (1 - numbers["share"], numbers["share"]), strict=True):
        mass = 2 * MASS * share
        found[f"{name}.mass"] = [mass]
        found[f"{name}.second_moments"] = [numbers["inertia"] * mass / 12 * (2 * half) ** 2 for half in tossed.halves]
    return found | {f"hinge.{key}": [numbers[f"hinge_{key}"]] for key in ("friction", "damping")}


@dataclass(frozen=True)
class Options:
    """What ablations change.

    Attributes:
        substeps: time steps of a frame.
        gravity: [m/s^2].
        without: keys of the law that the problem does not have.
    """

    substeps: int = 1
    gravity: float = GRAVITY
    without: tuple[str, ...] = ()


def tables_of(tossed: Tossed, numbers: Mapping[str, float], options: Options) -> Tables:
    """A problem without recordings and variables."""
    tables = (cube_tables if tossed is CUBE else elbow_tables)(numbers)
    law = {each.name: numbers[each.name] for each in (*LAW, RESTITUTION) if each.name in numbers}
    law = {name: value for name, value in law.items() if name not in options.without}
    tables |= {"contact": law, "ground": {"height": 0.0}, "world": {"gravity": [0, 0, -options.gravity]}}
    return tables | {"simulation": {"dt": 1 / RATE / options.substeps}}


def recording(tossed: Tossed, path: Path, names: Sequence[str]) -> Tables:
    """The recordings of a file that ``write`` made."""
    first = "cube" if tossed is CUBE else "one"
    values = {"position": "origin.position", "orientation": f"{first}.orientation", "angle": "hinge.angle"}
    measured = [{"value": values[name], "columns": name, "noise": 1.0} for name in tossed.measures]
    start = {f"{first}.{name}": f"start_{name}" for name in names if name not in ("angle", "rate")}
    start |= {f"hinge.{name}": f"start_{name}" for name in ("angle", "rate") if name in names}
    return {"name": "toss", "files": str(path), "rows": "start", "rate": RATE, "measured": measured, "start": start}


def write(path: Path, tosses: Tosses, first: Mapping[str, Array]) -> None:
    """A file of tosses and of where each of them starts (K, ...), which may be elsewhere than it was measured."""
    columns = dict(tosses.columns)
    for name, values in first.items():
        columns[f"start_{name}"] = np.repeat(values, np.diff(tosses.start), axis=0)
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, start=tosses.start, **columns)  # type: ignore[arg-type]


@dataclass
class Simulator:
    """Simulates tosses, for any numbers.

    Attributes:
        tossed: what is tossed.
        tosses: recorded ones.
        numbers: that are fitted.
        path: of a file that is written for the engine.
        first: (K, ...) where tosses start.
        fixed: numbers that are not fitted.
        options: see there.
    """

    tossed: Tossed
    tosses: Tosses
    numbers: Sequence[Number]
    path: Path
    first: Mapping[str, Array]
    fixed: Mapping[str, float] = field(default_factory=dict)
    options: Options = field(default_factory=Options)
    threads: int = 1

    def __post_init__(self) -> None:
        """Write the file; what is compiled is compiled at the first simulation."""
        write(self.path, self.tosses, self.first)
        self.guess = {each.name: each.guess for each in self.numbers} | dict(self.fixed)

    @cached_property
    def residuals(self) -> RecordingResiduals:
        """Of the problem."""
        tables = tables_of(self.tossed, self.guess, self.options)
        variables = [{"name": f"v{k}", "sets": sets} for k, sets in enumerate(self._assigned({}))]
        tables |= {"variable": variables, "recording": [recording(self.tossed, self.path, list(self.first))]}
        return residuals_of(symphys.load(tables), self.threads)

    def _assigned(self, values: Mapping[str, float]) -> dict[str, list[float]]:
        return assigned(self.tossed, self.guess | dict(values), self.options.without)

    def shared(self, values: Mapping[str, float]) -> Array:
        """(s,): what the variables of the problem are, in their order."""
        return np.concatenate(list(self._assigned(values).values()))

    def frames(self, values: Mapping[str, float]) -> list[tuple[Array, ...]]:
        """Of each toss the errors of its frames [m], [rad], [rad]."""
        K, found = len(self.tosses), list[tuple[Array, ...]]()
        for residuals in self.residuals.residuals(self.shared(values), np.zeros((K, 0)), np.arange(K)):
            n = len(residuals) // (7 if "angle" in self.tossed.measures else 6)
            parts = [np.linalg.norm(residuals[3 * n * k : 3 * n * (k + 1)].reshape(n, 3), axis=1) for k in (0, 1)]
            parts += [np.abs(residuals[6 * n :])] * ("angle" in self.tossed.measures)
            found.append(tuple(parts))
        return found

    def motions(self, values: Mapping[str, float]) -> list[tuple[Array, Array]]:
        """Of each toss the positions (n, 3) [m] and orientations (n, 4) of its frames."""
        K = len(self.tosses)
        sampled = self.residuals.predictor.values(self.shared(values), np.zeros((K, 0)), list(range(K)))
        return [(each.values[:, :3], each.values[:, 3:7]) for each in sampled]

    def errors(self, values: Mapping[str, float]) -> Array:
        """(K, m) of the published measure."""
        return mean_errors(self.tossed, self.tosses, self.frames(values))
