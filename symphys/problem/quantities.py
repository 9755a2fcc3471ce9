"""What variables can set and formulas can read: every named quantity of a problem, with its value in the file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from symphys.problem.model import Kind, Slot
from symphys.suggest import hint, quote

Array = NDArray[np.float64]

INPUTS = ("force", "torque")
SLOT = re.compile(r"\s*([^\[\]\s]+)\s*(?:\[\s*(-?\d{1,9})?\s*(:)?\s*(-?\d{1,9})?\s*\])?\s*")
LIMITS: dict[str, tuple[float, float]] = {
    "mass": (0.0, inf),
    "radius": (0.0, inf),
    "size": (0.0, inf),
    "length": (0.0, inf),
    "friction": (0.0, inf),
    "restitution": (0.0, 1.0),
}
"""What is physical; masses and sizes must exceed their limit."""
OPEN = ("mass", "radius", "size", "length")
LEAST_SHARE = 1e-3
"""Masses and sizes are not varied below this share of their value in the file, unless ``lower`` says so."""


class SlotError(ValueError):
    """Why a variable cannot set something."""


@dataclass(frozen=True)
class Quantity:
    """Something that a variable can set: (components,) as the file has it."""

    kind: Kind
    nominal: Array


def quantities(initial: Mapping[str, Array], parameters: Mapping[str, Array]) -> dict[str, Quantity]:
    """Every quantity by name: states at the start, inputs of bodies, then parameters."""
    found = {name: Quantity("initial", value) for name, value in initial.items()}
    bodies = dict.fromkeys(name.split(".")[0] for name in initial)
    found |= {f"{body}.{key}": Quantity("control", np.zeros(3)) for body in bodies for key in INPUTS}
    return found | {name: Quantity("parameter", value) for name, value in parameters.items()}


def read_slot(text: str, known: Mapping[str, Quantity]) -> Slot:
    """The slot that ``ball.force[0:2]`` means; SlotError says why it means none."""
    match = SLOT.fullmatch(text)
    if not match:
        raise SlotError(f'{quote(text)} is no quantity; write "ball.velocity", "ball.force[0:2]" or "ball.position[2]"')
    name, start, colon, stop = match.groups()
    if name not in known:
        raise SlotError(f"there is no quantity {quote(name)}; {unknown(name, known)}")
    count = len(known[name].nominal)
    if start is None and stop is None and colon is None:
        if "[" in text:
            raise SlotError(f"{quote(text)} has an empty index")
        return Slot(name, tuple(range(count)))
    for end in (start, stop):
        if end is not None and not -count <= int(end) <= count - (colon is None):
            raise SlotError(f"{quote(text)} reaches beyond {name}, which has {count} components, 0 to {count - 1}")
    indices = range(count)
    if colon is None:
        return Slot(name, (indices[int(start or 0)],))
    chosen = indices[slice(int(start) if start else None, int(stop) if stop else None)]
    if not chosen:
        raise SlotError(f"{quote(text)} is an empty range")
    return Slot(name, tuple(chosen))


def unknown(name: str, known: Mapping[str, Quantity]) -> str:
    """The nearest quantities; for a coefficient that no table states, how to state it."""
    owner, _, key = name.rpartition(".")
    owners = dict.fromkeys(other.rpartition(".")[0] for other in known)
    if key in ("friction", "restitution") and owner in owners:
        return f"{owner} states no {key}: give it a value there first, so that this variable has something to change"
    same_owner = [other for other in known if owner and other.startswith(f"{owner}.")]
    stated = f"; what states no {key} has none to vary" if key in ("friction", "restitution") else ""
    return hint(name, same_owner or known) + stated


def limits(slot: Slot, known: Mapping[str, Quantity]) -> tuple[Array, Array]:
    """(components,) twice: the bounds that hold where the file states none."""
    key = slot.name.rpartition(".")[2]
    low, high = (np.full(len(slot.components), limit) for limit in LIMITS.get(key, (-inf, inf)))
    if key in OPEN:
        low = LEAST_SHARE * known[slot.name].nominal[list(slot.components)]
    return low, high
