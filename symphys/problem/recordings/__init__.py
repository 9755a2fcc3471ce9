"""Measured motions: read from CSV and NPZ files or from tables of numbers, checked, and in the units of the engine."""

from symphys.problem.recordings.types import IdentifySettings, Measured, RecordedFile, RecordedInput, Recording

__all__ = ["IdentifySettings", "Measured", "RecordedFile", "RecordedInput", "Recording"]
