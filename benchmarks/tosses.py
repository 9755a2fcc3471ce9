"""How well are recorded impacts of a real cube predicted?

570 tosses of an acrylic cube onto a table (ContactNets; docs/results/identification.md has the sources). ``--data
FOLDER`` has cube_fit.npz (285 tosses) and cube_check.npz (114), each with the frames of one toss after the other:
start, position, orientation (w x y z), velocity, angular_velocity, in world axes. Tosses of the check file are
simulated open loop from their first frame, with the numbers that CMA-ES found on the fit file; ``--evaluations 600``
searches for them anew, in a quarter of an hour. The measure is that of Acosta, Yang and Posa (2022): means over
frames, then over tosses, of the error of the position by the width of the cube, and of the angle between orientations.
Then the flights before the first impact are identified with a start of each toss: gravity in the lengths of the
recordings, and the centre of mass. Without data a few tosses of the engine itself are predicted and identified, whose
errors are those of rounding.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import cma
import numpy as np
from bench import Row
from scipy.spatial.transform import Rotation

import symphys
from symphys.prediction.residuals import RecordingResiduals, residuals_of
from symphys.results.identification import Identification
from symphys.types import Array, Ints

Tables = dict[str, Any]
COLUMNS = {
    "what": "is predicted or identified",
    "tosses": "of the recordings",
    "position": "mean error [% of the width]",
    "position_spread": "standard deviation over tosses [%]",
    "rotation": "mean error [degrees]",
    "rotation_spread": "standard deviation over tosses [degrees]",
    "value": "that is identified [m/s^2, m]",
    "lower": "end of its 95 % interval",
    "upper": "end of its 95 % interval",
    "seconds": "of the clock",
}
RATE = 148.0
"""Frames of the recordings a second."""
MEASURED = ("position", "orientation", "velocity", "angular_velocity")
"""Columns of the cube's frame [m, w x y z, m/s, rad/s], world axes."""
NEAR = 0.02
"""A toss is no longer a flight with a corner so near to the table [m]."""
WIDTH, HALF = 0.1048, 0.0513
"""By which errors of positions are divided, and half an edge of the cube in the lengths of the recordings [m]."""
GRAVITY, MASS, MOMENT = 9.601, 0.37, 8.1e-4
"""Gravity that flights give [m/s^2]; published mass [kg] and moment of inertia [kg m^2]."""
NOISE = {"position": 1e-4, "orientation": 5e-4}
"""About what fits of flights leave [m, rad]."""
LEAST = 5
"""Frames that a flight has at least, so that its start is told from noise."""
LAW = ("friction", "torsion", "rolling", "frequency", "damping")
GUESS = {
    "friction": 0.18,
    "torsion": 0.003,
    "rolling": 0.0005,
    "frequency": 60.0,
    "damping": 0.5,
    "edge": 0.004,
    "size": 2 * HALF,
    "height": 0.0,
    **{f"moment{k}": MOMENT / 2 for k in range(3)},
    **{"com0": 0.0, "com1": 0.0, "com2": 0.005},
}
"""Torsion and rolling of contacts [m], frequency of a soft contact [Hz] and its damping ratio, radius of the cube's
edges, length of an edge and height of the table [m], second moments along each axis [kg m^2], centre of mass [m]."""
FITTED = {
    "friction": 0.1838,
    "torsion": 0.0002335,
    "rolling": 0.0006696,
    "frequency": 76.88,
    "damping": 0.5597,
    "edge": 0.002755,
    "size": 0.1018,
    "height": 0.001389,
    "moment0": 0.000455,
    "moment1": 0.0004147,
    "moment2": 0.0005105,
    "com0": 0.0001215,
    "com1": 0.000202,
    "com2": 0.005315,
}
"""Numbers that the search with seed 1 and 600 evaluations finds on the fit file, starts as measured."""
FACTORS = {
    "friction": 0.1,
    "torsion": 0.5,
    "rolling": 0.5,
    "frequency": 0.3,
    "damping": 0.3,
    "edge": 0.3,
    "size": 0.004,
    **{f"moment{k}": 0.05 for k in range(3)},
}
"""Step of the search in the logarithm of a number."""
STEPS = {"height": 5e-4, **{f"com{k}": 5e-4 for k in range(3)}}
"""Step of the search in a number [m]."""
POPULATION = 12
TRUE = {"com0": 0.001, "com1": -0.002, "com2": 0.004, "friction": 0.2}
"""Numbers of the engine's own tosses."""


