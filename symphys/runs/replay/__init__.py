"""A run rolled out again from its own folder, and compared with what is recorded there."""

from symphys.runs.replay.comparison import QuantityDifference
from symphys.runs.replay.replay import PARTS, Replay, replay

__all__ = ["PARTS", "QuantityDifference", "Replay", "replay"]
