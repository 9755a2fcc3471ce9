"""Temporary folders that do not stay behind: those of processes that were killed go when the next one is made.

A process keeps a file in each of its folders locked. The system ends the lock with the process, however that ends.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import tempfile
import time
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

KINDS = ("symphys-kernel-", "symphys-external-", "symphys-cuda-")
"""Prefixes of the names of folders."""
LOCK = ".in-use"
"""The file that is locked."""
MIN_UNLOCKED_AGE, MAX_UNLOCKED_AGE = 60.0, 86400.0
"""[s] A younger folder may not be locked yet; an older one without a lock has no process any more."""


class TemporaryFolder(tempfile.TemporaryDirectory[str]):
    """A folder that lasts as long as the context; OSError if there is no room for one."""

    def __init__(self, kind: str) -> None:
        """Remove folders that were left behind, then make one; ``kind``: one of KINDS."""
        sweep(Path(tempfile.gettempdir()))
        super().__init__(prefix=kind, ignore_cleanup_errors=True)
        self.handle = lock(Path(self.name) / LOCK, os.O_CREAT)

    def cleanup(self) -> None:
        """Remove the folder."""
        super().cleanup()
        if self.handle is not None:
            os.close(self.handle)
            self.handle = None


def sweep(place: Path) -> None:
    """Remove the user's folders in a place whose processes are gone."""
    for kind in KINDS:
        for folder in place.glob(f"{kind}*"):
            with contextlib.suppress(OSError):
                if is_left(folder):
                    shutil.rmtree(folder, ignore_errors=True)


def is_left(folder: Path) -> bool:
    """Whether no process uses the folder any more; False if unknown. OSError if it disappears meanwhile."""
    status = folder.lstat()
    age = abs(time.time() - status.st_mtime)  # a clock that was set back makes times that are still to come
    if (
        not stat.S_ISDIR(status.st_mode)
        or age < MIN_UNLOCKED_AGE
        or (hasattr(os, "geteuid") and status.st_uid != os.geteuid())
    ):
        return False
    if fcntl is None or not (folder / LOCK).exists():
        return age > MAX_UNLOCKED_AGE
    handle = lock(folder / LOCK)
    if handle is None:
        return False
    os.close(handle)
    return True


def lock(path: Path, flags: int = 0) -> int | None:
    """Lock a file as long as the returned handle is open; None if it is locked, or cannot be."""
    if fcntl is None:
        return None
    try:
        handle = os.open(path, os.O_RDWR | flags, 0o600)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle
