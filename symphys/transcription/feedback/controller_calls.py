"""Sensors, controllers and force laws as calls of a program: one for each sensor and each row of a net."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import casadi as ca

from symphys.codegen import FunctionCall, MemoryLayout, Place
from symphys.model.controllers import Net
from symphys.model.controllers.net import Activation, Layer, activated
from symphys.model.state_layout import input_columns
from symphys.problem import FeedbackController
from symphys.transcription.rollout import Rollout
from symphys.types import Expr


class Places(Protocol):
    """The places of a rollout in a program."""

    rollout: Rollout
    layout: MemoryLayout
    smoothing: Place
    x: Place
    given: Place
    u: Place
    p: Place
    time: Place


def control_calls(rollout: Rollout, places: Places) -> list[FunctionCall]:
    """Return the calls before those of a step, from ``x`` and ``given`` to ``u``; none without feedback."""
    if rollout.feedback is None:
        return []
    return ControllerCalls(rollout, places).calls


class ControllerCalls:
    """Makes the calls of one step in order."""

    def __init__(self, rollout: Rollout, places: Places) -> None:
        """Make all calls."""
        self.rollout, self.places = rollout, places
        self.calls: list[FunctionCall] = []
        laws, given = rollout.control.laws, places.given
        if rollout.problem.controllers:
            sensed = {name: self.sense(name) for name in self.used()}
            outputs = [self.outputs(c, [sensed[name] for name in c.senses]) for c in rollout.problem.controllers]
            given = places.u if laws is None else places.layout.take(places.u.size)
            self.add_up(outputs, given)
        if laws is not None:
            self.calls.append(FunctionCall(laws, (places.x, given, places.p, places.time), (places.u,)))

    def used(self) -> list[str]:
        """Return the sensors that some controller reads."""
        return list(dict.fromkeys(name for c in self.rollout.problem.controllers for name in c.senses))

    def sense(self, name: str) -> Place:
        """Add the call of a sensor and return the place of its reading."""
        sensor = next(s for s in self.rollout.problem.sensors if s.name == name)
        places = self.places
        return self.call(self.rollout.control.sensor(sensor), places.x, places.p, places.time)

    def call(self, function: ca.Function, *inputs: Place) -> Place:
        """Add a call with one result and return the place of the result."""
        result = self.places.layout.take(int(function.numel_out(0)))
        self.calls.append(FunctionCall(function, inputs, (result,)))
        return result

    def outputs(self, controller: FeedbackController, senses: Sequence[Place]) -> list[Place]:
        """Add the calls of a controller and return the places of its outputs, in order."""
        law = controller.law
        if isinstance(law, Net):
            return self.net(law, self.numbers(controller, "weights"), senses)
        sensed = [ca.SX.sym("sensed", place.size) for place in senses]
        numbers = {key: ca.SX.sym(key, size) for key, size in law.sizes.items()}
        time = ca.SX.sym("time")
        value = law.act(ca.vertcat(ca.SX(0, 1), *sensed), time, numbers)
        function = ca.Function("act", [*sensed, time, *numbers.values()], [ca.densify(ca.SX(value))])
        held = [self.numbers(controller, key) for key in numbers]
        return [self.call(function, *senses, self.places.time, *held)]

    def numbers(self, controller: FeedbackController, key: str) -> Place:
        """Return the place of a controller's numbers among the parameters."""
        return part(self.places.p, self.rollout.parameters.columns[f"{controller.name}.{key}"])

    def net(self, net: Net, weights: Place, senses: Sequence[Place]) -> list[Place]:
        """Add a call for each output of a layer."""
        values, layers = list(senses), tuple(net.layers())
        for layer in layers:
            result = self.places.layout.take(layer.outputs)
            straight = part(weights, net.straight) if net.skip and layer == layers[-1] else None
            for k in range(layer.outputs):
                function, inputs = self.row(layer, k, weights, values, straight, senses)
                self.calls.append(FunctionCall(function, inputs, (part(result, slice(k, k + 1)),)))
            values = [result]
        return values

    def row(
        self,
        layer: Layer,
        k: int,
        weights: Place,
        values: Sequence[Place],
        straight: Place | None,
        senses: Sequence[Place],
    ) -> tuple[ca.Function, tuple[Place, ...]]:
        """Return the function of one output of a layer, and its arguments."""
        width, start = layer.inputs, layer.matrix.start
        products = [([*values], part(weights, slice(start + k * width, start + (k + 1) * width)))]
        if straight is not None:
            size = sum(place.size for place in senses)
            products.append(([*senses], part(straight, slice(k * size, (k + 1) * size))))
        bias = layer.biases.start + k
        biases = [part(weights, slice(bias, bias + 1))] if layer.biases.stop > layer.biases.start else []
        sizes = [([place.size for place in inputs], held.size) for inputs, held in products]
        places = [place for inputs, held in products for place in (*inputs, held)]
        return row_function(layer.activation, sizes, len(biases)), (*places, *biases)

    def add_up(self, outputs: Sequence[Sequence[Place]], result: Place) -> None:
        """Add the call that sums the inputs of variables and of all controllers."""
        controllers = self.rollout.problem.controllers
        given = ca.SX.sym("given", self.places.u.size)
        total, symbols = ca.SX(given), list[Expr]()
        columns = input_columns(self.rollout.world, self.rollout.inputs)
        for controller, parts in zip(controllers, outputs, strict=True):
            own = [ca.SX.sym("output", place.size) for place in parts]
            symbols += own
            for (name, component), scale, value in zip(
                controller.drives, controller.scale, ca.vertsplit(ca.vertcat(*own)), strict=True
            ):
                total[columns[name].start + component] += scale * value
        function = ca.Function("inputs", [given, *symbols], [ca.densify(total)])
        flat = [place for parts in outputs for place in parts]
        self.calls.append(FunctionCall(function, (self.places.given, *flat), (result,)))


def part(place: Place, columns: slice) -> Place:
    """Return some words of a place."""
    return Place(place.offset + columns.start, columns.stop - columns.start, place.stride)


def row_function(activation: Activation, sizes: Sequence[tuple[list[int], int]], biases: int) -> ca.Function:
    """Return (values ..., weights), those of a skip connection if there is one, and a bias -> one output."""
    symbols, products = list[Expr](), list[Expr]()
    for values, held in sizes:
        own = [ca.SX.sym("value", size) for size in values]
        weights = ca.SX.sym("weights", held)
        symbols += [*own, weights]
        products.append(ca.dot(weights, ca.vertcat(*own)))
    bias = [ca.SX.sym("bias") for _ in range(biases)]
    first, *straight = products
    total = activated(activation, sum(bias, first))
    return ca.Function("row", [*symbols, *bias], [ca.densify(sum(straight, total))])
