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

UNIT = 'of the value, such as "m/s", for messages; default: that of its formula, where it is clear'
Knots = Annotated[int, Field(ge=1, le=1_000_000)]


class VariableTable(SchemaTable):
    """Something that a solver may choose."""

    name: Identifier = Field(description="how formulas and results refer to it")
    sets: Texts = Field(
        description='what it sets: "ball.velocity", "ball.force[0:2]", "knee.command", "knee.start", '
        '"ground.friction", or a list; an orientation (w, x, y, z) is normalised'
    )
    guess: Numbers | None = Field(
        default=None, description="where solvers start; default: what the file says (forces and commands: 0)"
    )
    lower: Bounds | None = Field(
        default=None, description="for all components, or one for each; default: none, or what is physical"
    )
    upper: Bounds | None = Field(default=None, description="likewise; default: none, or what is physical")
    scale: Numbers | None = Field(
        default=None, description="a typical change; default 1, for parameters their own size"
    )
    spread: Numbers | None = Field(
        default=None,
        description="standard deviation with which seeds above 0 perturb the guess; default: a tenth of scale",
    )
    knots: Knots = Field(default=1, description="for forces, torques and commands: number of values over the duration")
    interpolation: Interpolation = Field(
        default="constant", description="of forces, torques and commands between knots"
    )
    each: Literal["recording"] | None = Field(
        default=None,
        description='"recording": a value of its own for every recording, such as a start or the offset of a clock',
    )
    prior: Prior | None = Field(
        default=None,
        description="what `symphys identify` knows beforehand: [mean, standard deviation], each a number or a list "
        "with one for each component",
    )


class GuessTable(SchemaTable):
    """A guess of the states along the motion, for solvers whose variables are states too (multiple_shooting).

    What is named moves on straight lines between the times at which it is named, and stays before and after. Its rates
    are the slopes of these lines where they are not named themselves. Everything else moves as the guess of the
    variables has it.
    """

    states: list[dict[str, Any]] = Field(
        default=[], description="{ at = 2.0, knee.angle = 1.2, torso.position = [0, 0, 1] }, times [s] in any order"
    )
    follows: dict[str, str] = Field(
        default={}, description='formulas of time and of references: { "knee.angle" = "walk.knee" }'
    )


class PhaseTable(SchemaTable):
    """A stretch of the motion. Phases follow each other from the start, in the order of the file."""

    name: Label = Field(description='costs and constraints name it: during = "flight", at = "end of flight"')
    until: Positive | None = Field(default=None, description="when it ends [s]; the last may leave that out")
    share: Positive | None = Field(
        default=None,
        le=1,
        description="when it ends, as a share of the duration, at the nearest step",
    )
    sets: dict[str, Any] = Field(
        default={},
        description='numbers that hold in it alone: { "ground.friction" = 0.05, gravity = [0, 0, -1.6] }; of contacts, '
        'motors and springs, and gravity. Variables may set them: "ice.ground.friction"',
    )


class CostTable(SchemaTable):
    """A term of the objective: a number to make small, or a vector whose squares are summed."""

    name: Label = Field(description="how results and reports refer to it")
    at: Moment = Field(
        default="end", description='"end", "always" (integral over time), a time [s], or "end of" or "start of" a phase'
    )
    during: Label | None = Field(default=None, description="a phase over which it is integrated, instead of at")
    value: str | None = Field(default=None, description="formula of a number")
    squares: str | None = Field(default=None, description="formula of a vector; the cost is the sum of its squares")
    weight: Finite = Field(default=1.0, description="factor of the term; a negative one makes the value large")


class TargetTable(SchemaTable):
    """A vector that should be zero within a tolerance; the objective gets weight * |value|^2."""

    name: Label = Field(description="how results and reports refer to it")
    at: Instant = Field(default="end", description='"end", a time [s], or "end of" or "start of" a phase')
    value: str = Field(description="formula of what should be zero")
    unit: Label | None = Field(default=None, description=UNIT)
    tolerance: Positive = Field(description="met where the Euclidean norm of the value is at most this")
    weight: NonNegative = Field(default=1.0, description="factor of the squared norm of the value in the objective")


class ConstraintTable(SchemaTable):
    """Bounds on every component of a vector."""

    name: Label = Field(description="how results and reports refer to it")
    at: Moment = Field(
        default="end", description='"end", "always" (every time step), a time [s], or "end of" or "start of" a phase'
    )
    during: Label | None = Field(default=None, description="a phase in which it holds always, instead of at")
    value: str = Field(description="formula of what is bounded")
    lower: Bounds | None = Field(default=None, description="for all components, or one for each; default: none")
    upper: Bounds | None = Field(default=None, description="likewise; default: none")
    equals: Numbers | None = Field(default=None, description="instead of lower and upper")
    tolerance: Positive = Field(default=1e-3, description="largest violation of a component that counts as met")
    penalty: Positive = Field(
        default=1e3, description="weight of squared violations for solvers that know no constraints"
    )
    unit: Label | None = Field(default=None, description=UNIT)


class OutputTable(SchemaTable):
    """A number that is reported: while solvers work, in results and in reports. Nothing depends on it."""

    name: Label = Field(description="how results and reports refer to it")
    at: Instant = Field(default="end", description='"end", a time [s], or "end of" or "start of" a phase')
    value: str = Field(description="formula of a number")
    unit: Label | None = Field(default=None, description='such as "m/s"')


class TerminationTable(SchemaTable):
    """A condition that ends a motion early: from then on nothing moves, and running costs stop."""

    margin: str = Field(
        description="formula of a number of the state; the motion ends where it falls below 0. Formulas know `alive`, "
        "which is 1 until then and 0 from then on"
    )
    cost: NonNegative = Field(default=0.0, description="added for every second that is left; more than standing costs")


class ObjectiveTable(SchemaTable):
    """The goal of the objective, and when a solve stops."""

    goal: Finite | None = Field(default=None, description="the objective should come down to this")
    stop: Stop | None = Field(
        default=None,
        description='"met": stop at the first point that meets every target, constraint and the goal; "converged": '
        "go on to the optimum. Default: met with a goal, or with targets and no costs",
    )
