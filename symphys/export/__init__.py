"""A problem for other programs: C sources, or functions that plain casadi loads."""

from symphys.export.casadi_files import casadi_files
from symphys.export.folder import ExportError, write_folders
from symphys.export.sources import c_files

__all__ = ["ExportError", "c_files", "casadi_files", "write_folders"]
