"""Problem files: reading, validation, and the model that everything after works with."""

from symphys.problem.checks.solvable import require_solvable
from symphys.problem.feedback import Controller, Sensor
from symphys.problem.load import load_problem
from symphys.problem.model import Constraint, Cost, Output, Problem, Simulation, Slot, Target, Variable
from symphys.problem.parametric.reposition import follow
from symphys.problem.randomization import Grid, Posed, Scenarios, Varied
from symphys.problem.reading.solver_options import require_solvers, validate_options
from symphys.problem.schema.json_schema import json_schema
from symphys.problem.tables.termination import ALIVE, Fall

__all__ = [
    "ALIVE",
    "Constraint",
    "Controller",
    "Cost",
    "Fall",
    "Grid",
    "Output",
    "Posed",
    "Problem",
    "Scenarios",
    "Sensor",
    "Simulation",
    "Slot",
    "Target",
    "Variable",
    "Varied",
    "follow",
    "json_schema",
    "load_problem",
    "require_solvable",
    "require_solvers",
    "validate_options",
]
