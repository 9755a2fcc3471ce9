"""Compiled kernels on disk, one file each: ``<key>-<checksum of the content>.so``, or ``.cubin`` for a device.

A file appears whole under its name or not at all, so that readers need no lock; a file whose content is not that of
its name is removed and built again. Processes that want the same kernel wait for the first one to build it.

Clocks that are set, and those of file servers, may give files times that are still to come. Nothing depends on them but
which kernels go first when the cache is full.

A kernel is code that runs as the user, so it is loaded only from a folder, and a file, that nobody else may write to.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.temporary import lock as lock_file
from symphys.records import dataclass

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

MAX_CACHE_BYTES = 512 * 2**20
"""[bytes] Total size of the kernels; those not used for longest go first."""
KINDS = (".so", ".cubin")
"""Suffixes of kernels for processors and for devices."""
PLAN_SUFFIX = ".plan"
"""Suffix of plans beside kernels, with which a second start need not plan them; see ``warm_start``."""
MAX_UNFINISHED_AGE = 3600.0
"""[s] Age at which an unfinished file, or a free lock, counts as left by a killed process."""
LOCK_TIMEOUT, LOCK_INTERVAL = 900.0, 0.05
"""[s] to wait for another process, which may be stopped as by Ctrl-Z; [s] between two attempts."""
MAX_CLOCK_SKEW = 60.0
"""[s] Largest difference between the clocks of two machines."""


@dataclass(frozen=True)
class CacheInfo:
    """The contents of a cache: its folder, the number of kernels, their bytes and how many it may hold."""

    folder: Path
    kernels: int
    bytes: int
    limit: int


@dataclass(frozen=True)
class Cache:
    """A folder of kernels, of at most ``limit`` bytes; finds and stores files of one kind, its ``suffix``."""

    folder: Path
    limit: int = MAX_CACHE_BYTES
    suffix: str = KINDS[0]

    def distrust(self) -> str:
        """Return why the folder's kernels cannot be trusted, and the remedy; empty if they can, or without a folder."""
        try:
            status = self.folder.stat()
        except OSError:
            return ""
        if not _own(status):
            return (
                "the folder belongs to somebody else, whose kernels are not run; set SYMPHYS_CACHE to one of your own"
            )
        if _others_write(status):
            way = f"run chmod go-w {self.folder}, or set SYMPHYS_CACHE to another folder"
            return f"others may write to the folder, and their kernels would run as yours; {way}"
        return ""

    def make(self) -> None:
        """Make the folder, for the user alone; OSError if that cannot be, or if it is there and cannot be trusted."""
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if why := self.distrust():
            raise PermissionError(errno.EPERM, why, str(self.folder))

    def find(self, key: str) -> Path | None:
        """Return the kernel of a key; None if there is none, if it is damaged, or if it cannot be trusted."""
        if self.distrust():
            return None
        for path in self._files(f"{key}-*{self.suffix}"):
            try:
                whole = _safe(path) and path.stem.split("-")[1] == _checksum(path)
            except OSError:  # such as too many open files: what cannot be read now is not damaged
                continue
            with contextlib.suppress(OSError):
                if whole:
                    os.utime(path)
                else:
                    path.unlink()
            if whole:
                return path
        return None

    def store(self, key: str, built: Path) -> Path:
        """Take over a library; OSError if the folder does not take it."""
        self.make()
        target = self.folder / f"{key}-{_checksum(built)}{self.suffix}"
        handle, name = tempfile.mkstemp(prefix=".new-", dir=self.folder)
        os.close(handle)
        try:
            shutil.copyfile(built, name)
            Path(name).replace(target)
        finally:
            Path(name).unlink(missing_ok=True)
        self._shrink(target)
        return target

    @contextlib.contextmanager
    def building(self, key: str) -> Iterator[None]:
        """Hold the right to build a kernel.

        Where files cannot be locked, and where the process that has the right does not end, several may build at once.
        That is safe: each stores a file of its own content, whole.
        """
        if fcntl is None:
            yield
            return
        try:
            self.make()
            lock = (self.folder / f".{key}.lock").open("w")
        except OSError:
            yield
            return
        with lock:
            _wait_for(lock)
            try:
                yield
            finally:
                with contextlib.suppress(OSError):
                    Path(lock.name).unlink()

    def info(self) -> CacheInfo:
        """Count the kernels and their bytes."""
        entries = self._entries()
        kernels = sum(path.suffix in KINDS for _, _, path in entries)
        return CacheInfo(self.folder, kernels, sum(size for _, size, _ in entries), self.limit)

    def clear(self) -> int:
        """Remove all kernels and their plans; return the number of kernels removed. Programs that use one go on."""
        gone = 0
        for _, _, path in self._entries():
            with contextlib.suppress(OSError):
                path.unlink()
                gone += path.suffix in KINDS
        self._sweep(0.0)
        return gone

    def _sweep(self, age: float) -> None:
        """Remove files that killed processes have left, if their time is at least ``age`` [s] away from the clock's."""
        for path in [*self._files(".new-*"), *self._files(".*.lock")]:
            with contextlib.suppress(OSError):
                if abs(time.time() - path.stat().st_mtime) >= age and (path.suffix != ".lock" or _free(path)):
                    path.unlink()

    def _files(self, pattern: str) -> list[Path]:
        try:
            return sorted(self.folder.glob(pattern))
        except OSError:
            return []

    def _entries(self) -> list[tuple[float, int, Path]]:
        """Return (time of last use, bytes, path) of each file, oldest first."""
        found = []
        for path in (path for kind in (*KINDS, PLAN_SUFFIX) for path in self._files(f"*{kind}")):
            with contextlib.suppress(OSError):
                status = path.stat()
                found.append((status.st_mtime, status.st_size, path))
        return sorted(found)

    def _shrink(self, keep: Path) -> None:
        self._sweep(MAX_UNFINISHED_AGE)
        now = time.time()
        for used, _, path in self._entries():
            if used > now + MAX_CLOCK_SKEW:  # it would be the last to go for as long as that time is still to come
                with contextlib.suppress(OSError):
                    os.utime(path, (now, now))
        entries = self._entries()
        total = sum(size for _, size, _ in entries)
        for _, size, path in entries:
            if total > self.limit and path != keep:
                with contextlib.suppress(OSError):
                    path.unlink()
                    total -= size


