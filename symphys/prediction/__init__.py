"""What problems predict for their recordings, as the residuals of identification."""

from symphys.prediction.predictor import Predictor
from symphys.prediction.residuals import RecordingResiduals, residuals_of

__all__ = ["Predictor", "RecordingResiduals", "residuals_of"]
