"""How large a number of a file may be, so that differences, squares and products with others stay finite."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from symphys.problem.reading.faults import Faults, Place

LARGEST = 1e150
"""Largest absolute value of a number; its square is finite."""
TOO_LARGE = f"is too large to be computed with; numbers are from {-LARGEST:g} to {LARGEST:g}"
OWN = ("solver", "recording")
"""Tables that are not checked: their numbers go to libraries, or have a range of their own."""
APART = ("axis", "axes", "normal", "mass", "density", "inertia", "noise")
"""Keys that are not checked: directions, whose length does not matter, and numbers with a range of their own."""
MOST = 3
"""Largest number of faults of one table that are named."""


def check_range(data: Mapping[str, Any], faults: Faults) -> None:
    """Name the finite numbers of a file that are too large."""
    for key, table in data.items():
        if key in OWN:
            continue
        for count, (place, value) in enumerate(_beyond((key,), table)):
            if count < MOST:
                faults.add(place, f"{_shown(value)} {TOO_LARGE}")


def _beyond(place: Place, value: Any) -> Iterator[tuple[Place, float]]:
    """The numbers beyond the range, with their places."""
    stack: list[tuple[tuple[str | int, ...], Any]] = [(tuple(place), value)]
    while stack:
        where, here = stack.pop()
        if isinstance(here, Mapping):
            stack += [((*where, str(key)), each) for key, each in reversed(list(here.items())) if key not in APART]
        elif isinstance(here, list | tuple):
            stack += [((*where, k), each) for k, each in reversed(list(enumerate(here)))]
        elif isinstance(here, int | float) and LARGEST < abs(here) < math.inf:
            yield where, here


def _shown(value: float) -> str:
    """A number in a few characters."""
    return f"{value:g}" if isinstance(value, float) or abs(value) < 2**1000 else "an integer of over 300 digits"
