"""A problem for other programs: C sources, functions that plain casadi loads, or a model for MuJoCo."""

from symphys.export.casadi_files import casadi_files
from symphys.export.folder import ExportError, write_folders
from symphys.export.mjcf import mjcf, mjcf_files
from symphys.export.sources import c_files

__all__ = ["ExportError", "c_files", "casadi_files", "mjcf", "mjcf_files", "write_folders"]
