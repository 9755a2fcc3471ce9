"""What a formula's names mean at one instant of a rollout, and the symbols that stand for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.expression import Formula
from symphys.problem import Problem, Variable
from symphys.state import GIVEN, Layout, input_columns, input_sizes, inputs_size
from symphys.step import joint_quantities, joint_quantity_names
from symphys.world import World

Expr = Any
"""casadi SX or MX"""


@dataclass(frozen=True)
class Instant:
    """The arguments that a formula may depend on, SX: state, inputs, parameters, time, the whole of z."""

    x: Expr
    u: Expr
    p: Expr
    time: Expr
    z: Expr

    def arguments(self) -> list[Expr]:
        """In the order in which compiled formulas take them."""
        return [self.x, self.u, self.p, self.time, self.z]


@dataclass(frozen=True)
class Parameters:
    """The physical parameters that variables set: p stacks their symbols.

    Attributes:
        names: in the order of p.
        symbols: SX, one column each.
        nominal: their values in the file.
    """

    names: tuple[str, ...]
    symbols: tuple[Expr, ...]
    nominal: tuple[Expr, ...]


def varied_parameters(problem: Problem) -> Parameters:
    """The parameters that some variable sets, in the order of first mention."""
    names = tuple(dict.fromkeys(slot.name for v in problem.variables if v.kind == "parameter" for slot in v.slots))
    nominal = tuple(ca.DM(problem.parameters[name]) for name in names)
    symbols = tuple(ca.SX.sym(name, value.shape[0]) for name, value in zip(names, nominal, strict=True))
    return Parameters(names, symbols, nominal)


def input_names(problem: Problem) -> tuple[str, ...]:
    """The forces, torques and commands that some variable sets, in the order of first mention."""
    return tuple(dict.fromkeys(slot.name for v in problem.variables if v.kind == "control" for slot in v.slots))


def compile_formula(
    problem: Problem, world: World, inputs: Sequence[str], parameters: Parameters, formula: Formula, n: int
) -> ca.Function:
    """A formula as a casadi function of (x, u, p, time, z)."""
    at = Instant(
        ca.SX.sym("x", Layout(world).size),
        ca.SX.sym("u", inputs_size(world, inputs)),
        ca.vertcat(ca.SX(0, 1), *parameters.symbols),
        ca.SX.sym("time"),
        ca.SX.sym("z", n),
    )
    names = _namespace(problem, world, inputs, parameters, at)
    if not formula.names.isdisjoint(joint_quantity_names(world)):
        names.update(joint_quantities(world, at.x))
    value = formula.evaluate({name: names[name] for name in formula.names})
    return ca.Function("formula", at.arguments(), [ca.SX(value)])


def _namespace(
    problem: Problem, world: World, inputs: Sequence[str], parameters: Parameters, at: Instant
) -> dict[str, Expr]:
    layout = Layout(world)
    names: dict[str, Expr] = {"time": at.time}
    for body in world.bodies:
        names.update({f"{body.name}.{field}": at.x[layout[f"{body.name}.{field}"]] for field in GIVEN})
    names.update({name: ca.SX.zeros(size) for name, size in input_sizes(world).items()})
    names.update({name: at.u[part] for name, part in input_columns(world, inputs).items()})
    names.update({name: ca.DM(value) for name, value in problem.parameters.items()})
    names.update(zip(parameters.names, parameters.symbols, strict=True))
    for variable, (start, stop) in zip(problem.variables, spans(problem.variables), strict=True):
        names[variable.name] = at.z[start:stop]
    return names


def moving_names(world: World) -> frozenset[str]:
    """The names that change within a step."""
    states = {f"{body.name}.{field}" for body in world.bodies for field in GIVEN}
    return frozenset({"time", *states, *joint_quantity_names(world)})


def spans(variables: Sequence[Variable]) -> list[tuple[int, int]]:
    """(start, stop) of each variable in z."""
    result, start = [], 0
    for variable in variables:
        result.append((start, start + variable.guess.size))
        start += variable.guess.size
    return result
