"""Numbers that differ between samples of a scenario or problems of a sweep, as variables that no solver chooses."""

from __future__ import annotations

import numpy as np

from symphys.problem import Problem, RandomizedQuantity, Variable, VariableSlot
from symphys.transcription.formula_names import swept_parameters
from symphys.types import Array

LEAST = 0.05
"""Of a factor, however wide the draws are made."""


class QuantitySampler:
    """The draws of one table."""

    def __init__(self, problem: Problem, varied: RandomizedQuantity) -> None:
        """Look up what the numbers are without it."""
        self.varied, self.steps = varied, problem.simulation.steps
        self.lasts = max(1, round(varied.lasts / problem.simulation.dt)) if varied.lasts else self.steps
        values = {**problem.initial, **problem.parametric.starts(), **problem.parameters, **problem.weights}
        size = len(varied.slots[0].components)
        blank = np.zeros(1 + max(max(slot.components) for slot in varied.slots))
        found = [values.get(slot.name, blank)[list(slot.components)] for slot in varied.slots]
        self.base = np.stack(found)
        knots = self.steps if varied.kind == "control" else 1
        self.variables = tuple(
            hidden(f"{varied.name}:{slot.name}", varied.kind, slot, np.tile(each, knots), knots)
            for slot, each in zip(varied.slots, self.base, strict=True)
        )
        self.shape = (len(varied.slots), size)

    def draw(self, rng: np.random.Generator, count: int, width: float) -> Array:
        """(count, numbers of the variables)."""
        varied, (slots, size) = self.varied, self.shape
        drawn = width * rng.uniform(-1, 1, (count, 1, 1) if varied.alike else (count, slots, size))
        factor = np.maximum(1 + varied.factor * drawn, LEAST)
        values = np.clip(self.base * factor + varied.shift * drawn, varied.lower, varied.upper)
        values = np.broadcast_to(values, (count, slots, size))
        if varied.kind != "control":
            return values.reshape(count, -1)
        return (values[:, :, None] * self.acting(rng, count)[:, None, :, None]).reshape(count, -1)

    def acting(self, rng: np.random.Generator, count: int) -> Array:
        """(count, steps) 1 in the steps in which an input acts."""
        first = np.floor(rng.uniform(0, 1, count) * (self.steps - self.lasts + 1))
        step = np.arange(self.steps)
        return ((step >= first[:, None]) & (step < first[:, None] + self.lasts)).astype(float)


def hidden(name: str, kind: str, slot: VariableSlot, guess: Array, knots: int = 1) -> Variable:
    """A variable that no solver sees."""
    none, one = np.full(guess.size, np.inf), np.ones(guess.size)
    return Variable(name, kind, (slot,), knots, "constant", guess, -none, none, one, 0 * one)  # type: ignore[arg-type]


def swept_inputs(problem: Problem) -> tuple[Variable, ...]:
    """A variable for each parameter in which the problems of its sweep differ, and that no variable of its own sets."""
    own = {slot.name for variable in problem.variables for slot in variable.slots}
    values = {name: problem.parameters[name] for name in swept_parameters(problem) if name not in own}
    return tuple(
        hidden(f"{name} of the sweep", "parameter", VariableSlot(name, tuple(range(value.size))), value)
        for name, value in values.items()
    )
