"""Why numbers are no recording: one message, and the key of the [[recording]] table that it concerns."""

from __future__ import annotations


class RecordingFault(ValueError):
    """What is wrong with a recording.

    Attributes:
        key: of the table.
    """

    def __init__(self, key: str | tuple[str | int, ...], message: str) -> None:
        """Keep the key, or the place below the table, and the message for the user."""
        self.key = (key,) if isinstance(key, str) else key
        super().__init__(message)
