"""Controllers: from what is sensed to what inputs are, with numbers that solvers may choose."""

from symphys.controllers.given import Given
from symphys.controllers.law import Law
from symphys.controllers.linear import Linear
from symphys.controllers.net import ACTIVATIONS, Net
from symphys.controllers.periodic import Periodic

__all__ = ["ACTIVATIONS", "Given", "Law", "Linear", "Net", "Periodic"]