def default_cache() -> Cache:
    """Return the cache in $SYMPHYS_CACHE, else in the user's cache folder; KernelUnavailable if there is none."""
    wanted = os.environ.get("SYMPHYS_CACHE")
    if wanted:
        return Cache(Path(wanted))
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return Cache((Path(base) if base else Path.home() / ".cache") / "symphys" / "kernels")
    except RuntimeError as error:
        raise KernelUnavailable("no home folder in which to keep kernels; set SYMPHYS_CACHE to a folder") from error


def _wait_for(lock: IO[str]) -> None:
    """Lock an open file; continue without where files cannot be locked, and after LOCK_TIMEOUT."""
    end = time.monotonic() + LOCK_TIMEOUT
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= end:
                return
            time.sleep(LOCK_INTERVAL)
        except OSError:
            return
        else:
            return


def _free(path: Path) -> bool:
    """Whether no process holds a lock; False where that is not known."""
    if (handle := lock_file(path)) is None:
        return False
    os.close(handle)
    return True


def _safe(path: Path) -> bool:
    """Whether only the user or root can have written this file."""
    status = path.lstat()
    return stat.S_ISREG(status.st_mode) and _own(status) and not _others_write(status)


def _own(status: os.stat_result) -> bool:
    """Whether it belongs to the user, or to root; Windows keeps others out of the user's folders by itself."""
    return sys.platform == "win32" or status.st_uid in (os.geteuid(), 0)


def _others_write(status: os.stat_result) -> bool:
    """Whether group or others may write to it."""
    return sys.platform != "win32" and bool(status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


def _checksum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:32]
