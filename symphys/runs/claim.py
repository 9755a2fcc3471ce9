"""The right to work in a run folder: claimed by a file, so that any number of commands on any machines share a batch.

A claim is a symbolic link ``.claim-N`` in the run folder, whose target is a text that says who holds it; so it is there
whole, or not at all. Its process touches it every BEAT seconds. One that belongs to a process of this machine is over
when the process is. One of another machine is over when it was not touched for LEASE seconds by the clock of whoever
waits, so that clocks need not agree. What is over is taken up under the next number, which again only one can get.
Nothing here needs locks of the file system.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import socket
import threading
import time
import uuid
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from symphys import files
from symphys import json_values as values

BEAT = 10.0
"""[s] between two touches of a claim."""
LEASE = 120.0
"""[s] without a touch after which a claim of another machine is over; longer than any call that stops all threads."""
NAME = re.compile(r"\.claim-(\d+)")


class FolderBusy(files.FileError):
    """Another process is working in the folder."""


@dataclass(frozen=True)
class Owner:
    """Who holds a claim.

    Attributes:
        host: the machine's name, for people.
        machine: what tells it from others: boot, and the space that process numbers are in.
        process: its number.
        begun: when the process began, as the system counts; empty where that is not known.
        token: different for each claim.
        after: the token of the claim that it took over; empty for one that was the first.
    """

    host: str = ""
    machine: str = ""
    process: int = 0
    begun: str = ""
    token: str = ""
    after: str = ""

    def __str__(self) -> str:
        """For messages."""
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
    """What tells this machine, since it was started, from all others; empty where processes cannot be asked after."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
        return f"{boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        return f"{uuid.getnode()}" if os.name == "posix" else ""


def beginning(process: int) -> str:
    """When a process of this machine began, in ticks since its boot; empty where that is not known, or it is over."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return ""
    return "over" if fields[0] in "ZX" else fields[19]


def myself(after: str = "") -> Owner:
    """This process, for a new claim; ``after``: see ``Owner``."""
    return Owner(*this_process(os.getpid()), uuid.uuid4().hex, after)


@cache
def this_process(number: int) -> tuple[str, str, int, str]:
    """What does not change in the life of a process: host, machine, number, beginning."""
    return socket.gethostname(), machine(), number, beginning(number)


@dataclass(frozen=True)
class Claim:
    """A claim that this process holds.

    Attributes:
        folder: the run folder.
        number: of the claim; the highest in the folder is the one that counts.
        owner: this process.
    """

    folder: Path
    number: int
    owner: Owner

    @property
    def path(self) -> Path:
        """Its file."""
        return path_of(self.folder, self.number)

    @property
    def held(self) -> bool:
        """Whether it still counts: nobody has taken the run over since, as after a sleep that was longer than LEASE."""
        later = [read_owner(path_of(self.folder, number)) for number in numbers(self.folder) if number > self.number]
        return read_owner(self.path).token == self.owner.token and all(o.after != self.owner.token for o in later)

    def check(self) -> None:
        """Raise FolderBusy if the run was taken over."""
        if not self.held:
            raise FolderBusy(f"{self.folder} was taken over by another command while this one stood still")

    def release(self) -> None:
        """Let others in."""
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)


@contextlib.contextmanager
def claimed(folder: Path) -> Iterator[Claim]:
    """Hold the folder; it is made if there is none.

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
    """Claim a folder; see ``claimed``."""
    files.make_folder(folder)
    while True:
        earlier = numbers(folder)
        if not earlier:
            claim = Claim(folder, 0, myself())
            if create(claim) and settled(claim):
                return claim
            continue
        before = path_of(folder, earlier[-1])
        found = read_owner(before)
        if not os.path.lexists(before):  # released meanwhile
            continue
        if not is_over(before, found):
            raise FolderBusy(f"{found} is working in {folder}; nothing was changed there")
        claim = Claim(folder, earlier[-1] + 1, myself(after=found.token))
        if create(claim) and settled(claim, earlier[-1]):
            return claim


def settled(claim: Claim, before: int | None = None) -> bool:
    """Whether a new claim stands; one that does not is withdrawn.

    It does not where it was made by an older view of the folder: where there is a higher one, or where the one that it
    was to take over is another by now. ``before``: its number; it goes once it is taken over.
    """
    stands = numbers(claim.folder)[-1:] == [claim.number]
    if stands and before is not None:
        path = path_of(claim.folder, before)
        stands = os.path.lexists(path) and read_owner(path).token == claim.owner.after
        if stands:
            path.unlink(missing_ok=True)
    if not stands:
        claim.release()
    return stands


def create(claim: Claim) -> bool:
    """Put a claim in its place; False if there is one."""
    content = json.dumps(asdict(claim.owner))
    try:
        return linked(content, claim.path) or placed(content, claim.path)
    except FileExistsError:
        return False
    except OSError as error:
        raise files.FileError(f"cannot write {claim.path}: {files.reason(error)}") from error


def linked(content: str, path: Path) -> bool:
    """Make a symbolic link with the text for its target, which nobody follows: it is there whole, in one operation.

    False on systems without such links; FileExistsError if the name is taken.
    """
    try:
        path.symlink_to(content)
    except FileExistsError:
        raise
    except (OSError, NotImplementedError):
        return False
    return True


def placed(content: str, path: Path) -> bool:
    """Write a file that is not there yet, where for an instant others see it empty; FileExistsError if it is there."""
    with path.open("xb") as file:
        try:
            file.write(content.encode())
            file.flush()
        except OSError:
            path.unlink()
            raise
    return True


def path_of(folder: Path, number: int) -> Path:
    """The file of a claim."""
    return folder / f".claim-{number}"


def numbers(folder: Path) -> list[int]:
    """The claims in a folder, ascending."""
    try:
        found = [NAME.fullmatch(path.name) for path in folder.iterdir()]
    except OSError:
        return []
    return sorted(int(each[1]) for each in found if each)


def owner(folder: Path) -> Owner | None:
    """Who is at work in a folder, as far as its files say; None: nobody."""
    held = numbers(folder)
    found = read_owner(path_of(folder, held[-1])) if held else None
    return None if found is None or (found.here and not found.alive) else found


def read_owner(path: Path) -> Owner:
    """The owner that a claim names; one without a name if it cannot be read."""
    try:
        text = str(path.readlink()) if path.is_symlink() else files.read_text(path)
        return values.record(Owner, json.loads(text), values.verbatim)
    except (OSError, ValueError, RecursionError, files.FileError):
        return Owner()


seen: dict[tuple[Path, str], tuple[int, float]] = {}
"""Of claims that this process waits for: when the file was last touched, and since when [s] that has been so here."""


def is_over(path: Path, found: Owner) -> bool:
    """Whether nobody stands behind a claim any more."""
    if found.here:
        return not found.alive
    try:
        touched = path.lstat().st_mtime_ns
    except OSError:
        return True
    known, now = seen.get((path, found.token)), time.monotonic()
    if known is None or known[0] != touched:
        seen[path, found.token] = (touched, now)
        return False
    return now - known[1] > LEASE


class Heart:
    """Touches the claims of this process, in a thread of its own."""

    def __init__(self) -> None:
        """No claim is held."""
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
        """Let it rest."""
        with self.lock:
            self.claims.discard(claim)

    def run(self) -> None:
        """Touch all claims, for ever."""
        while True:
            time.sleep(BEAT)
            with self.lock:
                held = list(self.claims)
            for claim in held:
                with contextlib.suppress(OSError):
                    os.utime(claim.path, follow_symlinks=os.utime not in os.supports_follow_symlinks)


HEART = Heart()
"""Of this process."""
