"""The lock of a run folder, held by a folder in it, so that any number of commands can share a batch.

A claim is a folder ``.claim/TOKEN`` in the run folder, with a text that says who holds it. It is made under a name of
its own, and the folder around it is renamed to ``.claim``. That works only where ``.claim`` is missing or empty, so
there is one claim at most. All that ends a claim names its token, so nobody can end another's: its holder renames
``.claim/TOKEN`` away, and so does who takes over; one of them succeeds. An empty ``.claim`` is free.

The process of a claim touches it every BEAT seconds. A claim of a process of this machine is over when the process is.
One of another machine is over when it was not touched for LEASE seconds by the clock of whoever waits, so that clocks
need not agree. A holder that stood still for longer may wake up: what counts is published by a rename out of
``.claim/TOKEN``, which fails once that was renamed away, and what does not count is written after a look at it.
Nothing here needs locks of the file system.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import socket
import threading
import time
import uuid
from collections.abc import Iterator
from dataclasses import asdict
from functools import cache
from pathlib import Path

from symphys import files
from symphys import json_values as values
from symphys.records import dataclass

TOUCH_INTERVAL = 10.0
"""[s] between two touches of a claim."""
LEASE = 120.0
"""[s] without a touch after which a claim of another machine is over; longer than any call that blocks all threads."""
CLAIM_FOLDER = ".claim"
"""The folder that holds the claim of a run folder."""
CLAIM_PREFIX = ".claim-"
"""Prefix of the names under which claims are made and put away."""
OWNER_FILE = "owner"
"""The file of a claim that names its owner."""
TAKEN_ERRORS = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOENT)
"""Errors of a rename where another claim exists, or where another process has removed the prepared folder."""
seen: dict[Path, tuple[int, float]] = {}
"""Claims that this process waits for: the time of the last touch, and since when [s] this process has seen it."""


class FolderBusy(files.FileError):
    """Raised where another process is working in the folder."""


@dataclass(frozen=True)
class Owner:
    """The process that holds a claim.

    Attributes:
        host: the name of the machine, for messages.
        machine: identifies it: boot id and the namespace of process numbers.
        process: its number.
        begun: the start of the process in ticks; empty where that is not known.
        token: different for each claim.
    """

    host: str = ""
    machine: str = ""
    process: int = 0
    begun: str = ""
    token: str = ""

    def __str__(self) -> str:
        """Return a description for messages."""
        return f"process {self.process} on {self.host}" if self.host else "another process"

    @property
    def here(self) -> bool:
        """Whether it is a process of this machine."""
        return bool(self.machine) and self.machine == machine()

    @property
    def alive(self) -> bool:
        """Whether the process, of this machine, still runs."""
        try:
            os.kill(self.process, 0)
        except ProcessLookupError:
            return False
        except OSError:  # of another user
            return True
        return beginning(self.process) == self.begun


@cache
def machine() -> str:
    """Return an identifier of this machine since its boot; empty where processes cannot be looked up."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
        return f"{boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        return f"{uuid.getnode()}" if os.name == "posix" else ""


