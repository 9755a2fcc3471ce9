"""How well are real impacts predicted? 570 recorded tosses of a cube, and 379 of two boxes on a hinge.

    python benchmarks/tosses.py FOLDER [--object cube] [--only a/symphys,b/mujoco] [--evaluations 600] [--out FOLDER]
    python benchmarks/tosses.py FOLDER --study flights,ablations,splits,limits [--object cube] [--evaluations 200]

FOLDER has cube_fit.npz, cube_check.npz, elbow_fit.npz and elbow_check.npz; see docs/results/tosses.md. Both engines are
fitted to the fit files by the same search, CMA-ES on the published measure with the same number of evaluations, and
scored on the check files: simulated open loop from the start, (a) as measured in the first frame, (b) as the frames
before the first contact say; means over frames, then over tosses. What has been found is kept in --out and not searched
again. --study asks what flights alone say, what each part of the cube's model is worth, and what limits the prediction.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from tosses_data import CUBE, ELBOW, Tossed, Tosses, read
from tosses_flights import flights_of, starts_of
from tosses_limits import ABLATIONS, SPLITS, ablated, limits, split
from tosses_mujoco import MujocoSimulator
from tosses_mujoco import numbers_of as numbers_of_mujoco
from tosses_search import kept, search
from tosses_symphys import CUBE_NUMBERS, ELBOW_NUMBERS, Simulator

from symphys.results.identification import summary
from symphys.types import Array

PARTS = ("fit", "check")
ENGINES, CASES = ("symphys", "mujoco"), ("a", "b")


def first_of(folder: Path, out: Path, tossed: Tossed, case: str) -> list[dict[str, Array]]:
    """Where the tosses of both parts start."""
    parts = [read(folder, tossed, part) for part in PARTS]
    return [each.first() for each in parts] if case == "a" else starts_of(tossed, parts, out / "work")


def simulator(engine: str, tossed: Tossed, tosses: Tosses, first: Mapping[str, Array], path: Path) -> Any:
    """Of an engine, with its numbers."""
    if engine == "mujoco":
        return MujocoSimulator(tossed, tosses, numbers_of_mujoco(tossed), first)
    return Simulator(tossed, tosses, CUBE_NUMBERS if tossed is CUBE else ELBOW_NUMBERS, path.absolute(), first)


def fitted(folder: Path, out: Path, tossed: Tossed, case: str, engine: str, evaluations: int) -> dict[str, Any]:
    """Fit, then score."""
    print(f"{tossed.name}, ({case}), {engine}")
    firsts = first_of(folder, out, tossed, case)
    both = [
        simulator(engine, tossed, read(folder, tossed, part), first, out / "work" / f"{tossed.name}_{case}_{part}.npz")
        for part, first in zip(PARTS, firsts, strict=True)
    ]
    found, spent = search(both[0].numbers, both[0].errors, evaluations)
    errors = {part: each.errors(found).tolist() for part, each in zip(PARTS, both, strict=True)}
    return {"numbers": found, "evaluations": spent, "errors": errors}


def table(tossed: Tossed, results: Mapping[tuple[str, str], Mapping[str, Any]]) -> str:
    """Errors of both engines, mean and standard deviation over the tosses of the check file."""
    units = {"position": "position [%]", "orientation": "rotation [deg]", "angle": "hinge [deg]"}
    lines = ["| | " + " | ".join(units[each] for each in tossed.measures) + " | processor time |"]
    lines.append("|---" * (len(tossed.measures) + 2) + "|")
    for (case, engine), found in results.items():
        cells = mean_and_spread(found["errors"]["check"])
        lines.append(f"| ({case}) {engine} | {cells} | {found['processor_seconds']:.0f} s |")
    return "\n".join(lines)


def mean_and_spread(errors: list[list[float]]) -> str:
    """Cells of a table: mean and standard deviation over tosses."""
    found = np.array(errors)
    return " | ".join(f"{m:.2f} ± {s:.1f}" for m, s in zip(found.mean(axis=0), found.std(axis=0), strict=True))


def study_flights(folder: Path, out: Path, tossed: Tossed) -> None:
    """Print what flights say."""
    starts_of(tossed, [read(folder, tossed, part) for part in PARTS], out / "work")
    print(summary(flights_of(tossed, out / "work")))


def study(folder: Path, out: Path, what: str, evaluations: int) -> None:
    """Print what the parts of the cube's model are worth, or what limits it."""
    case = "a" if what == "ablations" else "b"
    found = json.loads((out / f"cube_{case}_symphys.json").read_text())["numbers"]
    work = out / "work"
    if what == "ablations":
        for name in ABLATIONS:
            path = out / f"cube_without_{re.sub('[^a-z]+', '_', name)}.json"
            got = kept(path, lambda name=name: ablated(folder, work, found, name, evaluations))
            print(f"| {name} | {mean_and_spread(got['errors']['fit'])} | {mean_and_spread(got['errors']['check'])} |")
    elif what == "splits":
        for name in SPLITS:
            path = out / f"cube_split_{re.sub('[^a-z]+', '_', name)}.json"
            got = kept(path, lambda name=name: split(folder, work, found, name, evaluations))
            for key in ("together", "alone"):
                print(f"| {name} | {key} | {mean_and_spread(got['one'][key] + got['other'][key])} |")
            print(
                *[{each: round(value, 4) for each, value in got[half]["numbers"].items()} for half in ("one", "other")]
            )
    else:
        got = kept(out / "cube_limits.json", lambda: limits(folder, work, found, evaluations))
        for name in (name for name, each in got.items() if isinstance(each, list)):
            print(f"| {name} | {mean_and_spread(got[name])} |")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--object", default="cube,elbow")
    parser.add_argument("--only", default=",".join(f"{case}/{engine}" for case in CASES for engine in ENGINES))
    parser.add_argument("--evaluations", type=int, default=600)
    parser.add_argument("--out", type=Path, default=Path("build/tosses"))
    parser.add_argument("--study", default="", help="flights, ablations, splits, limits")
    given = parser.parse_args()
    if given.study:
        for what in given.study.split(","):
            for tossed in (each for each in (CUBE, ELBOW) if each.name in given.object.split(",")):
                if what == "flights":
                    study_flights(given.folder, given.out, tossed)
                elif tossed is CUBE:
                    study(given.folder, given.out, what, given.evaluations)
        return
    for tossed in (each for each in (CUBE, ELBOW) if each.name in given.object.split(",")):
        results = {}
        for case, engine in (each.split("/") for each in given.only.split(",")):
            path = given.out / f"{tossed.name}_{case}_{engine}.json"
            arguments = (given.folder, given.out, tossed, case, engine, given.evaluations)
            results[case, engine] = kept(path, lambda of=arguments: fitted(*of))
        print(table(tossed, results))


if __name__ == "__main__":
    main()
