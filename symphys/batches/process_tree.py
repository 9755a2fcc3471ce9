"""A process and all that it has started: compilers lead groups of their own, so that a group does not reach them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from pathlib import Path

PATIENCE = 1.0
"""[s] that ``ps`` may take, where there is no /proc."""


def end_tree(process: int) -> None:
    """Kill a process and its descendants. All are halted first, so that none starts another while they are listed."""
    found: list[int] = []
    new = [process]
    while new:
        send(new, "SIGSTOP")
        found += new
        parents = parents_by_process()
        new = [each for each, parent in parents.items() if parent in found and each not in found]
    send(found, "SIGKILL")


def send(processes: list[int], name: str) -> None:
    """Send a signal by its name; Windows knows one way to end a process, and cannot halt it."""
    number = getattr(signal, name, None)
    for process in processes:
        with contextlib.suppress(OSError):
            if number is not None:
                os.kill(process, number)
            elif name == "SIGKILL":
                os.kill(process, signal.SIGTERM)


def parents_by_process() -> dict[int, int]:
    """The parent of every process of this machine that can be seen; empty where the system does not say."""
    found: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            text = entry.read_text(encoding="utf-8", errors="replace")
            found[int(entry.parent.name)] = int(text.rpartition(")")[2].split()[1])
    return found or listed_by_ps()


def listed_by_ps() -> dict[int, int]:
    """``parents_by_process`` where there is no /proc."""
    try:
        command = ["ps", "-A", "-o", "pid=,ppid="]
        listed = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False).stdout
    except (OSError, subprocess.SubprocessError):
        return {}
    pairs = [line.split() for line in listed.splitlines()]
    return {int(pair[0]): int(pair[1]) for pair in pairs if len(pair) == 2 and all(map(str.isdigit, pair))}
