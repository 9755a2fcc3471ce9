"""The identified numbers: of variables, shared by all recordings or own to each."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from symphys.identification import FitParameters
from symphys.problem import Problem, Variable
from symphys.problem.quantities import formula_units
from symphys.records import dataclass
from symphys.types import Array, Ints

JOINT_FRICTION = "dry_friction"
"""The name of joint friction in advice: other recordings determine it than the friction of a surface."""
ORIENTATION_SCALE = 0.1
"""Scale of changes of an orientation [rad]."""


@dataclass(frozen=True)
class NumberBlock:
    """The numbers of one variable.

    Attributes:
        variable: of the problem.
        first: where they begin among the shared numbers, or among those of a recording.
        where: (components,) their places in the simulation's z.
        recorded: whether recordings say where they begin; a prior then is about that.
    """

    variable: Variable
    first: int
    where: Ints
    recorded: bool = False

    @cached_property
    def turns(self) -> bool:
        """Whether the numbers are a rotation vector (3,) [rad] from the start orientation, in the body's frame."""
        return self.variable.slots[0].name.endswith(".orientation") and self.variable.components == 4

    @cached_property
    def count(self) -> int:
        """Return how many numbers the block has."""
        return 3 if self.turns else len(self.where)

    @cached_property
    def part(self) -> slice:
        """Return the slice of the numbers among shared or own ones."""
        return slice(self.first, self.first + self.count)


def number_blocks(problem: Problem, start: int) -> tuple[tuple[NumberBlock, ...], tuple[NumberBlock, ...]]:
    """Return the blocks of shared variables, and those of variables with a value for each recording."""
    found: dict[bool, list[NumberBlock]] = {False: [], True: []}
    for variable in problem.variables:
        blocks = found[variable.each]
        first = blocks[-1].part.stop if blocks else 0
        name = variable.slots[0].name
        recorded = variable.each and any(name in {**each.start, **each.coordinates} for each in problem.recordings)
        blocks.append(NumberBlock(variable, first, start + np.arange(variable.guess.size), recorded))
        start += variable.guess.size
    return tuple(found[False]), tuple(found[True])


def fit_numbers(problem: Problem, blocks: Sequence[NumberBlock], guess: Array) -> FitParameters:
    """Return the numbers with bounds, scales and priors; ``guess`` (n,) or (K, n)."""
    world = problem.world()
    columns: dict[str, list[Array]] = {key: [] for key in ("lower", "upper", "scale", "mean", "deviation")}
    names, sets, units = list[str](), list[str](), list[str]()
    frictions = {f"{joint.name}.friction" for joint in world.joints}
    for block in blocks:
        variable, slot = block.variable, block.variable.slots[0]
        labels = axes(variable.name, block.count)
        names += labels
        sets += [JOINT_FRICTION if slot.name in frictions else slot.name] * len(labels)
        unit = formula_units(world, (), [variable]).get(variable.name, "")
        units += ["rad" if block.turns else unit] * len(labels)
        for key, numbers in numbers_of(block).items():
            columns[key].append(numbers)
    joined = {key: np.concatenate([np.zeros(0), *parts]) for key, parts in columns.items()}
    spread = {key: np.broadcast_to(numbers, guess.shape).copy() for key, numbers in joined.items()}
    for block in blocks:
        if block.recorded:
            spread["mean"][..., block.part] += guess[..., block.part]
    return FitParameters(
        names=tuple(names),
        guess=np.clip(guess, spread["lower"], spread["upper"]),
        lower=spread["lower"],
        upper=spread["upper"],
        scale=spread["scale"],
        prior_mean=spread["mean"],
        prior_deviation=spread["deviation"],
        quantities=tuple(sets),
        units=tuple(units),
    )


def numbers_of(block: NumberBlock) -> dict[str, Array]:
    """Return bounds, scale and prior of the numbers of a block."""
    variable, free = block.variable, np.full(block.count, np.inf)
    if block.turns:
        deviation = free if variable.prior is None else np.full(3, float(variable.prior[1].max()))
        zero = np.zeros(3)
        return {"lower": -free, "upper": free, "scale": zero + ORIENTATION_SCALE, "mean": zero, "deviation": deviation}
    mean, deviation = (np.zeros(block.count), free) if variable.prior is None else variable.prior
    return {
        "lower": variable.lower,
        "upper": variable.upper,
        "scale": variable.scale,
        "mean": np.asarray(mean, float),
        "deviation": np.asarray(deviation, float),
    }


def axes(name: str, count: int) -> list[str]:
    """Write ``size[0]``, ``size[1]``; the name alone of one number."""
    return [name] if count == 1 else [f"{name}[{k}]" for k in range(count)]
