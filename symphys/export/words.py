"""Describe vectors in lines of text for headers and read-me files: places, names, units."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from symphys.model.state_layout import Layout, input_columns, input_size
from symphys.model.world import World
from symphys.problem import DURATION, Problem, Variable, VariableSlot
from symphys.problem.quantities import quantity_unit
from symphys.transcription import Transcription
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.tangent import Tangent

PURE = {"orientation": "-, unit quaternion w x y z"}
"""Descriptions of quantities without a unit, for which a dash is not enough."""


def unit(name: str, world: World) -> str:
    """Return the unit of a quantity in brackets; nothing if it is unknown."""
    found = quantity_unit(name, world)
    return "" if found is None else f" [{found or PURE.get(name.rpartition('.')[2], '-')}]"


def decision_lines(problem: Problem) -> list[str]:
    """Describe each variable: its place in z, and the quantities that it sets."""
    world = problem.world()
    sets = [
        (variable.guess.size, f"{variable.name}: {_sets(problem, world, variable)}") for variable in problem.variables
    ]
    return _placed("z", sets)


def _sets(problem: Problem, world: World, variable: Variable) -> str:
    slots = ", ".join(_slot(problem, world, slot) + unit(slot.name, world) for slot in variable.slots)
    knots = f"; {variable.knots} knots, {variable.interpolation}, one after the other" if variable.knots > 1 else ""
    return slots + knots


def _slot(problem: Problem, world: World, slot: VariableSlot) -> str:
    """Return the quantity that a slot sets, with its components if it does not set all."""
    known = {**problem.initial, **problem.parametric.starts(), **problem.parameters, **problem.weights}
    known[DURATION] = np.zeros(1)
    whole = len(known[slot.name]) if slot.name in known else input_size(world, slot.name)
    return slot.name if len(slot.components) == whole else f"{slot.name}[{','.join(map(str, slot.components))}]"


def state_lines(rollout: Rollout) -> list[str]:
    """Describe each quantity of the state x."""
    layout, world = Layout(rollout.world), rollout.world
    parts = [(name + unit(name, world), layout[name]) for name in layout.names()]
    parts += [(f"{name}{unit(name, world)}, one step before", part) for name, part in rollout.memory.columns.items()]
    return _placed("x", [(part.stop - part.start, text) for text, part in parts])


def input_lines(rollout: Rollout) -> list[str]:
    """Describe each input u of a step."""
    columns, world = input_columns(rollout.world, rollout.inputs), rollout.world
    return _placed("u", [(part.stop - part.start, name + unit(name, world)) for name, part in columns.items()])


def tangent_lines(tangent: Tangent) -> list[str]:
    """Describe each coordinate of the tangent of states; rotation vectors are in the world frame."""
    return _placed("t", [(1, name) for name in tangent.names])


def parameter_lines(rollout: Rollout) -> list[str]:
    """Describe each parameter p of a step."""
    names, symbols = rollout.parameters.names, rollout.parameters.symbols
    sizes = [int(symbol.shape[0]) for symbol in symbols]
    return _placed("p", [(size, name + unit(name, rollout.world)) for size, name in zip(sizes, names, strict=True)])


def error_names(problem: Problem) -> list[str]:
    """Return the target, constraint or goal of each error."""
    names = [f"target {target.name}" for target in problem.targets]
    names += [f"constraint {constraint.name}" for constraint in problem.constraints]
    return names + (["goal"] if problem.goal is not None else [])


def error_lines(problem: Problem) -> list[str]:
    """Describe each error."""
    return _placed("errors", [(1, name) for name in error_names(problem)])


def output_lines(problem: Problem) -> list[str]:
    """Describe each output."""
    return _placed("outputs", [(1, output.label) for output in problem.outputs])


def cost_lines(problem: Problem) -> list[str]:
    """Describe each weighted cost."""
    return _placed("costs", [(1, cost.name) for cost in problem.costs])


def constraint_lines(transcription: Transcription) -> list[str]:
    """Describe the values of each constraint, one for each instant at which it holds."""
    counts: dict[str, int] = {}
    for name in transcription.terms.names:
        counts[name] = counts.get(name, 0) + 1
    return _placed("constraints", [(count, name) for name, count in counts.items()])


def _placed(vector: str, parts: Iterable[tuple[int, str]]) -> list[str]:
    lines, start = [], 0
    for size, text in parts:
        span = f"{vector}[{start}]" if size == 1 else f"{vector}[{start}..{start + size - 1}]"
        lines.append(f"{span:<18} {one_line(text)}")
        start += size
    return lines


def one_line(text: str) -> str:
    """Fit a text of a problem file into one line of a C comment."""
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").split())


def indented(lines: Sequence[str], none: str = "none") -> str:
    """Indent the lines of a list."""
    return "\n".join(f"     {line}" for line in lines) or f"     {none}"
