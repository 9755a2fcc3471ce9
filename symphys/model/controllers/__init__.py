"""Controllers: from what is sensed to what inputs are, with numbers that solvers may choose."""

from symphys.model.controllers.custom import Custom
from symphys.model.controllers.law import ControlLaw
from symphys.model.controllers.linear import Linear
from symphys.model.controllers.net import ACTIVATIONS, Net
from symphys.model.controllers.periodic import Periodic

__all__ = ["ACTIVATIONS", "ControlLaw", "Custom", "Linear", "Net", "Periodic"]
