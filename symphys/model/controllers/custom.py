"""A controller that is any casadi function."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True, eq=False)
class Custom:
    """u = function(sensed, time, weights); see ``ControlLaw``. The function must expand to scalar operations (SX)."""

    function: ca.Function

    @property
    def senses(self) -> int:
        """Implement ``ControlLaw.senses``."""
        return int(self.function.numel_in(0))

    @property
    def outputs(self) -> int:
        """Implement ``ControlLaw.outputs``."""
        return int(self.function.numel_out(0))

    @property
    def sizes(self) -> Mapping[str, int]:
        """Implement ``ControlLaw.sizes``."""
        return {"weights": int(self.function.numel_in(2))}

    def act(self, sensed: Expr, time: Expr, numbers: Mapping[str, Expr]) -> Expr:
        """Implement ``ControlLaw.act``."""
        return self.function(sensed, time, numbers["weights"])
