"""The error of a formula."""

from __future__ import annotations

from symphys.errors import SymphysError


class FormulaError(SymphysError):
    """A formula that cannot be read or evaluated; the message names the piece at fault and what is allowed."""


class UnfitError(ValueError):
    """Values that an operation cannot take; becomes a FormulaError that names the piece of the formula."""
