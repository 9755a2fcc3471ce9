"""Problem files: reading, validation, and the model that everything after works with."""

from typing import TYPE_CHECKING

from symphys.later import later
from symphys.problem.feedback import FeedbackController, ForceLaw, Sensor
from symphys.problem.guess.motion import GuessedMotion
from symphys.problem.load import require_solvable
from symphys.problem.model import (
    ALIVE,
    DURATION,
    Constraint,
    Cost,
    Discretisation,
    Output,
    Phase,
    ProblemData,
    RandomizedPose,
    RandomizedQuantity,
    Scenarios,
    Simulation,
    Target,
    Termination,
    Variable,
    VariableSlot,
)
from symphys.problem.parametric.carried import carried
from symphys.problem.parametric.reposition import placing, reposition
from symphys.problem.parametric.starts import begin
from symphys.problem.problem import Problem, load_problem, problem_of_tables
from symphys.problem.quantities import set_quantities
from symphys.problem.reading.solver_options import require_solvers, validate_options
from symphys.problem.receding_horizon import PlantSettings, RecedingHorizon
from symphys.problem.recordings import IdentifySettings, Measured, RecordedFile, RecordedInput, Recording
from symphys.problem.robot_alone import is_robot, robot_alone

if TYPE_CHECKING:
    from symphys.problem.schema.json_schema import json_schema
    from symphys.problem.schema.reference import reference_page

__all__ = [
    "ALIVE",
    "DURATION",
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
        "schema.json_schema": ("json_schema",),
        "schema.reference": ("reference_page",),
    },
)
