"""Numbers of a world that was built in Python, as a problem file has them."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.errors import SymphysError


def numbers(thing: Any) -> dict[str, float]:
    """The fields of a motor or a spring that are not None."""
    return {key: floats(value) for key, value in vars(thing).items() if value is not None}


def floats(value: Any) -> Any:
    """Plain numbers, in lists as deep as they were given; SymphysError for symbols."""
    if isinstance(value, list | tuple):
        return [floats(each) for each in value]
    if isinstance(value, ca.SX | ca.MX) and not value.is_constant():
        raise SymphysError(f"{value} is no number: give one, and let a variable of the problem set it")
    return np.asarray(value, float).tolist()
