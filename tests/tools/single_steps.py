"""What staged problems in plain Python lack: motions all at once, slopes in runs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from symphys.shooting import Linearized, StagedMotion


class SingleSteps:
    """Steps that are taken one by one, and slopes that are given one by one."""

    steps: int
    linearize: Any

    def follow(self, *arguments: Any) -> None:
        """Not at once."""

    def without_forces(self) -> Any:
        """Itself: it has none."""
        return self

    def whole_gains(self, motion: StagedMotion, steps: Any, by_state: Any) -> Any:
        """As they are: tangents are of all of a state."""
        return by_state

    def linearize_from_end(self, motion: StagedMotion) -> Iterator[Linearized]:
        """Step by step."""
        found = self.linearize(motion)
        for k in reversed(range(self.steps)):
            yield Linearized(*(part[k : k + 1] for part in (found.a, found.b, found.c)), found.start)
