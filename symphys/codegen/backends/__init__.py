"""Backends evaluate a shooting problem: casadi's virtual machine, casadi's C, or a kernel on a processor or a GPU.

``choose`` takes the one that is asked for, or the best that this machine has.
"""

from symphys.codegen.backends.choose import BACKENDS, INTERPRETED, NAMES, choose, require_backend
from symphys.codegen.backends.interface import Backend, BackendSource, Description, ProblemFunctions
from symphys.codegen.backends.kernels import BEST, PRECISIONS, build_kernel, described, require_kernels

__all__ = [
    "BACKENDS",
    "BEST",
    "INTERPRETED",
    "NAMES",
    "PRECISIONS",
    "Backend",
    "BackendSource",
    "Description",
    "ProblemFunctions",
    "build_kernel",
    "choose",
    "described",
    "require_backend",
    "require_kernels",
]