def rows(quick: bool = False, data: str = "", evaluations: int = 0, seed: int = 1) -> Iterator[Row]:
    """Yield errors of predicted tosses, and what flights tell.

    Args:
        quick: one toss of the engine itself.
        data: folder with the recordings.
        evaluations: of a search on the fit file; 0 takes the numbers that such a search has found.
        seed: of the search.
    """
    with TemporaryDirectory() as place:
        if data and not quick:
            recorded = {part: read(Path(data), part) for part in ("fit", "check")}
            name, numbers = "recorded tosses, check file", FITTED
            if evaluations:
                fit = Simulator(recorded["fit"], Path(place, "fit.npz"), recorded["fit"].first())
                numbers = search(fit, evaluations, seed)
        else:
            recorded, name, numbers = {"check": simulated(1 if quick else 3, Path(place))}, "own tosses", TRUE
        check, began = recorded["check"], perf_counter()
        errors = Simulator(check, Path(place, "check.npz"), check.first()).errors(numbers)
        (position, rotation), spread = errors.mean(axis=0).tolist(), errors.std(axis=0).tolist()
        row: Row = {"what": name, "tosses": len(check), "position": position, "position_spread": spread[0]}
        yield row | {"rotation": rotation, "rotation_spread": spread[1], "seconds": perf_counter() - began}
        began, parts = perf_counter(), list(recorded.values())
        found = fly(parts, Path(place, "flights.npz"))
        for key in ("g", *(f"com[{k}]" for k in range(3))):
            row = {"what": f"{key} from flights", "tosses": sum(map(len, parts)), "value": found[key].value}
            row |= {"lower": found[key].lower, "upper": found[key].upper}
            yield row | {"seconds": perf_counter() - began}


@dataclass(frozen=True)
class Tosses:
    """Tosses one after the other.

    Attributes:
        start: (K + 1,) first rows of the tosses, and the number of all rows.
        columns: (n, ...) by name, see ``MEASURED``.
    """

    start: Ints
    columns: Mapping[str, Array]

    def __len__(self) -> int:
        """Return K."""
        return len(self.start) - 1

    def rows(self, toss: int) -> slice:
        """Return the rows of a toss."""
        return slice(int(self.start[toss]), int(self.start[toss + 1]))

    def first(self) -> dict[str, Array]:
        """Return the first row (K, ...) of each toss."""
        return {name: values[self.start[:-1]] for name, values in self.columns.items()}

    def cut(self, lengths: Ints) -> Tosses:
        """Return the first rows of the tosses, so many of each."""
        kept = np.concatenate([first + np.arange(n) for first, n in zip(self.start, lengths, strict=False)])
        start = np.concatenate([[0], np.cumsum(lengths)])
        return Tosses(start, {name: values[kept] for name, values in self.columns.items()})


def read(folder: Path, part: str) -> Tosses:
    """Read the part "fit" or "check" of a folder's tosses."""
    with np.load(folder / f"cube_{part}.npz") as found:
        columns = {name: found[name].astype(float) for name in MEASURED}
        return Tosses(found["start"].astype(np.int64), columns)


def write(path: Path, tosses: Tosses, first: Mapping[str, Array]) -> None:
    """Write tosses and their starts (K, ...), which may differ from the first frame."""
    columns = dict(tosses.columns)
    for name, values in first.items():
        columns[f"start_{name}"] = np.repeat(values, np.diff(tosses.start), axis=0)
    np.savez(path, start=tosses.start, **columns)  # type: ignore[arg-type]


def joined(parts: list[Tosses]) -> Tosses:
    """Return all tosses one after the other."""
    columns = {name: np.concatenate([each.columns[name] for each in parts]) for name in parts[0].columns}
    return Tosses(np.concatenate([[0], np.cumsum(np.concatenate([np.diff(each.start) for each in parts]))]), columns)


