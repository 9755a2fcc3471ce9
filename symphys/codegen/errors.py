"""Errors between a program and its kernel."""

from __future__ import annotations

from symphys.errors import SymphysError, Unavailable


class ProgramError(SymphysError):
    """A program that contradicts itself; names the call and the words."""


class KernelUnavailable(Unavailable):
    """No kernel can be built here; one line says why, and what to install or to do. The caller falls back."""
