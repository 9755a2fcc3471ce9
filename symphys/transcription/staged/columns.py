"""Functions of columns, for many columns at once."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.types import Array


class ByColumns:
    """A casadi function of columns, for any number of them; what was built for a number of columns is kept."""

    def __init__(self, function: ca.Function) -> None:
        """Nothing is built before the first call."""
        self.function = function
        self._mapped: dict[int, ca.Function] = {}

    def __call__(self, *columns: Any) -> list[Array]:
        """(size, T) each -> results (rows, T * columns), side by side."""
        count = int(columns[0].shape[1])
        if count not in self._mapped:
            self._mapped[count] = self.function.map(count)
        return [np.array(result, float) for result in self._mapped[count].call(list(columns))]
