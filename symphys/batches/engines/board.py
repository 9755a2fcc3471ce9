"""The board of a batch: a folder in which drivers leave news, and the command that started them its wish to stop.

All of it are files without a content that matters: one listing of one folder says what is new of ten thousand runs.
What a run has come to stands in its run folder alone; a driver that dies before it leaves news loses nothing.
"""

from __future__ import annotations

import contextlib
import shutil
import uuid
from dataclasses import dataclass, field
from pathlib import Path

from symphys import files

PREFIX = ".drivers-"
BEGUN, RESUMED, OVER, NOTE, STOP = "begun", "resumed", "over", "note", "stop"


@dataclass(frozen=True)
class BoardNews:
    """A piece of news.

    Attributes:
        what: BEGUN, RESUMED or OVER of a run, or a NOTE.
        index: of the run; -1 for a note.
        by: which driver began it.
        text: of a note.
    """

    what: str
    index: int = -1
    by: str = ""
    text: str = ""


@dataclass(frozen=True)
class Board:
    """The folder ``OUT/.drivers-TOKEN``; drivers stop when it is gone.

    Attributes:
        path: absolute, and the same on all machines.
        seen: names of files that were read.
    """

    path: Path
    seen: set[str] = field(default_factory=set, compare=False)

    @classmethod
    def hang(cls, out: Path) -> Board:
        """A new one; FileError if the folder cannot be made."""
        path = out / f"{PREFIX}{uuid.uuid4().hex}"
        files.make_folder(path)
        return cls(path)

    def tell(self, what: str, index: int, by: str = "") -> None:
        """Leave news of a run; where that cannot be written, its folder will have to do. ``by``: a driver's token."""
        with contextlib.suppress(OSError):
            (self.path / ".".join(filter(None, (what, f"{index}", by)))).touch()

    def note(self, text: str) -> None:
        """Leave a note."""
        with contextlib.suppress(files.FileError):
            if self.path.is_dir():
                files.write_text(self.path / f"{NOTE}.{uuid.uuid4().hex}", text)

    def is_over(self, index: int) -> bool:
        """Whether a run of the batch has ended, however it did."""
        return (self.path / f"{OVER}.{index}").exists()

    def take_back(self, index: int) -> None:
        """Say no longer that it has."""
        with contextlib.suppress(files.FileError):
            files.remove(self.path / f"{OVER}.{index}")

    def news(self) -> list[BoardNews]:
        """What is new since it was last asked; runs begin before they are over."""
        try:
            names = {path.name for path in self.path.iterdir()} - self.seen
        except OSError:
            return []
        self.seen.update(names)
        split = [(*name.split("."), "")[:3] for name in sorted(names) if "." in name]
        found = [BoardNews(NOTE, text=self.read(f"{NOTE}.{rest}")) for what, rest, _ in split if what == NOTE]
        for kind in (BEGUN, RESUMED, OVER):
            found += [BoardNews(kind, int(rest), by) for what, rest, by in split if what == kind and rest.isdecimal()]
        return found

    def stop(self, reason: str) -> None:
        """Ask all drivers to stop where they can go on later, and say why."""
        files.write_text(self.path / STOP, reason)

    @property
    def stopped(self) -> bool:
        """Whether drivers are to stop."""
        return (self.path / STOP).exists() or not self.path.is_dir()

    @property
    def reason(self) -> str:
        """Why, for the runs; empty after Ctrl-C."""
        return self.read(STOP)

    def read(self, name: str) -> str:
        """The text of a file; empty if it cannot be read."""
        try:
            return files.read_text(self.path / name)
        except files.FileError:
            return ""

    def take_down(self) -> None:
        """Remove it; drivers that begin later end at once."""
        shutil.rmtree(self.path, ignore_errors=True)
