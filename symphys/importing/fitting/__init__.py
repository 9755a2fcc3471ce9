"""Shapes in place of meshes: ``fit`` finds them and says how far off they are; ``draw_fit`` draws both."""

from __future__ import annotations

from symphys.importing.fitting.fit import KINDS, Fit, best, fit, fits
from symphys.importing.fitting.picture import draw_fit

__all__ = ["KINDS", "Fit", "best", "draw_fit", "fit", "fits"]