def simulated(count: int, folder: Path) -> Tosses:
    """Return tosses of a cube whose centre of mass is off its middle, as this engine simulates them."""
    rng, lengths = np.random.default_rng(0), np.resize([70, 60, 80], count)
    first = {
        "position": np.array([0, 0, 0.3]) + rng.normal(0, 0.02, (count, 3)),
        "orientation": Rotation.random(count, rng=rng).as_quat(scalar_first=True),
        "velocity": rng.normal(0, 0.5, (count, 3)),
        "angular_velocity": rng.normal(0, 4, (count, 3)),
    }
    empty = Tosses(
        np.concatenate([[0], np.cumsum(lengths)]),
        {name: np.repeat(values, lengths, axis=0) for name, values in first.items()},
    )
    motions = Simulator(empty, folder / "empty.npz", first).motions(TRUE)
    columns = {name: np.concatenate([each[k] for each in motions]) for k, name in enumerate(NOISE)}
    return Tosses(empty.start, dict(empty.columns) | columns)


def clearance(tosses: Tosses) -> Array:
    """Return the height (n,) of the lowest corner as measured [m]."""
    turn = Rotation.from_quat(tosses.columns["orientation"], scalar_first=True)
    return np.asarray(tosses.columns["position"][:, 2] - HALF * np.abs(turn.as_matrix()[:, 2]).sum(axis=1))


def flights(tosses: Tosses, most: int = 24) -> Ints:
    """Return how many frames (K,) of each toss are a flight, at most so many."""
    low = clearance(tosses) < NEAR
    found = [low[tosses.rows(k)] for k in range(len(tosses))]
    return np.array([min(int(np.argmax(each)) if each.any() else len(each), most) for each in found])


def tables_of(numbers: Mapping[str, float]) -> Tables:
    """Return a cube above a table, without recordings; its frame lies in its middle, its centre of mass beside it."""
    m = [numbers[f"moment{k}"] for k in range(3)]
    shape = {"box": {"size": [numbers["size"]] * 3, "edge": numbers["edge"]}}
    body = {"name": "cube", "shape": shape, "mass": MASS, "position": [0, 0, 0.5]}
    body["inertia"] = [sum(m) - each for each in m]
    return {
        "body": [body],
        "site": [{"name": "origin", "body": "cube"}],
        "contact": {name: numbers[name] for name in LAW},
        "ground": {"height": 0.0},
        "world": {"gravity": [0, 0, -GRAVITY]},
        "simulation": {"dt": 1 / RATE},
    }


def recording_of(path: Path, noise: Mapping[str, float]) -> Tables:
    """Return the recordings of a file that ``write`` made."""
    values = {"position": "origin.position", "orientation": "cube.orientation"}
    measured = [{"value": value, "columns": name, "noise": noise[name]} for name, value in values.items()]
    start = {f"cube.{name}": f"start_{name}" for name in MEASURED}
    return {"name": "toss", "files": str(path), "rows": "start", "rate": RATE, "measured": measured, "start": start}


@dataclass
class Simulator:
    """Simulates tosses for any numbers.

    Attributes:
        tosses: recorded ones.
        path: of a file that is written for the engine.
        first: (K, ...) where tosses start.
    """

    tosses: Tosses
    path: Path
    first: Mapping[str, Array]

    @cached_property
    def residuals(self) -> RecordingResiduals:
        """Return the residuals of the problem, whose variables set all numbers."""
        write(self.path, self.tosses, self.first)
        variables = [{"name": f"v{k}", "sets": sets} for k, sets in enumerate(assigned(GUESS))]
        recording = recording_of(self.path.absolute(), dict.fromkeys(NOISE, 1.0))
        return residuals_of(symphys.load(tables_of(GUESS) | {"variable": variables, "recording": [recording]}), 1)

    def motions(self, values: Mapping[str, float]) -> list[tuple[Array, Array]]:
        """Return positions (n, 3) [m] and orientations (n, 4) of the frames of each toss."""
        K = len(self.tosses)
        sampled = self.residuals.predictor.values(shared(values), np.zeros((K, 0)), list(range(K)))
        return [(each.values[:, :3], each.values[:, 3:7]) for each in sampled]

    def errors(self, values: Mapping[str, float]) -> Array:
        """Return the measure (K, 2) of each toss [%, degrees]."""
        K, found = len(self.tosses), []
        for residuals in self.residuals.residuals(shared(values), np.zeros((K, 0)), np.arange(K)):
            position, rotation = np.linalg.norm(residuals.reshape(2, -1, 3), axis=2).mean(axis=1)
            found.append((100 * position / WIDTH, np.degrees(rotation)))
        return np.array(found)


