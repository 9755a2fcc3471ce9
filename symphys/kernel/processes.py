"""Compilers as processes: side by side, with a time limit, and none left behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

from symphys.kernel.errors import KernelUnavailable

PARTING = 10.0
"""[s] that a thread is waited for whose compiler was stopped."""
ADVICE = "install gcc or clang (or `pip install ziglang`), or set CC to a C compiler"
MEMORY_WORDS = (
    "memory exhausted",
    "out of memory",
    "outofmemory",
    "cannot allocate memory",
    "bad_alloc",
    "failed to map segment",
)


@dataclass
class Running:
    """A compiler at work; on POSIX it leads a group, so that what it starts ends with it."""

    name: str
    process: subprocess.Popen[str]
    limit: float

    def said(self) -> str:
        """What it printed; KernelUnavailable says how it failed."""
        with self.process:
            try:
                out, err = self.process.communicate(timeout=self.limit)
            except subprocess.TimeoutExpired:
                self.stop()
                why = f"did not end within {self.limit:g} s and was stopped; the kernel was not built"
                raise KernelUnavailable(f"the compiler {self.name} {why}") from None
            except BaseException:
                self.stop()
                raise
        if self.process.returncode:
            raise KernelUnavailable(_failure(self.name, self.process.returncode, err.strip()))
        return out

    def stop(self) -> None:
        """End it and all that it started."""
        with contextlib.suppress(OSError):
            if self.process.poll() is None and hasattr(os, "killpg"):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.kill()


def run(command: Sequence[str], limit: float) -> str:
    """What a command prints, within so many seconds; KernelUnavailable says how it failed."""
    return _start(command, limit).said()


def run_all(commands: Sequence[Sequence[str]], limit: float, at_once: int) -> None:
    """Run commands side by side; the first that fails ends the others, and so does Ctrl-C.

    Threads hand over by simple queues: the locks of ``concurrent.futures``, written in Python, can stay locked where
    Ctrl-C strikes, and then nothing ends.
    """
    waiting: SimpleQueue[Sequence[str]] = SimpleQueue()
    for command in commands:
        waiting.put(command)
    over, started, ended = threading.Event(), list[Running](), SimpleQueue[BaseException | None]()
    workers = [
        threading.Thread(target=_work, args=(waiting, limit, over, started, ended), daemon=True)
        for _ in range(min(at_once, len(commands)))
    ]
    try:
        for worker in workers:
            worker.start()
        for _ in commands:
            if (error := ended.get()) is not None:
                raise error
    finally:
        over.set()
        for running in started:
            running.stop()
        for worker in workers:
            if worker.ident is not None:
                worker.join(PARTING)


def _work(
    waiting: SimpleQueue[Sequence[str]],
    limit: float,
    over: threading.Event,
    started: list[Running],
    ended: SimpleQueue[BaseException | None],
) -> None:
    """Run one command after the other; each leaves an error, or None."""
    while not over.is_set():
        try:
            command = waiting.get_nowait()
        except Empty:
            return
        try:
            running = _start(command, limit)
            started.append(running)
            if over.is_set():
                running.stop()
            running.said()
        except BaseException as error:
            ended.put(error)
        else:
            ended.put(None)


def _start(command: Sequence[str], limit: float) -> Running:
    name = Path(command[0]).name
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,
        )
    except OSError as error:
        raise KernelUnavailable(f"the compiler {name} cannot be run ({error.strerror}): {ADVICE}") from error
    return Running(name, process, limit)


def _failure(name: str, code: int, said: str) -> str:
    if any(word in said.lower() for word in MEMORY_WORDS):
        return f"the compiler {name} ran out of memory; close other programs or use fewer processes"
    if code < 0 or "signal" in said.lower():
        return f"the compiler {name} was killed (often: out of memory); the kernel was not built"
    line = next((line for line in said.splitlines() if "error" in line.lower()), said.splitlines()[0] if said else "")
    return f"the compiler {name} failed with code {code}: {line}"
