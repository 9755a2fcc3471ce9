"""Compilers as processes: side by side, with a time limit and none left behind; or in the background of a solve.

A background process ends by itself and keeps the kernel for the next start: a program that ends earlier does not wait,
and Ctrl-C does not end it.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from queue import Empty, SimpleQueue

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.cache import Cache
from symphys.codegen.toolchain.source_file import SourceFile
from symphys.records import dataclass

SIGNAL_INTERVAL = 0.2
"""[s] The main thread wakes so often: a signal that arrives as a wait begins, or in another thread, does not end it."""
JOIN_TIMEOUT = 10.0
"""[s] to wait for a thread whose compiler was stopped."""
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
"""The error, or None, of each command that is over."""
PROCESS = "import sys; from symphys.codegen.toolchain.libraries import compile_for; compile_for(sys.stdin.buffer)"
Built = Callable[[Path], None]


@dataclass
class Running:
    """A compiler process; on POSIX it leads a process group, so that its children end with it.

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
        """Return its output; KernelUnavailable says how it failed."""
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
        """End it and its children."""
        with contextlib.suppress(OSError):
            if self.process.poll() is None and hasattr(os, "killpg"):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.kill()


def run(command: Sequence[str], limit: float, folder: Path | None = None) -> str:
    """Return the output of a command; KernelUnavailable says how it failed.

    ``folder``: for temporary files of the command, so that none is left when the command is killed.
    """
    return _start(command, limit, folder).said()


def run_all(commands: Sequence[Sequence[str]], limit: float, at_once: int, folder: Path | None = None) -> None:
    """Run commands side by side; the first that fails ends the others, as does Ctrl-C. ``folder``: see ``run``."""
    ended: Ended = SimpleQueue()
    with _interrupted(ended):
        _Crew(commands, limit, ended, folder).run(at_once)


@contextlib.contextmanager
def _interrupted(ended: Ended) -> Iterator[None]:
    """Make Ctrl-C one more error that is waited for: raised inside a finalizer it would be lost."""
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
                if (error := self._next_end()) is not None:
                    raise error
        finally:
            self.over.set()
            for running in self.started:
                running.stop()
            for worker in workers:
                if worker.ident is not None:
                    worker.join(JOIN_TIMEOUT)

    def _next_end(self) -> BaseException | None:
        """Wait for the error, or None, of the next command that is over, and for signals."""
        while True:
            with contextlib.suppress(Empty):
                return self.ended.get(timeout=SIGNAL_INTERVAL)

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


class Background:
    """A process that compiles, and a thread that waits for it."""

    def __init__(
        self, parts: Sequence[SourceFile], texts: str, cache: Cache, done: Built, failed: Callable[[str], None]
    ) -> None:
        """Start the process; KernelUnavailable if that fails.

        Args:
            parts: C files.
            texts: their identity, see ``shared_library``.
            cache: where the library is kept.
            done: called with the path of the library.
            failed: called with the reason if there is none.
        """
        self._done, self._failed = done, failed
        given = {
            "parts": [asdict(part) for part in parts],
            "texts": texts,
            "cache": {"folder": str(cache.folder), "limit": cache.limit},
        }
        self._process = _begun(json.dumps(given).encode())
        self._thread = threading.Thread(target=self._run, name="symphys-compiler", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it is still compiling."""
        return self._thread.is_alive()

    def finish(self) -> None:
        """Wait for its end."""
        while self._thread.is_alive():
            self._thread.join(SIGNAL_INTERVAL)

    def _run(self) -> None:
        try:
            self._done(_library(self._process))
        except (KernelUnavailable, OSError) as error:
            self._failed(str(error))


def _begun(given: bytes) -> subprocess.Popen[bytes]:
    """Start a process that reads from an unnamed file, so that its parent may end at once."""
    try:
        with tempfile.TemporaryFile() as file:
            file.write(given)
            file.seek(0)
            return subprocess.Popen(
                [sys.executable, "-c", PROCESS],
                stdin=file,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
    except OSError as error:
        raise KernelUnavailable(f"no process that compiles can be started: {error.strerror or error}") from error


def _library(process: subprocess.Popen[bytes]) -> Path:
    """Return the library that a process compiles; KernelUnavailable says why there is none."""
    said = process.communicate()[0]
    if process.returncode or not said:
        raise KernelUnavailable(f"the process that compiles ended with code {process.returncode}")
    found = json.loads(said)
    if "error" in found:
        raise KernelUnavailable(found["error"])
    return Path(found["path"])
