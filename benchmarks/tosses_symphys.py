"""Tosses in this engine: the problem of a toss, its flights, and how far simulated tosses are from recorded ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tosses_data import BOX, CUBE, HINGE, RATE, Tossed, Tosses, mean_errors
from tosses_search import Number

import symphys
from symphys.prediction.residuals import RecordingResiduals, residuals_of

Array = NDArray[np.float64]
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
    Number("share", 0.35, 0.1),
    Number("inertia", 1.0, 0.1),
    Number("height", 0.0, 0.0005, factor=False),
    Number("hinge_friction", 4e-4, 0.5),
    Number("hinge_damping", 2e-5, 0.5),
)
"""Of the elbow: the share of its mass that link 2 has, both inertias by those of homogeneous boxes, its hinge [N m]."""


def cube_tables(numbers: Mapping[str, float]) -> Tables:
    """A cube above a table; its frame lies in the middle, and its centre of mass beside it."""
    size, m = [numbers["size"]] * 3, [numbers[f"moment{k}"] for k in range(3)]
    body = {"name": "cube", "shape": {"box": {"size": size, "edge": numbers["edge"]}}, "mass": MASS}
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


SETS: dict[str, list[str]] = {
    **{name: [f"contact.{name}"] for name in ("friction", "restitution", "torsion", "rolling", "frequency", "damping")},
    "height": ["ground.offset"],
    "hinge_friction": ["hinge.friction"],
    "hinge_damping": ["hinge.damping"],
    "gravity": ["gravity[2]"],
}
"""By number, what of a problem it sets."""
CUBE_SETS = SETS | {
    "edge": ["cube.edge"],
    "size": [f"cube.size[{k}]" for k in range(3)],
    **{f"moment{k}": [f"cube.second_moments[{k}]"] for k in range(3)},
    **{f"com{k}": [f"cube.centre_of_mass[{k}]"] for k in range(3)},
}


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
        """Build and compile nothing yet."""
        write(self.path, self.tosses, self.first)
        guess = {each.name: each.guess for each in self.numbers} | dict(self.fixed)
        sets = CUBE_SETS if self.tossed is CUBE else SETS
        self.varied = [each.name for each in self.numbers if each.name in sets]
        self._problems: dict[tuple[float, ...], RecordingResiduals] = {}
        self._guess = guess

    def residuals(self, values: Mapping[str, float]) -> RecordingResiduals:
        """Of the problem with these values; those that no variable can set are in its file."""
        values = self._guess | dict(values)
        sets = CUBE_SETS if self.tossed is CUBE else SETS
        key = tuple(value for name, value in values.items() if name not in self.varied)
        if key not in self._problems:
            self._problems.clear()
            tables = tables_of(self.tossed, values, self.options)
            absent = {f"contact.{name}" for name in self.options.without}
            variables = []
            for name in self.varied:
                if not absent & set(sets[name]):
                    variables.append({"name": name, "sets": sets[name] if len(sets[name]) > 1 else sets[name][0]})
            tables |= {"variable": variables, "recording": [recording(self.tossed, self.path, list(self.first))]}
            self._problems[key] = residuals_of(symphys.load(tables), self.threads)
        return self._problems[key]

    def frames(self, values: Mapping[str, float]) -> list[tuple[Array, ...]]:
        """Of each toss the errors of its frames [m], [rad], [rad]."""
        found = self.residuals(values)
        shared = np.array([(self._guess | dict(values))[name] for name in found.shared.names])
        K = len(self.tosses)
        found_errors = []
        for residuals in found.residuals(shared, np.zeros((K, 0)), np.arange(K)):
            n = len(residuals) // (7 if "angle" in self.tossed.measures else 6)
            parts = [np.linalg.norm(residuals[3 * n * k : 3 * n * (k + 1)].reshape(n, 3), axis=1) for k in (0, 1)]
            parts += [np.abs(residuals[6 * n :])] * ("angle" in self.tossed.measures)
            found_errors.append(tuple(parts))
        return found_errors

    def motions(self, values: Mapping[str, float]) -> list[tuple[Array, Array]]:
        """Of each toss the positions (n, 3) [m] and orientations (n, 4) of its frames."""
        found = self.residuals(values)
        shared = np.array([(self._guess | dict(values))[name] for name in found.shared.names])
        K = len(self.tosses)
        sampled = found.predictor.values(shared, np.zeros((K, 0)), list(range(K)))
        return [(each.values[:, :3], each.values[:, 3:7]) for each in sampled]

    def errors(self, values: Mapping[str, float]) -> Array:
        """(K, m) of the published measure."""
        return mean_errors(self.tossed, self.tosses, self.frames(values))
