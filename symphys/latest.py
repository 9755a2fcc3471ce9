"""The things that were made last, by their keys: a process asks for the same again."""

from __future__ import annotations

import threading
from collections.abc import Hashable
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """Keeps a few things; the one that came first goes first. Threads may share it."""

    def __init__(self, most: int) -> None:
        """Begin with nothing; ``most``: how many are kept."""
        self._most, self._kept, self._lock = most, dict[Hashable, T](), threading.Lock()

    def get(self, key: Hashable) -> T | None:
        """Return what is kept under a key; None if that is nothing."""
        with self._lock:
            return self._kept.get(key)

    def put(self, key: Hashable, made: T) -> T:
        """Keep a thing, and return it."""
        with self._lock:
            self._kept[key] = made
            while len(self._kept) > self._most:
                del self._kept[next(iter(self._kept))]
        return made
