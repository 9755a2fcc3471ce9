"""Names that mean a number."""

from __future__ import annotations

from math import pi

CONSTANTS = {"pi": pi}
INSTANTS = ("start", "end")
"""Before a name: its value at the first or at the last instant of a motion, as in ``end.knee.angle``."""
OF_INSTANTS = ("time", "alive")
"""Names without a dot that differ from instant to instant: ``end.time`` is the duration."""
OVER_TIME = {
    "integral": "integral(f): of a formula over the time of the motion",
    "average": "average(f): of a formula over the time of the motion",
}
"""What whole motions have of a formula, and how it is written."""
