"""What each part of the model of the cube is worth, and what limits it: starts, numbers or the law of contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from tosses_data import CUBE, Tosses, angles_between, flights, mean_errors, read
from tosses_flights import flights_of, starts_of
from tosses_search import Number, search
from tosses_symphys import CUBE_NUMBERS, HALF, MOMENT, RESTITUTION, Options, Simulator

from symphys.types import Array, Bools

NARROW = 0.5
"""A search that goes on from what was found begins with this share of the first steps."""
SOFT = ("frequency", "damping")
COM, MOMENTS = tuple(f"com{k}" for k in range(3)), tuple(f"moment{k}" for k in range(3))
ABLATIONS: dict[str, tuple[dict[str, float], Options]] = {
    "everything": ({}, Options()),
    "rigid, with restitution": ({}, Options(without=SOFT)),
    "lengths as published, g = 9.81": ({"size": 2 * HALF}, Options(gravity=9.81)),
    "sharp edges": ({"edge": 0.0}, Options()),
    "centre of mass in the middle": (dict.fromkeys(COM, 0.0), Options()),
    "published inertia": (dict.fromkeys(MOMENTS, MOMENT / 2), Options()),
    "table at height 0": ({"height": 0.0}, Options()),
    "no torsional friction": ({}, Options(without=("torsion",))),
    "no rolling friction": ({}, Options(without=("rolling",))),
    "half the time step": ({}, Options(substeps=2)),
}
"""By name what is held at a value, and what else is changed."""


def refined(found: Mapping[str, float], fixed: Mapping[str, float], without: Sequence[str]) -> list[Number]:
    """The numbers of a search that begins where another one ended."""
    numbers = [each for each in CUBE_NUMBERS if each.name not in fixed and each.name not in without]
    if "frequency" in without:
        numbers.append(RESTITUTION)
    return [replace(each, guess=found.get(each.name, each.guess), step=NARROW * each.step) for each in numbers]


def ablated(folder: Path, work: Path, found: Mapping[str, float], name: str, evaluations: int) -> dict[str, Any]:
    """Fit again without a part of the model, and score; starts as measured."""
    fixed, options = ABLATIONS[name]
    numbers, errors = refined(found, fixed, options.without), {}
    both = []
    for part in ("fit", "check"):
        tosses, path = read(folder, CUBE, part), (work / f"ablated_{part}.npz").absolute()
        both.append(Simulator(CUBE, tosses, numbers, path, tosses.first(), fixed, options))
    best, spent = search(numbers, both[0].errors, evaluations)
    for part, each in zip(("fit", "check"), both, strict=True):
        errors[part] = each.errors(best).tolist()
    return {"numbers": best, "evaluations": spent, "errors": errors}


def moved_starts(first: Mapping[str, Array], errors: Mapping[str, Array], seed: int) -> dict[str, Array]:
    """Starts that are off by as much as their standard errors say."""
    random = np.random.default_rng(seed)
    off = {name: each * random.standard_normal(each.shape) for name, each in errors.items()}
    turn = Rotation.from_quat(first["orientation"], scalar_first=True) * Rotation.from_rotvec(off["orientation"])
    found = {name: first[name] + off[name] for name in ("position", "velocity", "angular_velocity")}
    return found | {"orientation": turn.as_quat(scalar_first=True)}


def apart(tosses: Tosses, one: Simulator, other: Simulator, values: Mapping[str, float]) -> Array:
    """(K, 2): the published measure between two simulations of the same tosses."""
    motions = [each.motions(values) for each in (one, other)]
    errors = [(np.linalg.norm(a[0] - b[0], axis=1), angles_between(a[1], b[1])) for a, b in zip(*motions, strict=True)]
    return mean_errors(CUBE, tosses, errors)


def impact_speeds(tosses: Tosses) -> tuple[Array, Array]:
    """(K,) [m/s] downwards and (K, 2) [m/s] along the table before the first impact, of the cube's middle."""
    last = tosses.start[:-1] + np.maximum(flights(CUBE, tosses) - 1, 0)
    velocity = tosses.columns["velocity"][last]
    return -velocity[:, 2], velocity[:, :2]


