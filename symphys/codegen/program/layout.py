"""Places handed out one after the other: who builds a program need not count words."""

from __future__ import annotations

from symphys.codegen.program.program import Place


class MemoryLayout:
    """A memory that grows as places are taken from it."""

    def __init__(self) -> None:
        """Begin with no words."""
        self.size = 0

    def take(self, size: int) -> Place:
        """Words for a vector."""
        place = Place(self.size, size)
        self.size += size
        return place

    def series(self, size: int, count: int) -> Place:
        """Words for ``count`` vectors one after the other, with the stride that leads from each to the next."""
        place = Place(self.size, size, size)
        self.size += size * count
        return place
