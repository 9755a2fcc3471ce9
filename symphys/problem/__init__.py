"""Problem files: reading, validation, and the model that everything after works with."""

from symphys.problem.fall import ALIVE, Fall
from symphys.problem.feedback import Controller, Sensor
from symphys.problem.follow import follow
from symphys.problem.json_schema import json_schema
from symphys.problem.load import load_problem
from symphys.problem.model import Constraint, Cost, Output, Problem, Simulation, Slot, Target, Variable
from symphys.problem.options import require_solvers, validate_options
from symphys.problem.solvable import require_solvable
from symphys.problem.variation import Grid, Posed, Scenarios, Varied

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
