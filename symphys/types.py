"""What arrays and expressions are called in annotations, in all rooms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Expr = Any
"""A matrix of casadi, SX, MX or DM, whose types are not annotated; a float where a docstring says so."""
