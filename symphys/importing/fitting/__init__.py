"""Shapes in place of meshes: ``fit`` finds them and says how far off they are; ``draw_fit`` draws both."""

from __future__ import annotations

from symphys.importing.fitting.fit import KINDS, Fit, best, draw_fit, fit, fits

__all__ = ["KINDS", "Fit", "best", "draw_fit", "fit", "fits"]
