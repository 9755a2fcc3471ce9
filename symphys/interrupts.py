"""Ctrl-C: the first asks the solvers to stop where they can go on later, the second stops at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

Stop = Callable[[], bool]
"""Whether the user wants to stop."""


class Interrupts:
    """Counts Ctrl-C while ``listening``; ``interrupts()`` returns whether there was one."""

    def __init__(self) -> None:
        """Start without a request to stop."""
        self.requested = False

    def __call__(self) -> bool:
        """Whether Ctrl-C was pressed."""
        return self.requested

    def take(self, number: int, frame: FrameType | None) -> None:
        """The handler of the signal."""
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

    @contextmanager
    def listening(self) -> Iterator[Interrupts]:
        """Take SIGINT within the block; signals reach the main thread only, so elsewhere this does nothing."""
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        before = signal.signal(signal.SIGINT, self.take)
        try:
            yield self
        finally:
            signal.signal(signal.SIGINT, before)


@contextmanager
def ignoring_interrupts() -> Iterator[None]:
    """Processes started within the block never see Ctrl-C: the process that started them stops them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
