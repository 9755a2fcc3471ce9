"""The runs beside a run in its batch: other seeds, other solvers, and the next settings of a sweep."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

from symphys.results.discovery import is_run_folder

RUN = re.compile(r"(.+)-seed(\d+)")
NUMBER = re.compile(r"(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)")
MOST_SOLVERS = 8


def neighbours(folder: Path, page: str) -> list[tuple[str, str]]:
    """Return what to call the runs beside one, and the addresses of their pages seen from its own.

    ``page``: what the page of a run is called in its folder.
    """
    folder = folder.resolve()
    named = RUN.fullmatch(folder.name)
    if named is None:
        return []
    solver, seed = named[1], int(named[2])
    case = folder.parent
    runs = [(each[1], int(each[2])) for each in map(RUN.fullmatch, inside(case)) if each]
    found = [
        (f"seed {each}", Path(f"{solver}-seed{each}"))
        for each in beside(sorted(number for name, number in runs if name == solver), seed)
    ]
    others = {name: min(number for each, number in runs if each == name) for name, _ in runs if name != solver}
    found += [(name, Path(f"{name}-seed{others[name]}")) for name in sorted(others)[:MOST_SOLVERS]]
    found += [(setting, Path("..") / name / folder.name) for setting, name in next_settings(case)]
    return [
        (title, quote((Path("..") / place / page).as_posix())) for title, place in found if is_run_folder(case / place)
    ]


def next_settings(case: Path) -> list[tuple[str, str]]:
    """Return the folders next to ``case`` in one setting and like it in all others, each with that setting."""
    problem, _, words = case.name.partition("@")
    parts, found = words.split(","), list[tuple[str, str]]()
    others = [
        (name, name.partition("@")[2].split(",")) for name in inside(case.parent) if name.startswith(f"{problem}@")
    ]
    for k, part in enumerate(parts):
        key = part.partition("=")[0]
        along = {
            other[k]: name
            for name, other in others
            if len(other) == len(parts) and other[:k] + other[k + 1 :] == parts[:k] + parts[k + 1 :]
        }
        ordered = sorted((each for each in along if each.startswith(f"{key}=")), key=by_numbers)
        found += [(each, along[each]) for each in beside(ordered, part)]
    return found


def beside(ordered: Sequence[Any], one: Any) -> list[Any]:
    """Return what comes before and after ``one``; nothing where it is not there."""
    if one not in ordered:
        return []
    at = ordered.index(one)
    return [*ordered[max(at - 1, 0) : at], *ordered[at + 1 : at + 2]]


def by_numbers(name: str) -> list[tuple[int, float, str]]:
    """Return a key that orders names by the numbers in them."""
    parts = NUMBER.split(name)
    return [(0, float(part), "") if NUMBER.fullmatch(part) else (1, 0.0, part) for part in parts]


def inside(folder: Path) -> tuple[str, ...]:
    """Return the names in a folder; none where it cannot be read."""
    try:
        return _inside(folder, folder.stat().st_mtime_ns)
    except OSError:
        return ()


@lru_cache(maxsize=64)
def _inside(folder: Path, _changed: int) -> tuple[str, ...]:
    return tuple(sorted(each.name for each in folder.iterdir()))
