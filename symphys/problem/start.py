"""The start of a world: what formulas read there, whether surfaces overlap, and whether joints hold together.

Building gaps and readings as expressions takes most of the time of reading a problem. So they are built as functions of
the parameters in which worlds have differed so far, and evaluated for every further world of the same structure.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, NoReturn

import casadi as ca
import numpy as np

from symphys.dynamics.kept import structure
from symphys.dynamics.observation import NamedSensor, SensedState, gap_function, joint_readings, named_sensors
from symphys.expression import FormulaError
from symphys.model.joints.frames import MEETING_TOLERANCE, WORLD
from symphys.model.state_layout import GIVEN, Layout, initial_state, input_sizes
from symphys.model.world import World
from symphys.problem.model import DURATION, Variable
from symphys.problem.parametric.parts import DISTRIBUTION
from symphys.problem.parametric.placement import begin, placing, reposition
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.quantities import Quantity
from symphys.problem.reading.faults import Faults
from symphys.records import dataclass
from symphys.suggest import quote
from symphys.types import Array, Expr

MAX_STRUCTURES = 8
"""How many structures of worlds are kept at once."""
MAX_OVERLAP = 1e-3
"""Deepest overlap at the start [m]; more would be pushed out in the first steps, which is never meant."""


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
        """Start without known worlds."""
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
            if len(self._kept) >= MAX_STRUCTURES:
                self._kept.clear()
            self._kept[key] = StartFunctions(world, symbols)
        return self._kept[key]


def parameter(value: Array) -> float | tuple[float, ...]:
    """A parameter's value as worlds take it."""
    return float(value[0]) if value.size == 1 else tuple(value.tolist())


def at_guess(
    parametric: ParametricWorld, known: Mapping[str, Quantity], variables: Sequence[Variable]
) -> dict[str, Array]:
    """Return every quantity's value at t = 0, with the first knot of every guess put in."""
    values = {name: quantity.nominal.copy() for name, quantity in known.items() if quantity.kind != "recording"}
    for variable in variables:
        for slot in variable.slots if variable.kind != "recording" else ():
            values[slot.name][list(slot.components)] = variable.guess[: variable.components]
    for name, value in values.items():
        if name.endswith(".orientation"):
            values[name] = value / max(float(np.linalg.norm(value)), 1e-12)
    varying, starts = varied(variables), {name: values.pop(name) for name in parametric.starts() if name in values}
    begun = begin(
        parametric,
        {name: ca.DM(value) for name, value in starts.items() if name in varying},
        {name: ca.DM(values[name]) for name, q in known.items() if q.kind == "initial" and name in values},
    )
    places = {name: ca.DM(values[name]) for name in placing(varying)}
    moved = reposition(parametric, places, begun)
    return values | {name: np.array(value).ravel() for name, value in moved.items()}


def varied(variables: Sequence[Variable]) -> list[str]:
    """The quantities that variables set."""
    return [slot.name for variable in variables for slot in variable.slots]


def formula_names(
    values: Mapping[str, Array], start: Start, variables: Sequence[Variable], warm_start: bool = True
) -> dict[str, Any]:
    """Return every name that a formula may use, with a value of its shape; see ``Formula.evaluate``."""
    named: dict[str, Any] = {name: ca.DM(value) for name, value in values.items() if "-" not in name}
    named |= {"time": ca.DM(0.0), "duration": ca.DM(values[DURATION])}
    named |= start.quantities()
    if not warm_start:
        kept = (name for name, sensor in start.functions.sensors.items() if sensor.kind.kept)
        named |= {name: partial(_without_warm_start, name) for name in kept}
    return named | {variable.name: ca.DM(variable.guess) for variable in variables}


def _without_warm_start(name: str) -> NoReturn:
    text = "reads what joints gave in the step before, which is not kept; take out warm_start = false in [simulation]"
    raise FormulaError(f"{quote(name)} {text}")


def check_overlap(parametric: ParametricWorld, start: Start, faults: Faults) -> None:
    """Surfaces that may touch must not overlap at the start."""
    deepest: dict[tuple[str, str], float] = {}
    for pair, gap in zip(start.world.pairs, start.gaps(), strict=True):
        depth, owners = -gap, parametric.owners(pair)
        if not depth <= max(MAX_OVERLAP, deepest.get(owners, MAX_OVERLAP)):
            deepest[owners] = depth
    for (a, b), depth in deepest.items():
        index = body_index(parametric, a)
        verb = "overlaps" if any(body.name == b for body in parametric.bodies) else "sinks into"
        message = f"{a} {verb} {b} by {depth:.4g} m at the start; at most {MAX_OVERLAP:g} m is allowed"
        faults.add(("body", index, "position"), message)


def check_joints(parametric: ParametricWorld, start: Start, faults: Faults) -> None:
    """Joints must hold together at the start of the guess, within their limits."""
    if not parametric.joints:
        return
    for index, (joint, reading) in enumerate(zip(parametric.joints, start.joints(), strict=True)):
        both, place = f"{joint.second or WORLD} and {joint.first}", ("joint", index)
        apart, tilt = (round(part, 9) for part in reading[:2])
        if not max(apart, tilt) <= MEETING_TOLERANCE:
            text = f"{apart:.4g} m and {tilt:.4g} rad from where the joint holds them; one variable must move both"
            cause = "the start of other joints, or " * any(each.start for each in parametric.joints)
            faults.add((*place, "between"), f"{cause}the guess of a variable puts {both} {text}")
        low, high = joint.limits.lower, joint.limits.upper
        for value in reading[2].round(9) + 0.0:
            if (low is not None and value < low - MEETING_TOLERANCE) or (
                high is not None and value > high + MEETING_TOLERANCE
            ):
                text = f"leave out where {both} are at the start, at {value:.6g}; it is 0 as the bodies lie in the file"
                key = "limits" if faults.data["joint"][index].get("limits") is not None else "limits_deg"
                faults.add((*place, key), text)


def body_index(parametric: ParametricWorld, name: str) -> int:
    """The index of a body."""
    return [body.name for body in parametric.bodies].index(name)
