"""The contents of an identification folder: one definition for writer and reader."""

from symphys.results.identification.record import (
    ARRAYS,
    HISTORY,
    IDENTIFICATION,
    GlobalSearch,
    Identification,
    OpenDirection,
    ParameterEstimate,
    PredictionErrors,
    QuantityResiduals,
    read_identification,
)
from symphys.results.identification.summary import summary

__all__ = [
    "ARRAYS",
    "HISTORY",
    "IDENTIFICATION",
    "GlobalSearch",
    "Identification",
    "OpenDirection",
    "ParameterEstimate",
    "PredictionErrors",
    "QuantityResiduals",
    "read_identification",
    "summary",
]
