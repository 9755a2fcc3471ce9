"""What evaluates a shooting problem: casadi's virtual machine, casadi's C, or a kernel of SIMD lanes.

One file a backend; ``choose`` takes the one that is asked for, or the best that this machine has. A backend for GPUs
belongs into ``cuda.py``, beside the others.
"""

from symphys.backends.choose import BACKENDS, BEST, NAMES, choose
from symphys.backends.interface import Backend, Description, Functions, Source

__all__ = ["BACKENDS", "BEST", "NAMES", "Backend", "Description", "Functions", "Source", "choose"]
