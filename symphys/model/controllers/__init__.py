"""Controllers: from what is sensed to what inputs are, with numbers that solvers may choose."""

from collections.abc import Mapping
from types import MappingProxyType

from symphys.model.controllers.custom import Custom
from symphys.model.controllers.law import ControlLaw, DeclaredLaw
from symphys.model.controllers.linear import Linear
from symphys.model.controllers.net import ACTIVATIONS, Net
from symphys.model.controllers.periodic import Periodic

CONTROLLERS: Mapping[str, type[Linear | Periodic]] = MappingProxyType({"linear": Linear, "periodic": Periodic})
"""By their keys in [[controller]] tables, which follow from what each class says of itself; see ``DeclaredLaw``."""

__all__ = ["ACTIVATIONS", "CONTROLLERS", "ControlLaw", "Custom", "DeclaredLaw", "Linear", "Net", "Periodic"]
