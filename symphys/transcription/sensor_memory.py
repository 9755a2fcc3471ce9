"""The memory of sensors: inputs and parts of the state of the previous step, stored after the world's state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import casadi as ca

from symphys.dynamics.observation import named_sensors
from symphys.expression import Formula
from symphys.model.state_layout import Layout, input_columns, input_sizes
from symphys.model.world import World
from symphys.problem import ALIVE, Constraint, Cost, Output, Problem, Target
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class SensorMemory:
    """Columns after those of the world's state (``Layout``).

    Attributes:
        world: the simulated world.
        inputs: names of the inputs that are remembered.
        states: names of the parts of the state that are remembered, such as ``torso.velocity``.
        terminates: whether the last column is ``alive``: 1 until the termination, 0 from then on; ``after`` omits it.
    """

    world: World
    inputs: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    terminates: bool = False

    @cached_property
    def columns(self) -> dict[str, slice]:
        """Map inputs and remembered parts of the state by name to their columns of the whole state."""
        layout, sizes = Layout(self.world), input_sizes(self.world)
        start, found = layout.size, dict[str, slice]()
        lengths = [(name, sizes[name]) for name in self.inputs]
        lengths += [(name, layout[name].stop - layout[name].start) for name in self.states]
        lengths += [(ALIVE, 1)] * self.terminates
        for name, length in lengths:
            found[name] = slice(start, start + length)
            start += length
        return found

    @cached_property
    def size(self) -> int:
        """Return the size of the whole state."""
        return max((part.stop for part in self.columns.values()), default=Layout(self.world).size)

    def start(self, x: Expr) -> Expr:
        """Return the whole state at t = 0, before any command and with zero accelerations."""
        layout = Layout(self.world)
        commands = [type(x).zeros(input_sizes(self.world)[name]) for name in self.inputs]
        states = [x[layout[name]] for name in self.states]
        return ca.vertcat(x, *commands, *states, *([type(x)(1)] if self.terminates else []))

    def after(self, x: Expr, u: Expr, inputs: Sequence[str]) -> Expr:
        """Return (memory,) for a step from state x with the inputs u, which stacks ``inputs``."""
        layout, columns = Layout(self.world), input_columns(self.world, inputs)
        sizes = input_sizes(self.world)
        given = [u[columns[name]] if name in columns else type(x).zeros(sizes[name]) for name in self.inputs]
        return ca.vertcat(type(x)(0, 1), *given, *(x[layout[name]] for name in self.states))

    def before(self, x: Expr) -> dict[str, Expr]:
        """Return the parts of the state and the inputs one step before by name."""
        return {name: x[self.columns[name]] for name in (*self.inputs, *self.states)}

    def commands(self, x: Expr) -> dict[str, Expr]:
        """Return the inputs of the step before by name."""
        return {name: x[self.columns[name]] for name in self.inputs}


def memory_of(problem: Problem, world: World, inputs: Sequence[str], more: Iterable[Formula] = ()) -> SensorMemory:
    """Collect the memory that the sensors of a problem need.

    ``inputs``: names of those that may act. ``more``: formulas that are read beside those of the problem.
    """
    sensed = frozenset[str]().union(*(formula.names for sensor in problem.sensors for formula in sensor.formulas))
    objectives: list[Cost | Target | Constraint | Output] = [
        *problem.costs,
        *problem.targets,
        *problem.constraints,
        *problem.outputs,
    ]
    asked = frozenset[str]().union(*(each.formula.needed for each in objectives), *(each.needed for each in more))
    margin = problem.termination.margin.names if problem.termination else frozenset[str]()
    wanted = sensed | asked | margin
    needed = dict.fromkeys(
        part for name, sensor in named_sensors(world).items() if name in wanted for part in sensor.before(world)
    )
    given = sensed | (needed.keys() & set(inputs))
    states = tuple(name for name in needed if name in Layout(world))
    remembered = tuple(name for name in input_sizes(world) if name in given)
    return SensorMemory(world, remembered, states, problem.termination is not None)
