"""The files of recordings: found by name or pattern, known by digests, and what a problem's text keeps of them."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from symphys.files import check_regular
from symphys.problem.reading.source import toml_string
from symphys.problem.recordings.columns import RecordingFault
from symphys.problem.recordings.types import RecordedFile
from symphys.problem.schema.recording import RecordedFileTable
from symphys.suggest import hint, quote

HEADING = "\n[[recorded]]\n"
PLACES = re.compile(r'^path = ".*"\n(?=sha256 = "[0-9a-f]{64}"$)', re.MULTILINE)
ARRAYS = (".npz",)
TEXTS = (".csv", ".tsv", ".txt", ".dat")
WILDCARD = re.compile(r"[*?\[]")
MAX_FILES = 10_000
"""Of one pattern."""
MAX_KEPT_BYTES, MAX_KEPT_BYTES_TOGETHER = 100_000, 200_000
"""Bytes of a CSV file that is kept in the text of the problem, and of all of them: each run folder has that text."""


def plain_text(content: bytes) -> str | None:
    """The text of a file, if a problem's text can keep it."""
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        return None
    return text if all(letter.isprintable() or letter in "\n\t" for letter in text) else None


def recorded_appendix(files: Iterable[RecordedFile]) -> str:
    """Return what a problem's text needs elsewhere: the content of small files, the paths of others."""
    parts = []
    for each in files:
        place = "" if each.text is not None else f"path = {toml_string(each.path)}\n"
        text = "" if each.text is None else f"text = {toml_string(each.text)}\n"
        parts.append(f'{HEADING}file = {toml_string(each.file)}\n{place}sha256 = "{each.sha256}"\n{text}')
    return "".join(parts)


def without_places(text: str) -> str:
    """A problem's text without the places of recorded files: digests say what is in them."""
    return PLACES.sub("", text) if HEADING in text else text


class FileFinder:
    """The files beside a problem file, and those that its text keeps.

    Attributes:
        found: all that were not kept before, in the order in which they were asked for.
    """

    def __init__(self, kept: Sequence[RecordedFileTable]) -> None:
        """``kept``: what the problem's text has of them."""
        self.kept = {each.file: RecordedFile(each.file, each.path, each.sha256, each.text) for each in kept}
        self.found: dict[str, RecordedFile] = {}
        self._together = 0

    def names(self, patterns: Iterable[str], folder: Path) -> list[str]:
        """The files that names and patterns mean, relative to the folder; numbers in names count as numbers."""
        names = dict[str, None]()
        for pattern in patterns:
            wild = WILDCARD.search(pattern) is not None
            matching = [name for name in self.kept if matches(name, pattern)] if wild else [pattern]
            matching = matching or globbed(pattern, folder)
            names |= dict.fromkeys(sorted(matching, key=natural))
        for name in names:
            suffix = PurePosixPath(name).suffix.lower()
            if suffix not in (*ARRAYS, *TEXTS):
                ends = ", ".join((*TEXTS, *ARRAYS))
                raise RecordingFault("files", f"{quote(name)} is no file that can be read: names end with {ends}")
        return list(names)

    def open(self, name: str, folder: Path) -> BinaryIO:
        """The content of a file, as it was when it was first read."""
        kept = self.kept.get(name) or self.found.get(name)
        if kept is not None and kept.text is not None:
            return io.BytesIO(kept.text.encode())
        places = [folder / name] if kept is None else [folder / name, Path(kept.path)]
        changed = False
        for path in places:
            try:
                check_regular(path)
                stream = path.open("rb")
            except (OSError, ValueError):
                continue
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            stream.seek(0)
            if kept is not None and digest != kept.sha256:
                stream.close()
                changed = True
                continue
            if kept is None:
                self._note(name, path, digest, stream)
            return stream
        raise RecordingFault("files", self._absent(name, folder, kept, changed))

    def _note(self, name: str, path: Path, digest: str, stream: BinaryIO) -> None:
        """Keep what a file was."""
        text = None
        size = stream.seek(0, io.SEEK_END)
        stream.seek(0)
        if size <= min(MAX_KEPT_BYTES, MAX_KEPT_BYTES_TOGETHER - self._together) and path.suffix.lower() not in ARRAYS:
            text = plain_text(stream.read())
            stream.seek(0)
            self._together += size if text is not None else 0
        self.found[name] = RecordedFile(name, str(path.resolve()), digest, text)

    def _absent(self, name: str, folder: Path, kept: RecordedFile | None, changed: bool) -> str:
        """Return the reason why a file cannot be opened."""
        if changed:
            return f"{name} has changed since this problem was kept: its SHA-256 is another"
        if kept is not None:
            return f"{name} is no longer at {kept.path}"
        path = folder / name
        with suppress(OSError, ValueError):
            if path.is_dir():
                return f'{quote(name)} is a folder; write "{name.rstrip("/")}/*.csv"'
            if path.exists():
                check_regular(path)
                return f"{name} cannot be read; are you allowed to?"
            beside = [each.name for each in path.parent.iterdir() if each.suffix.lower() in (*TEXTS, *ARRAYS)]
            return f"there is no file {quote(name)}" + (f"; {hint(path.name, sorted(beside))}" if beside else "")
        return f"there is no file {quote(name)}"


def globbed(pattern: str, folder: Path) -> list[str]:
    """The files that match a pattern, below the folder of the problem file."""
    parts = PurePosixPath(pattern).parts
    if PurePosixPath(pattern).is_absolute() or ".." in parts:
        text = f"the pattern {quote(pattern)} leaves the folder of this file; name such files one by one"
        raise RecordingFault("files", text)
    if any("**" in part for part in parts):
        raise RecordingFault("files", f'{quote(pattern)}: "**" is no part of a pattern; give a list: ["a/*.csv"]')
    found = list[str]()
    with suppress(OSError, ValueError, re.error):
        for path in folder.glob(pattern):
            if path.is_file():
                found.append(path.relative_to(folder).as_posix())
            if len(found) > MAX_FILES:
                raise RecordingFault("files", f"{quote(pattern)} matches more than {MAX_FILES:,} files")
    if not found:
        parent = folder.joinpath(*parts[:-1])
        there: list[str] = []
        with suppress(OSError, ValueError):
            there = sorted(each.name for each in parent.iterdir() if each.is_file())
        has = (
            f"{parent} has {', '.join(there[:5])}{', ...' if there[5:] else ''}" if there else f"{parent} has no files"
        )
        raise RecordingFault("files", f"no file matches {quote(pattern)}; {has}")
    return found


def matches(name: str, pattern: str) -> bool:
    """Whether a name has the parts of a pattern."""
    parts, wanted = PurePosixPath(name).parts, PurePosixPath(pattern).parts
    return len(parts) == len(wanted) and all(map(fnmatchcase, parts, wanted))


def natural(name: str) -> list[tuple[int, str]]:
    """A key for sorting, by which toss2 comes before toss10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d{1,18})", name)]
