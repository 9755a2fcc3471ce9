"""The order of a function's statements: loads where they are used, or many of them at once, ahead of what uses them.

A processor looks ahead by itself. A thread of a device waits at the first value that is not there yet, and its compiler
moves no load across a store that might write the same word.
"""

from __future__ import annotations


class Lines:
    """Statements as they come, in groups: of each group first all loads, then what is computed, then all stores."""

    def __init__(self, ahead: int) -> None:
        """``ahead``: loads of a group; 0: every statement stays where it is."""
        self._ahead = ahead
        self._done: list[str] = []
        self._loads: list[str] = []
        self._computed: list[str] = []
        self._stores: list[str] = []
        self._sums: dict[str, str] = {}
        self._count = 0

    def load(self, line: str) -> None:
        """A statement that reads a place."""
        self._loads.append(line)
        self._next()

    def compute(self, line: str) -> None:
        """A statement that meets no place."""
        self._computed.append(line)
        self._next()

    def store(self, line: str) -> None:
        """A statement that writes a place."""
        self._stores.append(line)
        self._next()

    def add(self, to: str, value: str) -> None:
        """Add to a word that no other name leads to."""
        if to not in self._sums:
            self._sums[to], self._count = f"s{self._count}", self._count + 1
            self._loads.append(f"V {self._sums[to]} = {to};")
        self._computed.append(f"{self._sums[to]} += {value};")
        self._next()

    def all(self) -> list[str]:
        """The statements in their order."""
        self._close()
        return self._done

    def _next(self) -> None:
        if len(self._loads) >= self._ahead:
            self._close()

    def _close(self) -> None:
        sums = [f"{to} = {name};" for to, name in self._sums.items()]
        self._done += [*self._loads, *self._computed, *self._stores, *sums]
        for group in (self._loads, self._computed, self._stores, self._sums):
            group.clear()