def search(fit: Simulator, evaluations: int, seed: int) -> dict[str, float]:
    """Return the numbers for which the sum of both mean errors is least, found by CMA-ES; print them as they come."""
    names, best = [*FACTORS, *STEPS], np.inf
    options = {"popsize": POPULATION, "seed": seed, "maxfevals": evaluations, "verbose": -9}
    strategy, found = cma.CMAEvolutionStrategy(np.zeros(len(names)), 1.0, options), dict[str, float]()
    while not strategy.stop():
        points = strategy.ask()
        tried = [moved(dict(zip(names, point, strict=True))) for point in points]
        merits = [float(fit.errors(numbers).mean(axis=0).sum()) for numbers in tried]
        strategy.tell(points, merits)
        if min(merits) < best:
            best, found = min(merits), tried[int(np.argmin(merits))]
            print(strategy.countevals, best, found, flush=True)
    return found


def moved(steps: Mapping[str, float]) -> dict[str, float]:
    """Return ``GUESS``, moved by so many steps of each number."""
    factors = {name: GUESS[name] * np.exp(step * steps[name]) for name, step in FACTORS.items()}
    return factors | {name: GUESS[name] + step * steps[name] for name, step in STEPS.items()}


def assigned(numbers: Mapping[str, float]) -> dict[str, list[float]]:
    """Return what of a problem variables set, and to which values."""
    moments, com = ([numbers[f"{key}{k}"] for k in range(3)] for key in ("moment", "com"))
    found = {f"contact.{name}": [numbers[name]] for name in LAW}
    found |= {"ground.offset": [numbers["height"]], "cube.edge": [numbers["edge"]]}
    return found | {"cube.size": [numbers["size"]] * 3, "cube.second_moments": moments, "cube.centre_of_mass": com}


def shared(values: Mapping[str, float]) -> Array:
    """Return the shared numbers (s,) of a problem in the order of its variables."""
    return np.concatenate(list(assigned(GUESS | dict(values)).values()))


def fly(parts: list[Tosses], path: Path, **settings: Any) -> Identification:
    """Identify all flights at once, those of the last of several parts held back; each flight has its own start."""
    flying = [each.cut(np.maximum(flights(each), LEAST)) for each in parts]
    tosses = joined(flying)
    write(path, tosses, tosses.first())
    tables = tables_of(GUESS)
    del tables["body"][0]["inertia"]  # follows the mass
    variables = [{"name": "g", "sets": "gravity[2]"}, {"name": "com", "sets": "cube.centre_of_mass"}]
    variables += [{"name": f"start_{name}", "sets": f"cube.{name}", "each": "recording"} for name in MEASURED]
    held_back = list(range(len(flying[0]), len(tosses))) or False
    recording = recording_of(path.absolute(), NOISE) | {"held_back": held_back}
    problem = symphys.load(tables | {"variable": variables, "recording": [recording]})
    return symphys.identify(problem, loss="huber", **settings)


def starts(parts: list[Tosses], found: Identification) -> list[dict[str, Array]]:
    """Return by part where tosses start (K, ...), as their flights say."""
    measured, own = joined(parts).first(), np.asarray(found.own)
    where = {name: own[:, 3 * k : 3 * k + 3] for k, name in enumerate(MEASURED)}
    turn = Rotation.from_quat(measured["orientation"], scalar_first=True) * Rotation.from_rotvec(where["orientation"])
    where["orientation"] = turn.as_quat(scalar_first=True)
    ends = np.cumsum([0, *map(len, parts)])
    return [{key: values[a:b] for key, values in where.items()} for a, b in pairwise(ends)]
