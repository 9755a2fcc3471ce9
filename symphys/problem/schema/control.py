"""Tables of sensors, controllers, force laws and references: how motors and forces follow from state and time."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any, Literal

from pydantic import Field, create_model

from symphys.dynamics.observation import SENSOR_KINDS
from symphys.model.controllers import CONTROLLERS
from symphys.problem.schema.declared import keys_of
from symphys.problem.schema.types import Finite, Identifier, NonNegative, Numbers, SchemaTable, Texts

Width = Annotated[int, Field(ge=1, le=100_000)]
Activation = Literal["tanh", "relu", "linear"]


OWNERS = {"body": "torso", "joint": "knee", "site": "tip"}
SENSED = ", ".join(f'"{OWNERS[kind.owner]}.{kind.key}"' for kind in SENSOR_KINDS)
"""Every kind of sensor, by an example."""


class SensorTable(SchemaTable):
    """A vector that controllers may use, in the velocities that are reported."""

    name: Identifier = Field(description="how controllers refer to it")
    reads: Texts = Field(
        description=f'formulas, joined one after the other: {SENSED}, "knee.command" (of the step before), '
        '"torso.position[2]", "sin(2 * pi * time)"'
    )


class NetTable(SchemaTable):
    """A multi-layer perceptron; its weights are a layer's matrix row by row, then its biases, layer after layer."""

    hidden: list[Width] = Field(default=[], description="the width of each hidden layer; none: one layer")
    activation: Activation = Field(default="tanh", description="of hidden layers")
    output: Activation = Field(default="linear", description='of the last layer; with "tanh" outputs are bounded')
    biases: bool = Field(default=True, description="whether every layer adds a bias to each of its outputs")
    skip: bool = Field(default=False, description="adds a matrix from the inputs straight to the outputs")
    weights: str | None = Field(
        default=None, description="a .npy file with all of them, beside this file; default: random"
    )
    spread: NonNegative = Field(
        default=1.0, description="random weights have this standard deviation, over the root of a layer's inputs"
    )
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="of random weights")


class FunctionTable(SchemaTable):
    """A casadi function that Python gives: symphys.load(..., functions={name: function})."""

    weights: Numbers | None = Field(default=None, description="its numbers at the start; default 0")


class DrivingTable(SchemaTable):
    """Outputs and inputs of a controller: the quantities that it drives, and the sensors that it reads."""

    name: Identifier = Field(
        description='variables set its numbers: "name.weights", "name.gains", "name.frequency", ...'
    )
    drives: Texts = Field(description='"knee.command", "ball.force[0:2]", or a list')
    senses: list[str] = Field(default=[], description="names of sensors, joined one after the other")
    scale: Numbers = Field(default=1.0, description="factor of all outputs, or one for each")


def kinds_of_controllers() -> type[SchemaTable]:
    """Make a table with an optional table for each kind of controller that says its own keys."""
    found: dict[str, Any] = {}
    for word, law in CONTROLLERS.items():
        numbers: dict[str, Any] = {
            key: (Finite, Field(description=about))
            if key in law.needed
            else (Numbers | None, Field(default=None, description=about))
            for key, about in law.numbers.items()
        }
        keys = {**numbers, **keys_of(fields(law))}
        table = create_model(f"{word.capitalize()}Table", __base__=SchemaTable, __doc__=law.summary, **keys)
        found[word] = (table | None, Field(default=None, description=law.example))
    return create_model("KindsOfControllersTable", __base__=DrivingTable, **found)


class ControllerTable(kinds_of_controllers()):  # type: ignore[misc]
    """A controller that sets inputs at every step; the outputs of several that drive one input add up."""

    net: NetTable | None = Field(default=None, description="{ hidden = [32, 32] }")
    function: FunctionTable | None = Field(default=None, description="{ weights = [0, 0] }, and a function from Python")


class ForceTable(SchemaTable):
    """A force that follows from the state by a formula: a spring, drag, wind, Magnus' force."""

    name: Identifier = Field(description='formulas name its numbers: "drag.c"')
    on: str = Field(description='what it is added to: "ball.force", "ball.torque", "knee.command", "ball.force[0:2]"')
    against: str | None = Field(
        default=None, description="what the opposite is added to, as of a spring between two bodies: post.force"
    )
    value: str = Field(
        description='formula in N or N m, world frame: "-drag.c * norm(ball.velocity) * ball.velocity"; it is '
        "evaluated in the middle of each step"
    )
    during: str | None = Field(default=None, min_length=1, description="the phase in which alone it acts; else always")
    numbers: dict[Identifier, Numbers] = Field(
        default={}, description="numbers of the formula, which variables may set: { c = 0.02 } is drag.c"
    )


class ReferenceTable(SchemaTable):
    """A trajectory that is given, whose columns formulas name: "walk.hip" is its column hip at `time`."""

    name: Identifier = Field(description='formulas name its columns: "walk.hip"')
    file: str | None = Field(
        default=None,
        min_length=1,
        description="a CSV file with a header, or an NPZ file, beside this file; one column is `time` [s], increasing",
    )
    table: dict[str, list[Finite]] | None = Field(
        default=None, description="its columns, instead of a file: { time = [0, 1], hip = [0, 0.5] }"
    )
    interpolation: Literal["linear", "cubic"] = Field(
        default="linear", description="between rows; before the first and after the last the values stay"
    )
    delay: Finite | None = Field(
        default=None,
        description="the columns count so much later [s]: at `time` they are those of time - delay. Where it is given, "
        "0 too, variables may set it: walk.delay",
    )
