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
    """A vector that controllers read, evaluated at the start of each step."""

    name: Identifier = Field(description="its name in controllers")
    reads: Texts = Field(
        description=f'formulas, concatenated: {SENSED}, "knee.command" (of the previous step), "sin(2 * pi * time)"'
    )


class NetTable(SchemaTable):
    """A multi-layer perceptron.

    Weights are stored layer by layer: the matrix row by row, then the biases.
    """

    hidden: list[Width] = Field(default=[], description="width of each hidden layer")
    activation: Activation = Field(default="tanh", description="activation of the hidden layers")
    output: Activation = Field(default="linear", description='activation of the last layer; "tanh" bounds the outputs')
    biases: bool = Field(default=True, description="whether layers have biases")
    skip: bool = Field(default=False, description="adds a matrix from inputs to outputs")
    weights: str | None = Field(
        default=None, description="a .npy file with all weights, beside this file; default: random"
    )
    spread: NonNegative = Field(
        default=1.0, description="random weights have standard deviation spread / sqrt(layer inputs)"
    )
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="seed of random weights")


class FunctionTable(SchemaTable):
    """A casadi function from Python: symphys.load(..., functions={name: function})."""

    weights: Numbers | None = Field(default=None, description="initial weights; default 0")


class DrivingTable(SchemaTable):
    """Outputs and inputs of a controller: the quantities that it drives, and the sensors that it reads."""

    name: Identifier = Field(description='variables set its numbers: "name.weights", "name.gains", ...')
    drives: Texts = Field(description='inputs: "knee.command", "ball.force[0:2]"')
    senses: list[str] = Field(default=[], description="names of sensors, concatenated")
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
    """A controller that sets inputs at every step; controllers that drive the same input add up."""

    net: NetTable | None = Field(default=None, description="{ hidden = [32, 32] }")
    function: FunctionTable | None = Field(
        default=None, description="{ weights = [0, 0] }, with a function from Python"
    )


class ForceTable(SchemaTable):
    """A force given by a formula of the state: a spring, drag, wind, the Magnus force."""

    name: Identifier = Field(description='its name in formulas, for its numbers: "drag.c"')
    on: str = Field(description='the input: "ball.force", "ball.torque", "knee.command", "ball.force[0:2]"')
    against: str | None = Field(default=None, description="input that gets the opposite force: post.force")
    value: str = Field(description='formula [N] or [N m], world frame: "-drag.c * norm(ball.velocity) * ball.velocity"')
    during: str | None = Field(default=None, min_length=1, description="the phase in which it acts; default: always")
    numbers: dict[Identifier, Numbers] = Field(
        default={}, description="parameters, which variables may set: { c = 0.02 } is drag.c"
    )


class ReferenceTable(SchemaTable):
    """A given trajectory: "walk.hip" is the value of its column hip at `time`."""

    name: Identifier = Field(description='its name in formulas; columns are "walk.hip"')
    file: str | None = Field(
        default=None,
        min_length=1,
        description="a CSV file with a header, or an NPZ file; its column `time`, in seconds, increases",
    )
    table: dict[str, list[Finite]] | None = Field(
        default=None, description="columns, instead of a file: { time = [0, 1], hip = [0, 0.5] }"
    )
    interpolation: Literal["linear", "cubic"] = Field(
        default="linear", description="between rows; the first and last values extend beyond the ends"
    )
    delay: Finite | None = Field(
        default=None,
        description="columns are read at time - delay [s]; if stated, variables may set it",
    )
