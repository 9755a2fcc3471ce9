"""Files for other programs: C sources, casadi functions, MuJoCo models. ``export_problem`` writes."""

from symphys.export.casadi_files import casadi_files
from symphys.export.folder import ExportError, write_folders
from symphys.export.mjcf import MjcfModel, mjcf, mjcf_files, mjcf_model, problem_model
from symphys.export.mjcf_departures import Departure
from symphys.export.sources import c_files
from symphys.export.writing import export_problem

__all__ = [
    "Departure",
    "ExportError",
    "MjcfModel",
    "c_files",
    "casadi_files",
    "export_problem",
    "mjcf",
    "mjcf_files",
    "mjcf_model",
    "problem_model",
    "write_folders",
]