SPLITS = ("fast and slow impacts", "along x and along y", "forwards and backwards", "odd and even, by chance")
"""Ways to split tosses in two."""


def halves(tosses: Tosses) -> dict[str, Bools]:
    """By way of ``SPLITS`` which tosses are in the one half; a richer law could tell them from the others."""
    down, along = impact_speeds(tosses)
    angle = np.degrees(np.arctan2(along[:, 1], along[:, 0]))
    fast, sideways = down > np.median(down), np.abs(along[:, 0]) > np.abs(along[:, 1])
    return dict(zip(SPLITS, (fast, sideways, np.abs(angle) < 90, np.arange(len(tosses)) % 2 == 1), strict=True))


PARTS = ("fit", "check")


def from_flights(folder: Path, work: Path) -> tuple[dict[str, Tosses], dict[str, dict[str, Array]]]:
    """The tosses of both parts, and where they start as their flights say."""
    tosses = {part: read(folder, CUBE, part) for part in PARTS}
    return tosses, dict(zip(PARTS, starts_of(CUBE, list(tosses.values()), work), strict=True))


def split(folder: Path, work: Path, found: Mapping[str, float], name: str, evaluations: int) -> dict[str, Any]:
    """The law fitted to each half alone: what would a law gain that tells the halves apart?"""
    law = ("friction", *SOFT, "torsion", "rolling")
    fixed = {key: value for key, value in found.items() if key not in law}
    numbers, results = refined(found, fixed, ()), dict[str, Any]()
    tosses, first = from_flights(folder, work)
    for half, of in (("one", True), ("other", False)):
        sides = {}
        for part in PARTS:
            which = np.flatnonzero(halves(tosses[part])[name] == of)
            start = {key: values[which] for key, values in first[part].items()}
            path = (work / f"half_{half}_{part}.npz").absolute()
            sides[part] = Simulator(CUBE, tosses[part].only(which), numbers, path, start, fixed)
        best, _ = search(numbers, sides["fit"].errors, evaluations)
        together, alone = sides["check"].errors(found), sides["check"].errors(best)
        results[half] = {"numbers": best, "together": together.tolist(), "alone": alone.tolist()}
    return results


def limits(folder: Path, work: Path, found: Mapping[str, float], evaluations: int) -> dict[str, Any]:
    """How far errors of starts alone move simulated tosses, and what a fit to the check file itself would reach."""
    tosses, first = from_flights(folder, work)
    numbers = refined(found, {}, ())

    def starting(part: str, which: Array, start: Mapping[str, Array], name: str) -> tuple[Tosses, Simulator]:
        path, some = (work / f"limits_{name}.npz").absolute(), tosses[part].only(which)
        return some, Simulator(CUBE, some, numbers, path, {key: values[which] for key, values in start.items()})

    errors = flights_of(CUBE, work).own_error[: len(tosses["fit"])]
    names = ("position", "orientation", "velocity", "angular_velocity")
    parts = {name: errors[:, 3 * k : 3 * k + 3] for k, name in enumerate(names)}
    known = np.flatnonzero(np.isfinite(errors).all(axis=1))
    moved = []
    for seed in range(5):
        some, one = starting("fit", known, first["fit"], "known")
        other = starting("fit", known, moved_starts(first["fit"], parts, seed), "moved")[1]
        moved.append(apart(some, one, other, found))
    every = np.arange(len(tosses["check"]))
    check, exact = starting("check", every, first["check"], "flown")
    measured = starting("check", every, tosses["check"].first(), "measured")[1]
    best, _ = search(numbers, exact.errors, evaluations)
    return {
        "starts as measured against starts of flights": apart(check, exact, measured, found).tolist(),
        "starts of flights, moved by their errors": np.concatenate(moved).tolist(),
        "tosses with known errors of their start": len(known),
        "fitted to the fit file": exact.errors(found).tolist(),
        "fitted to the check file itself": exact.errors(best).tolist(),
    }
