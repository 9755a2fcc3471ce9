"""The error about a model that cannot be read."""

from __future__ import annotations

from symphys.errors import SymphysError


class ImportProblem(SymphysError):
    """A model that cannot be read: the file, where in it, and what would be valid."""

    def __init__(self, file: str, text: str, where: str = "") -> None:
        """``where``: element and attribute, or an option; may be empty."""
        self.file, self.where, self.text = file, where, text
        super().__init__(f"{file}: {where + ': ' if where else ''}{text}")
