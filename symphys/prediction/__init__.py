"""Predictions of problems for their recordings, as the residuals of identification."""

from symphys.prediction.identifying import identify
from symphys.prediction.predictor import Predictor
from symphys.prediction.residuals import RecordingResiduals, residuals_of

__all__ = ["Predictor", "RecordingResiduals", "identify", "residuals_of"]
