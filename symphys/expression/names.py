"""Names that mean a number."""

from __future__ import annotations

from math import pi

CONSTANTS = {"pi": pi}
