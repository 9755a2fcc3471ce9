"""What variables can set and formulas can read: every named quantity of a problem, with its value in the file."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from symphys.model.state_layout import input_sizes
from symphys.problem.feedback import FeedbackController
from symphys.problem.model import DURATION, Kind, ProblemData, Variable, VariableSlot
from symphys.problem.parametric.parts import VARIABLE
from symphys.problem.parametric.world import ParametricWorld
from symphys.suggest import hint, quote

Array = NDArray[np.float64]

SLOT = re.compile(r"\s*([^\[\]\s]+)\s*(?:\[\s*(-?\d{1,9})?\s*(:)?\s*(-?\d{1,9})?\s*\])?\s*")
LIMITS: dict[str, tuple[float, float]] = {
    "mass": (0.0, inf),
    "radius": (0.0, inf),
    "size": (0.0, inf),
    "length": (0.0, inf),
    "duration": (0.0, inf),
    **VARIABLE,
}
"""What is physical; masses and sizes must exceed their limit."""
ACTING = ("gain", "torque", "velocity", "range", "stiffness", "damping")
"""Parameters of motors and springs, which must not be negative."""
OPEN = ("mass", "radius", "size", "length", "duration")
LEAST_SHARE = 1e-3
"""Masses and sizes are not varied below this share of their value in the file, unless ``lower`` says so."""


class SlotError(ValueError):
    """Why a variable cannot set something."""


@dataclass(frozen=True)
class Quantity:
    """Something that a variable can set: (components,) as the file has it.

    ``own_scale``: whether it typically changes by its own size, as parameters do. ``like``: the parameter in whose
    place it stands; None for what stands for itself. ``ends``: least and largest value, where its name does not say.
    """

    kind: Kind
    nominal: Array
    own_scale: bool = False
    like: str | None = None
    ends: tuple[float, float] | None = None


def quantities(
    initial: Mapping[str, Array], parameters: Mapping[str, Array], inputs: Mapping[str, int]
) -> dict[str, Quantity]:
    """Every quantity of a world by name: states at the start, inputs with their sizes, then parameters."""
    found = {name: Quantity("initial", value) for name, value in initial.items()}
    found |= {name: Quantity("control", np.zeros(size)) for name, size in inputs.items()}
    return found | {name: Quantity("parameter", value, own_scale=True) for name, value in parameters.items()}


def start_quantities(parametric: ParametricWorld) -> dict[str, Quantity]:
    """Coordinates of joints at the start, within the limits of the joints, and their rates."""
    found = {name: Quantity("initial", value) for name, value in parametric.starts().items()}
    for joint in parametric.joints:
        name, low, high = f"{joint.name}.start", joint.limits.lower, joint.limits.upper
        if name in found:
            found[name] = replace(found[name], ends=(-inf if low is None else low, inf if high is None else high))
    return found


def duration_quantity(duration: float) -> dict[str, Quantity]:
    """How long the motion takes [s]."""
    return {DURATION: Quantity("duration", np.array([duration]), own_scale=True)}


def weight_quantities(controllers: Iterable[FeedbackController]) -> dict[str, Quantity]:
    """The numbers of controllers by name, such as ``brain.weights``."""
    return {name: Quantity("weight", value) for controller in controllers for name, value in controller.weights.items()}


def read_slot(text: str, known: Mapping[str, Quantity]) -> VariableSlot:
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
        return VariableSlot(name, tuple(range(count)))
    for end in (start, stop):
        if end is not None and not -count <= int(end) <= count - (colon is None):
            raise SlotError(f"{quote(text)} reaches beyond {name}, which has {count} components, 0 to {count - 1}")
    indices = range(count)
    if colon is None:
        return VariableSlot(name, (indices[int(start or 0)],))
    chosen = indices[slice(int(start) if start else None, int(stop) if stop else None)]
    if not chosen:
        raise SlotError(f"{quote(text)} is an empty range")
    return VariableSlot(name, tuple(chosen))


def unknown(name: str, known: Collection[str]) -> str:
    """The nearest quantities; for a coefficient that no table states, how to state it."""
    owner, _, key = name.rpartition(".")
    owners = dict.fromkeys(other.rpartition(".")[0] for other in known)
    if key in VARIABLE and owner in owners:
        return f"{owner} states no {key}: give it a value there first, so that this variable has something to change"
    same_owner = [other for other in known if owner and other.startswith(f"{owner}.")]
    stated = f"; what states no {key} has none to vary" if key in VARIABLE else ""
    return hint(name, same_owner or known) + stated


def set_quantities(problem: ProblemData, variable: Variable) -> str:
    """What a variable sets, as a file writes it; all that a list names gets the same values, which may not be meant."""
    values = {**problem.initial, **problem.parametric.starts(), **problem.parameters, **problem.weights}
    sizes = {DURATION: 1, **{name: value.size for name, value in values.items()}, **input_sizes(problem.world())}

    def text(slot: VariableSlot) -> str:
        first, count = slot.components[0], len(slot.components)
        if count == sizes[slot.name]:
            return slot.name
        return f"{slot.name}[{first}]" if count == 1 else f"{slot.name}[{first}:{first + count}]"

    *others, last = map(text, variable.slots)
    return f"{', '.join(others)} and {last} to the same values" if others else last


def physical(name: str, kind: Kind) -> tuple[float, float]:
    """Least and largest value of a quantity that is physical."""
    key = name.rpartition(".")[2]
    return (0.0, inf) if kind == "parameter" and key in ACTING else LIMITS.get(key, (-inf, inf))


def allowed(name: str, quantity: Quantity) -> tuple[float, float]:
    """Least and largest value that a quantity may have."""
    if quantity.ends is not None:
        return quantity.ends
    return physical(name, quantity.kind) if quantity.like is None else physical(quantity.like, "parameter")


def limits(slot: VariableSlot, known: Mapping[str, Quantity]) -> tuple[Array, Array]:
    """(components,) twice: the bounds that hold where the file states none."""
    key = slot.name.rpartition(".")[2]
    ends = allowed(slot.name, known[slot.name])
    low, high = (np.full(len(slot.components), limit) for limit in ends)
    if key in OPEN:
        low = LEAST_SHARE * known[slot.name].nominal[list(slot.components)]
    return low, high
