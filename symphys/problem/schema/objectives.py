"""Tables that say what may vary and what should come out: variables, costs, targets, constraints, objective."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from symphys.problem.schema.types import (
    Bounds,
    Finite,
    Identifier,
    Instant,
    Interpolation,
    Label,
    Moment,
    NonNegative,
    Numbers,
    Positive,
    Prior,
    SchemaTable,
    Stop,
    Texts,
)

UNIT = 'unit of the value, for messages, such as "m/s"; default: derived from the formula'
Knots = Annotated[int, Field(ge=1, le=1_000_000)]


class VariableTable(SchemaTable):
    """A quantity that the solver chooses."""

    name: Identifier = Field(description="its name in formulas and results")
    sets: Texts = Field(
        description='"ball.velocity", "ball.force[0:2]", "knee.command", "knee.start", "ground.friction", or a list'
    )
    guess: Numbers | None = Field(
        default=None, description="where solvers start; default: the file's value (forces and commands: 0)"
    )
    lower: Bounds | None = Field(default=None, description="lower bound; default: none, or the physical one")
    upper: Bounds | None = Field(default=None, description="upper bound; default: none, or the physical one")
    scale: Numbers | None = Field(
        default=None, description="a typical change; default: 1, for parameters their own size"
    )
    spread: Numbers | None = Field(
        default=None,
        description="standard deviation with which seeds above 0 perturb the guess; default: a tenth of scale",
    )
    knots: Knots = Field(default=1, description="for forces, torques and commands: number of values over the duration")
    interpolation: Interpolation = Field(default="constant", description="between knots")
    each: Literal["recording"] | None = Field(
        default=None,
        description='"recording": a separate value for every recording',
    )
    prior: Prior | None = Field(
        default=None,
        description="[mean, standard deviation], numbers or lists, for `symphys identify`",
    )


class GuessTable(SchemaTable):
    """A guess of the states along the motion, for multiple_shooting.

    Quantities are interpolated linearly between the times at which they are given, and constant outside. Rates that
    are not given are the slopes. Other quantities come from the rollout of the variables' guess.
    """

    states: list[dict[str, Any]] = Field(
        default=[], description="{ at = 2.0, knee.angle = 1.2, torso.position = [0, 0, 1] }, times in seconds"
    )
    follows: dict[str, str] = Field(
        default={}, description='formulas of time and references: { "knee.angle" = "walk.knee" }'
    )


class PhaseTable(SchemaTable):
    """A part of the motion; phases follow each other in the order of the file."""

    name: Label = Field(description='its name: during = "flight", at = "end of flight"')
    until: Positive | None = Field(default=None, description="when it ends [s]; not needed for the last phase")
    share: Positive | None = Field(
        default=None,
        le=1,
        description="instead of until: when it ends, as a share of the duration",
    )
    sets: dict[str, Any] = Field(
        default={},
        description='values in this phase: { "ground.friction" = 0.05, gravity = [0, 0, -1.6] }; variables set '
        '"ice.ground.friction"',
    )


class CostTable(SchemaTable):
    """A term of the objective, to be minimised."""

    name: Label = Field(description="its name in results")
    at: Moment = Field(
        default="end",
        description='"always" integrates over time; a number is a time [s]; "end of" and "start of" name a phase',
    )
    during: Label | None = Field(default=None, description="instead of at: a phase over which it is integrated")
    value: str | None = Field(default=None, description="formula of a number")
    squares: str | None = Field(
        default=None, description="instead of value: formula of a vector whose squares are summed"
    )
    weight: Finite = Field(default=1.0, description="factor in the objective; a negative weight maximises")


class TargetTable(SchemaTable):
    """A vector that should be zero within a tolerance; the objective gets weight * |value|^2."""

    name: Label = Field(description="its name in results")
    at: Instant = Field(default="end", description='a number is a time [s]; "end of" and "start of" name a phase')
    value: str = Field(description="formula that should be zero")
    unit: Label | None = Field(default=None, description=UNIT)
    tolerance: Positive = Field(description="largest Euclidean norm that counts as met")
    weight: NonNegative = Field(default=1.0, description="factor of the squared norm in the objective")


class ConstraintTable(SchemaTable):
    """Bounds on every component of a vector."""

    name: Label = Field(description="its name in results")
    at: Moment = Field(
        default="end",
        description='"always" means every step; a number is a time [s]; "end of" and "start of" name a phase',
    )
    during: Label | None = Field(default=None, description="instead of at: a phase in which it always holds")
    value: str = Field(description="formula of the bounded vector")
    lower: Bounds | None = Field(default=None, description="lower bound; default: none")
    upper: Bounds | None = Field(default=None, description="upper bound; default: none")
    equals: Numbers | None = Field(default=None, description="instead of lower and upper")
    tolerance: Positive = Field(default=1e-3, description="largest violation of a component that counts as met")
    penalty: Positive = Field(default=1e3, description="weight of squared violations, for solvers without constraints")
    unit: Label | None = Field(default=None, description=UNIT)


class OutputTable(SchemaTable):
    """A reported number; it does not influence the solution."""

    name: Label = Field(description="its name in results")
    at: Instant = Field(default="end", description='a number is a time [s]; "end of" and "start of" name a phase')
    value: str = Field(description="formula of a number")
    unit: Label | None = Field(default=None, description='such as "m/s"')


class TerminationTable(SchemaTable):
    """A condition that ends a motion early; motion and running costs stop there."""

    margin: str = Field(description="formula of the state; the motion ends where it falls below 0")
    cost: NonNegative = Field(default=0.0, description="for every remaining second; more than the running costs")


class ObjectiveTable(SchemaTable):
    """When a solve stops."""

    goal: Finite | None = Field(default=None, description="value to which the objective should fall")
    stop: Stop | None = Field(
        default=None,
        description="stop at the first point that meets everything, or continue to the optimum; default: met with a "
        "goal, or with targets and no costs",
    )
