"""Identification: fits of recordings and their uncertainty, without physics.

``interface`` has the problem, ``identify`` the way through.
"""

from symphys.identification.fitting.fit import FittedRecordings, fit
from symphys.identification.fitting.multistart import SearchOptions
from symphys.identification.fitting.state import FitOptions, FitOutcome, FitState, FitStatus, FitStep, revive_state
from symphys.identification.identify import IdentificationOptions, identify
from symphys.identification.interface import (
    FitParameters,
    IdentificationError,
    RecordedResiduals,
    ResidualRows,
    fit_parameters,
)

__all__ = [
    "FitOptions",
    "FitOutcome",
    "FitParameters",
    "FitState",
    "FitStatus",
    "FitStep",
    "FittedRecordings",
    "IdentificationError",
    "IdentificationOptions",
    "RecordedResiduals",
    "ResidualRows",
    "SearchOptions",
    "fit",
    "fit_parameters",
    "identify",
    "revive_state",
]
