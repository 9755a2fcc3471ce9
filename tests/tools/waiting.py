"""Waiting for what another process or thread does, however slow the machine is."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path

FOREVER = 1800.0
"""[s] A wait of this time has failed: many times what a machine under a load of twenty needs."""


def until(done: Callable[[], bool]) -> None:
    """Wait for a condition; AssertionError if it never holds."""
    end = time.monotonic() + FOREVER
    while not done():
        assert time.monotonic() < end
        time.sleep(0.02)


def wait_for(path: Path) -> None:
    """Wait until a file has a whole line."""
    until(lambda: path.exists() and path.read_text("utf-8").endswith("\n"))


def assert_gone(started: Path) -> None:
    """Wait until every process has ended whose number is in the file, which is missing where none came that far."""
    numbers = started.read_text("utf-8").split() if started.exists() else []
    until(lambda: not any(alive(int(number)) for number in numbers))


def alive(number: int) -> bool:
    """Whether a process runs; one that nobody has waited for yet does not."""
    done = subprocess.run(["ps", "-o", "stat=", "-p", str(number)], capture_output=True, text=True, check=False)
    return bool(done.stdout.strip()) and not done.stdout.startswith("Z")
