"""Whether a descent still gets anywhere: at the kinks of contact problems it may creep for ever."""

from __future__ import annotations

from dataclasses import dataclass

WORTH = 1e-5
"""A fall of the merit by this share of itself is progress."""


@dataclass(frozen=True)
class Progress:
    """The merit at the last progress, and the iterations since."""

    mark: float
    quiet: int = 0

    def after(self, merit: float) -> Progress:
        """With one iteration more, at ``merit``."""
        if merit < self.mark - WORTH * abs(self.mark):
            return Progress(merit)
        return Progress(self.mark, self.quiet + 1)
