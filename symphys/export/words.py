"""What the numbers are, in lines of text for headers and read-me files: places, names, units."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from symphys.problem import Problem, Slot, Variable
from symphys.state import Layout
from symphys.transcription import Transcription
from symphys.transcription.along import Rollout

UNITS = {
    "position": "m",
    "orientation": "-, unit quaternion w x y z",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "force": "N",
    "torque": "N m",
    "reaction_force": "N",
    "reaction_torque": "N m",
    "lag": "s",
    "mass": "kg",
    "radius": "m",
    "offset": "m",
    "gravity": "m/s^2",
    "friction": "-",
    "restitution": "-",
}
"""By the last part of a name; world frame."""


def unit(name: str) -> str:
    """In brackets; nothing where it is not known."""
    key = name.rpartition(".")[2]
    return f" [{UNITS[key]}]" if key in UNITS else ""


def decision_lines(problem: Problem) -> list[str]:
    """One line a variable: its place in z, what it sets."""
    sets = [(variable.guess.size, f"{variable.name}: {_sets(problem, variable)}") for variable in problem.variables]
    return _placed("z", sets)


def _sets(problem: Problem, variable: Variable) -> str:
    slots = ", ".join(_slot(problem, slot) + unit(slot.name) for slot in variable.slots)
    knots = f"; {variable.knots} knots, {variable.interpolation}, one after the other" if variable.knots > 1 else ""
    return slots + knots


def _slot(problem: Problem, slot: Slot) -> str:
    """What a slot sets; forces and torques have three components."""
    known = {**problem.initial, **problem.parameters}
    whole = len(known[slot.name]) if slot.name in known else 3
    return slot.name if len(slot.components) == whole else f"{slot.name}[{','.join(map(str, slot.components))}]"


def state_lines(rollout: Rollout) -> list[str]:
    """One line a quantity of the state."""
    layout = Layout(rollout.world)
    return _placed("x", [(layout[name].stop - layout[name].start, name + unit(name)) for name in layout.names()])


def input_lines(rollout: Rollout) -> list[str]:
    """One line an input of a step."""
    return _placed("u", [(3, name + unit(name)) for name in rollout.inputs])


def parameter_lines(rollout: Rollout) -> list[str]:
    """One line a parameter of a step."""
    names, symbols = rollout.parameters.names, rollout.parameters.symbols
    sizes = [int(symbol.shape[0]) for symbol in symbols]
    return _placed("p", [(size, name + unit(name)) for size, name in zip(sizes, names, strict=True)])


def error_names(problem: Problem) -> list[str]:
    """What each of the errors belongs to."""
    names = [f"target {target.name}" for target in problem.targets]
    names += [f"constraint {constraint.name}" for constraint in problem.constraints]
    return names + (["goal"] if problem.goal is not None else [])


def error_lines(problem: Problem) -> list[str]:
    """One line an error."""
    return _placed("errors", [(1, name) for name in error_names(problem)])


def cost_lines(problem: Problem) -> list[str]:
    """One line a cost, with its weight in it."""
    return _placed("costs", [(1, cost.name) for cost in problem.costs])


def constraint_lines(transcription: Transcription) -> list[str]:
    """One line a constraint: its values, for every step if it holds always."""
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
    """Text of a problem file for one line of a comment."""
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").split())


def indented(lines: Sequence[str], none: str = "none") -> str:
    """The lines of a list."""
    return "\n".join(f"     {line}" for line in lines) or f"     {none}"
