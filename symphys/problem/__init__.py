"""Problem files: reading, validation, and the model that everything after works with."""

from typing import TYPE_CHECKING

from symphys.later import later
from symphys.problem.guess import GuessedMotion
from symphys.problem.load import require_solvable
from symphys.problem.model import (
    ALIVE,
    DURATION,
    STEP_LENGTH,
    Constraint,
    Cost,
    Discretisation,
    FeedbackController,
    ForceLaw,
    Output,
    Phase,
    PlantSettings,
    ProblemData,
    RandomizedPose,
    RandomizedQuantity,
    RecedingHorizon,
    Scenarios,
    Sensor,
    Simulation,
    Target,
    Termination,
    Variable,
    VariableSlot,
)
from symphys.problem.parametric.placement import begin, carried, placing, reposition
from symphys.problem.problem import Problem, load_problem, problem_of_tables
from symphys.problem.quantities import set_quantities
from symphys.problem.reading.solver_options import require_solvers, validate_options
from symphys.problem.recordings import IdentifySettings, Measured, RecordedFile, RecordedInput, Recording
from symphys.problem.robot_alone import is_robot, robot_alone

if TYPE_CHECKING:
    from symphys.problem.schema.reference import json_schema, reference_page

__all__ = [
    "ALIVE",
    "DURATION",
    "STEP_LENGTH",
    "Constraint",
    "Cost",
    "Discretisation",
    "FeedbackController",
    "ForceLaw",
    "GuessedMotion",
    "IdentifySettings",
    "Measured",
    "Output",
    "Phase",
    "PlantSettings",
    "Problem",
    "ProblemData",
    "RandomizedPose",
    "RandomizedQuantity",
    "RecedingHorizon",
    "RecordedFile",
    "RecordedInput",
    "Recording",
    "Scenarios",
    "Sensor",
    "Simulation",
    "Target",
    "Termination",
    "Variable",
    "VariableSlot",
    "begin",
    "carried",
    "is_robot",
    "json_schema",
    "load_problem",
    "placing",
    "problem_of_tables",
    "reference_page",
    "reposition",
    "require_solvable",
    "require_solvers",
    "robot_alone",
    "set_quantities",
    "validate_options",
]

__getattr__ = later(
    __name__,
    {
        "schema.reference": ("json_schema", "reference_page"),
    },
)