def beginning(process: int) -> str:
    """Return the start of a process in ticks since boot; empty if unknown, "over" if the process has ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return ""
    return "over" if fields[0] in "ZX" else fields[19]


def myself() -> Owner:
    """Return this process as the owner of a new claim."""
    return Owner(*this_process(os.getpid()), uuid.uuid4().hex)


@cache
def this_process(number: int) -> tuple[str, str, int, str]:
    """Return the constants of a process: host, machine, number, start."""
    return socket.gethostname(), machine(), number, beginning(number)


@dataclass(frozen=True)
class Claim:
    """A claim that this process holds.

    Attributes:
        folder: the run folder.
        owner: this process.
    """

    folder: Path
    owner: Owner

    @property
    def path(self) -> Path:
        """The folder of the claim."""
        return self.folder / CLAIM_FOLDER / self.owner.token

    @property
    def held(self) -> bool:
        """Whether the claim still counts; after a long sleep another process may have taken the run over."""
        return self.path.is_dir()

    def check(self) -> None:
        """Raise FolderBusy if the run was taken over."""
        if not self.held:
            raise self.lost()

    def publish(self, name: str, content: bytes) -> None:
        """Move a complete file into the run folder, at an instant at which the claim is held.

        Raises:
            FolderBusy: it is not held any more; nothing was written.
            FileError: the file cannot be written.
        """
        made, path = self.path / name, self.folder / name
        try:
            put(made, content)
            files.rename(made, path)
        except (FileNotFoundError, NotADirectoryError) as error:
            raise self.lost() from error
        except OSError as error:
            with contextlib.suppress(OSError):
                made.unlink()
            raise files.FileError(f"cannot write {path}: {files.reason(error)}") from error

    def touch(self) -> None:
        """Show that this process is still at work."""
        with contextlib.suppress(OSError):
            os.utime(self.path)

    def enter(self) -> bool:
        """Make the claim; False where another is there.

        Raises:
            FileError: the folder cannot be written.
        """
        outer = self.folder / f"{CLAIM_PREFIX}{self.owner.token}"
        try:
            outer.mkdir()
            (outer / self.owner.token).mkdir()
            put(outer / self.owner.token / OWNER_FILE, json.dumps(asdict(self.owner)).encode())
            with contextlib.suppress(OSError):
                (self.folder / CLAIM_FOLDER).rmdir()  # not every system renames over an empty folder
            outer.rename(self.folder / CLAIM_FOLDER)
        except OSError as error:
            discard(outer / self.owner.token)
            discard(outer)
            if error.errno in TAKEN_ERRORS or occupied(self.folder):
                return False
            raise files.FileError(f"cannot write {self.folder / CLAIM_FOLDER}: {files.reason(error)}") from error
        return True

    def release(self) -> None:
        """Release the lock, unless another process has taken the run over."""
        evict(self.path)

    def lost(self) -> FolderBusy:
        """Return the error for a claim that was taken over."""
        return FolderBusy(f"{self.folder} was taken over by another command while this one stood still")


@contextlib.contextmanager
def claimed(folder: Path) -> Iterator[Claim]:
    """Hold the claim of a folder, which is made if there is none.

    Raises:
        FolderBusy: another process is at work there, or may be.
        FileError: the folder cannot be written.
    """
    claim = take(folder)
    HEART.add(claim)
    try:
        yield claim
    finally:
        HEART.drop(claim)
        claim.release()


def take(folder: Path) -> Claim:
    """Claim a folder; raises as ``claimed`` does."""
    while True:
        files.make_folder(folder)
        for path in occupied(folder):
            found = read_owner(path)
            if not is_over(path, found):
                raise FolderBusy(f"{found} is working in {folder}; nothing was changed there")
            evict(path)
        claim = Claim(folder, myself())
        if claim.enter():
            return claim


def occupied(folder: Path) -> list[Path]:
    """Return the claims in a run folder: one at most, unless something else was put there."""
    try:
        return sorted((folder / CLAIM_FOLDER).iterdir())
    except OSError:
        return []


def evict(path: Path) -> None:
    """End the claim at this path, if there still is one: renamed away, it cannot publish any more."""
    aside = path.parents[1] / f"{CLAIM_PREFIX}{path.name}.over"
    with contextlib.suppress(OSError):
        path.rename(aside)
        discard(aside)
    with contextlib.suppress(OSError):
        path.parent.rmdir()  # only if it is empty


def discard(path: Path) -> None:
    """Remove a folder with its files, or a file, as far as that can be done."""
    with contextlib.suppress(OSError):
        for each in path.iterdir():
            each.unlink()
        path.rmdir()
    with contextlib.suppress(OSError):
        path.unlink()


def clear(folder: Path, claim: Claim) -> None:
    """Remove what processes that were killed have left of their claims."""
    for path in list(folder.iterdir()):
        if path.name.startswith(CLAIM_PREFIX) and claim.held:
            discard(path / path.name.removeprefix(CLAIM_PREFIX))
            discard(path)


def put(path: Path, content: bytes) -> None:
    """Write a file in a folder that is there; OSError if that cannot be."""
    files.write_through(path, content)


def holder(folder: Path) -> tuple[Path, Owner] | None:
    """Return the claim in a folder and its owner; None if there is none."""
    return next(((path, read_owner(path)) for path in occupied(folder)), None)


def owner(folder: Path) -> Owner | None:
    """Return the process at work in a folder, as far as its files say; None if there is none."""
    found = holder(folder)
    return None if found is None or (found[1].here and not found[1].alive) else found[1]


def read_owner(path: Path) -> Owner:
    """Return the owner of a claim; an anonymous one if its file cannot be read."""
    try:
        return values.record(Owner, json.loads(files.read_text(path / OWNER_FILE)), values.verbatim)
    except (ValueError, RecursionError, files.FileError):
        return Owner()


def is_over(path: Path, found: Owner) -> bool:
    """Whether the process behind a claim has ended."""
    if found.here:
        return not found.alive
    try:
        touched = path.lstat().st_mtime_ns
    except OSError:
        return True
    known, now = seen.get(path), time.monotonic()
    if known is None or known[0] != touched:
        seen[path] = (touched, now)
        return False
    return now - known[1] > LEASE


class Heart:
    """A thread that touches the claims of this process."""

    def __init__(self) -> None:
        """Start without claims."""
        self.claims: set[Claim] = set()
        self.lock = threading.Lock()
        self.thread: threading.Thread | None = None
        self.process = 0

    def add(self, claim: Claim) -> None:
        """Keep a claim alive."""
        with self.lock:
            self.claims.add(claim)
            if self.thread is None or self.process != os.getpid():
                self.process = os.getpid()
                self.thread = threading.Thread(target=self.run, name="symphys-claims", daemon=True)
                self.thread.start()

    def drop(self, claim: Claim) -> None:
        """Stop touching a claim."""
        with self.lock:
            self.claims.discard(claim)

    def run(self) -> None:
        """Touch all claims, forever."""
        while True:
            time.sleep(TOUCH_INTERVAL)
            with self.lock:
                held = list(self.claims)
            for claim in held:
                claim.touch()


HEART = Heart()
"""The one thread of this process."""
