"""Compilers as processes: side by side, with a time limit, and none left behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

from symphys.codegen.errors import KernelUnavailable

PARTING = 10.0
"""[s] that a thread is waited for whose compiler was stopped."""
ADVICE = "install gcc or clang (or `pip install ziglang`), or set CC to a C compiler"
ELSEWHERE = "make room there, or set TMPDIR to another folder"
MEMORY_WORDS = (
    "memory exhausted",
    "out of memory",
    "outofmemory",
    "cannot allocate memory",
    "bad_alloc",
    "failed to map segment",
)
ROOM_WORDS = ("no space left on device", "disk quota exceeded", "read-only file system")
Ended = SimpleQueue[BaseException | None]
"""An error, or None, of each command that is over."""


@dataclass
class Running:
    """A compiler at work; on POSIX it leads a group, so that what it starts ends with it.

    Attributes:
        name: of the program.
        limit: [s] that it may take.
        folder: where it writes; None: wherever it does.
    """

    name: str
    process: subprocess.Popen[str]
    limit: float
    folder: Path | None = None

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
            raise KernelUnavailable(_failure(self.name, self.process.returncode, err.strip(), self.folder))
        return out

    def stop(self) -> None:
        """End it and all that it started."""
        with contextlib.suppress(OSError):
            if self.process.poll() is None and hasattr(os, "killpg"):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.kill()


def run(command: Sequence[str], limit: float, folder: Path | None = None) -> str:
    """What a command prints, within so many seconds; KernelUnavailable says how it failed.

    ``folder``: where the command keeps what is temporary, so that nothing of it stays when the command is killed.
    """
    return _start(command, limit, folder).said()


def run_all(commands: Sequence[Sequence[str]], limit: float, at_once: int, folder: Path | None = None) -> None:
    """Run commands side by side; the first that fails ends the others, and so does Ctrl-C. ``folder``: see ``run``."""
    ended: Ended = SimpleQueue()
    with _interrupted(ended):
        _Crew(commands, limit, ended, folder).run(at_once)


@contextlib.contextmanager
def _interrupted(ended: Ended) -> Iterator[None]:
    """Ctrl-C is one more error that is waited for: raised wherever it strikes, it is lost in a finalizer."""
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda *_: ended.put(KeyboardInterrupt()))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if not ended.empty():
        raise KeyboardInterrupt


class _Crew:
    """Threads that run commands, each a process, one after the other."""

    def __init__(
        self, commands: Sequence[Sequence[str]], limit: float, ended: Ended, folder: Path | None = None
    ) -> None:
        self.limit, self.ended, self.folder = limit, ended, folder
        self.over, self.started = threading.Event(), list[Running]()
        self.waiting: SimpleQueue[Sequence[str]] = SimpleQueue()
        for command in commands:
            self.waiting.put(command)

    def run(self, at_once: int) -> None:
        """Wait for all commands."""
        count = self.waiting.qsize()
        workers = [threading.Thread(target=self.work, daemon=True) for _ in range(min(at_once, count))]
        try:
            for worker in workers:
                worker.start()
            for _ in range(count):
                if (error := self.ended.get()) is not None:
                    raise error
        finally:
            self.over.set()
            for running in self.started:
                running.stop()
            for worker in workers:
                if worker.ident is not None:
                    worker.join(PARTING)

    def work(self) -> None:
        """Run one command after the other; each leaves an error, or None."""
        while not self.over.is_set():
            try:
                running = _start(self.waiting.get_nowait(), self.limit, self.folder)
                self.started.append(running)
                if self.over.is_set():
                    running.stop()
                running.said()
            except Empty:
                return
            except BaseException as error:
                self.ended.put(error)
            else:
                self.ended.put(None)


def _start(command: Sequence[str], limit: float, folder: Path | None = None) -> Running:
    name = Path(command[0]).name
    places = {} if folder is None else dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,
            env=os.environ | places,
        )
    except OSError as error:
        raise KernelUnavailable(f"the compiler {name} cannot be run ({error.strerror}): {ADVICE}") from error
    return Running(name, process, limit, folder)


def _failure(name: str, code: int, said: str, folder: Path | None = None) -> str:
    if folder and (why := next((words for words in ROOM_WORDS if words in said.lower()), "")):
        return f"the compiler {name} cannot write to {folder}: {why}; {ELSEWHERE}"
    if any(word in said.lower() for word in MEMORY_WORDS):
        return f"the compiler {name} ran out of memory; close other programs or use fewer processes"
    if code < 0 or "signal" in said.lower():
        return f"the compiler {name} was killed (often: out of memory); the kernel was not built"
    line = next((line for line in said.splitlines() if "error" in line.lower()), said.splitlines()[0] if said else "")
    return f"the compiler {name} failed with code {code}: {line}"
