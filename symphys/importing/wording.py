"""Counts and lists of names in messages."""

from __future__ import annotations

from collections.abc import Sequence

LISTED = 6
"""Names that a message lists at most."""


def listed(names: Sequence[str]) -> str:
    """The first few names, and how many more there are."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def counted(count: int, one: str, many: str = "") -> str:
    """``1 mesh``, ``3 meshes``."""
    return f"{count} {one}" if count == 1 else f"{count} {many or one + 's'}"
