"""What can be read of a world at its start: gaps, joints, quantities in formulas.

Building these as expressions takes most of the time of reading a problem. So they are built as functions of the
parameters in which worlds have differed so far, and evaluated for every further world of the same structure.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.kept import structure
from symphys.dynamics.observation import NamedSensor, SensedState, gap_function, joint_readings, named_sensors
from symphys.model.state_layout import GIVEN, Layout, initial_state, input_sizes
from symphys.model.world import World
from symphys.problem.parametric.parts import DISTRIBUTION
from symphys.problem.parametric.world import ParametricWorld
from symphys.types import Array, Expr

MOST_KEPT = 8
"""How many structures of worlds are kept at once."""


class StartFunctions:
    """Functions of a state x and of parameters p, of worlds of one structure; each is built when first asked for."""

    def __init__(self, world: World, parameters: list[Any]) -> None:
        """``parameters``: the symbols in the world."""
        self.world = world
        self.parameters = parameters
        self.x = ca.SX.sym("x", Layout(world).size)
        self._sensed: dict[str, ca.Function] = {}

    @cached_property
    def gaps(self) -> ca.Function:
        """(pairs,) [m]."""
        return gap_function(self.world, self.parameters)

    @cached_property
    def sensors(self) -> dict[str, NamedSensor]:
        """The sensors of the world, by name."""
        return named_sensors(self.world)

    def sensor(self, name: str) -> ca.Function:
        """(x, p) -> what a sensor reads of bodies that are not accelerated, on which no input has acted."""
        if name not in self._sensed:
            self._sensed[name] = self._function("sensor", [self.sensors[name].read(self._still)])
        return self._sensed[name]

    @cached_property
    def _still(self) -> SensedState:
        layout = Layout(self.world)
        before: dict[str, Expr] = {name: ca.SX.zeros(size) for name, size in input_sizes(self.world).items()}
        return SensedState(self.world, self.x, before | {name: self.x[layout[name]] for name in layout.names()})

    @cached_property
    def joints(self) -> ca.Function:
        """Return a function for the separation, tilt and coordinates of each joint."""
        found = self._still.shared(joint_readings).values()
        return self._function("joints", [part for each in found for part in (each.separation, each.tilt, each.value)])

    def _function(self, name: str, values: list[Any]) -> ca.Function:
        return ca.Function(name, [self.x, ca.vertcat(ca.SX(0, 1), *self.parameters)], [ca.SX(each) for each in values])


@dataclass(frozen=True)
class Start:
    """A world at its start, by functions of its structure at a state x and parameters p."""

    functions: StartFunctions
    x: Any
    p: Any

    @property
    def world(self) -> World:
        """The world, in which symbols stand for parameters."""
        return self.functions.world

    def gaps(self) -> Array:
        """(pairs,) [m]."""
        return np.array(self.functions.gaps(self.x, self.p)).ravel()

    def quantities(self) -> dict[str, Callable[[], Expr]]:
        """Map names of sensors to functions that return their readings; see ``Formula.evaluate``."""
        return {name: partial(self.sensed, name) for name in self.functions.sensors}

    def sensed(self, name: str) -> Expr:
        """(size,) what a sensor reads of bodies that are not accelerated."""
        return self.functions.sensor(name)(self.x, self.p)

    def joints(self) -> list[tuple[float, float, Array]]:
        """Return for each joint its separation [m], its tilt [rad], and its coordinates (k,)."""
        found = self.functions.joints.call([self.x, self.p])
        parts = zip(found[::3], found[1::3], found[2::3], strict=True)
        return [(float(apart), float(tilt), np.array(value).ravel()) for apart, tilt, value in parts]


class StartValues:
    """The starts of worlds, of which most differ in a few parameters."""

    def __init__(self) -> None:
        """No world is known."""
        self._first: dict[str, Array] = {}
        self._symbols: dict[str, Any] = {}
        self._kept: dict[Hashable, StartFunctions] = {}

    def of(self, parametric: ParametricWorld, values: Mapping[str, Array]) -> Start:
        """A world at its start; ``values`` has those of all of its parameters, and the state of every body."""
        used = {name: values[name] for name in parametric.parameters() if name.rpartition(".")[2] not in DISTRIBUTION}
        for name, value in used.items():
            first = self._first.setdefault(name, value.copy())
            if name not in self._symbols and not name.endswith(".anchor") and not np.array_equal(first, value):
                self._symbols[name] = ca.SX.sym(name, value.size)
        symbols = {name: symbol for name, symbol in self._symbols.items() if name in used}
        numbers = {name: parameter(value) for name, value in used.items() if name not in symbols}
        world = parametric.world({**numbers, **symbols})
        given = {f"{body.name}.{field}": values[f"{body.name}.{field}"] for body in world.bodies for field in GIVEN}
        functions = self._functions(world, list(symbols.values()))
        p = ca.vertcat(ca.DM(0, 1), *(ca.DM(used[name]) for name in symbols))
        return Start(functions, initial_state(world, given), p)

    def _functions(self, world: World, symbols: list[Any]) -> StartFunctions:
        """Return the readings of this world's structure, which worlds that differ in symbols alone share."""
        key = structure(world, symbols)
        if key not in self._kept:
            if len(self._kept) >= MOST_KEPT:
                self._kept.clear()
            self._kept[key] = StartFunctions(world, symbols)
        return self._kept[key]


def parameter(value: Array) -> float | tuple[float, ...]:
    """A parameter's value as worlds take it."""
    return float(value[0]) if value.size == 1 else tuple(value.tolist())
