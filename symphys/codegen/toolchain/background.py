"""Compilers beside a solve: a process of its own, which ends by itself and keeps the kernel for the next start.

Whoever ends before it does not wait for it, nor does Ctrl-C end it: a second start finds what the first one began.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.cache import Cache

if TYPE_CHECKING:
    from symphys.codegen.emit.source import SourceFile

PROCESS = "import sys; from symphys.codegen.toolchain.build import compile_for; compile_for(sys.stdin.buffer)"
Built = Callable[[Path], None]


class Background:
    """A process that compiles, and a thread that waits for it."""

    def __init__(
        self, parts: Sequence[SourceFile], texts: str, cache: Cache, done: Built, failed: Callable[[str], None]
    ) -> None:
        """Begin; KernelUnavailable if that cannot be.

        Args:
            parts: C files.
            texts: what stands for them, see ``shared_library``.
            cache: where the library is kept.
            done: called with the library.
            failed: called with why there is none.
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
        """Whether it is still at work."""
        return self._thread.is_alive()

    def finish(self) -> None:
        """Wait for its end."""
        self._thread.join()

    def _run(self) -> None:
        try:
            self._done(_library(self._process))
        except (KernelUnavailable, OSError) as error:
            self._failed(str(error))


def _begun(given: bytes) -> subprocess.Popen[bytes]:
    """A process that reads from a file without a name, so that who gives it may end at once."""
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
    """What a process compiles; KernelUnavailable says why it does not."""
    said = process.communicate()[0]
    if process.returncode or not said:
        raise KernelUnavailable(f"the process that compiles ended with code {process.returncode}")
    found = json.loads(said)
    if "error" in found:
        raise KernelUnavailable(found["error"])
    return Path(found["path"])
