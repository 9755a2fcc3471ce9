"""Multi-layer perceptrons."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Literal, NamedTuple

import casadi as ca

from symphys.model.controllers.linear import rows_times
from symphys.records import dataclass
from symphys.types import Expr

Activation = Literal["tanh", "relu", "linear"]
ACTIVATIONS: tuple[Activation, ...] = ("tanh", "relu", "linear")


class Layer(NamedTuple):
    """A matrix product among the weights.

    Attributes:
        inputs, outputs: its size.
        matrix: where its matrix lies, row by row.
        biases: where its biases lie; empty without any.
        activation: of its outputs.
    """

    inputs: int
    outputs: int
    matrix: slice
    biases: slice
    activation: Activation


@dataclass(frozen=True)
class Net:
    """A multi-layer perceptron; see ``ControlLaw``.

    Its numbers are one column, ``weights``: for each layer the matrix row by row, then its biases; last, with ``skip``,
    a matrix that leads from what is sensed straight to the outputs, row by row.

    Attributes:
        hidden: the width of each hidden layer; empty for none.
        activation: of hidden layers; the slope of "relu" at 0 is 0.
        output: activation of the last layer, before ``skip`` is added.
        biases: whether layers have biases.
        skip: whether there is the straight matrix.
    """

    senses: int
    outputs: int
    hidden: tuple[int, ...] = ()
    activation: Activation = "tanh"
    output: Activation = "linear"
    biases: bool = True
    skip: bool = False

    @property
    def sizes(self) -> Mapping[str, int]:
        """Implement ``ControlLaw.sizes``."""
        layers = tuple(self.layers())
        return {"weights": layers[-1].biases.stop + (self.outputs * self.senses if self.skip else 0)}

    @property
    def straight(self) -> slice:
        """Return the slice of the skip matrix among the weights; empty without one."""
        end = self.sizes["weights"]
        return slice(end - (self.outputs * self.senses if self.skip else 0), end)

    def layers(self) -> Iterator[Layer]:
        """Return the layers from the sensor readings to the outputs."""
        start, widths = 0, (self.senses, *self.hidden, self.outputs)
        for k, (inputs, outputs) in enumerate(pairwise(widths)):
            middle = start + inputs * outputs
            end = middle + (outputs if self.biases else 0)
            activation = self.output if k == len(self.hidden) else self.activation
            yield Layer(inputs, outputs, slice(start, middle), slice(middle, end), activation)
            start = end

    def act(self, sensed: Expr, time: Expr, numbers: Mapping[str, Expr]) -> Expr:
        """Implement ``ControlLaw.act``."""
        weights, value = numbers["weights"], sensed
        for layer in self.layers():
            value = activated(layer.activation, raw(layer, weights, value))
        return value + rows_times(weights[self.straight], sensed, self.outputs) if self.skip else value


def raw(layer: Layer, weights: Expr, value: Expr) -> Expr:
    """(outputs,) what a layer gives before its activation."""
    result = rows_times(weights[layer.matrix], value, layer.outputs)
    return result + weights[layer.biases] if layer.biases.stop > layer.biases.start else result


def activated(activation: Activation, value: Expr) -> Expr:
    """The activation of every number."""
    if activation == "tanh":
        return ca.tanh(value)
    return ca.if_else(value > 0, value, 0) if activation == "relu" else value
