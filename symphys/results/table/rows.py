"""The rows of all runs below a folder: cached ones that are valid, and the others from their folders."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from pathlib import Path

from symphys import files
from symphys.records import dataclass
from symphys.results.file_names import CONFIG, FIGURES, PROBLEM, RESULT
from symphys.results.table.columns import Row, numeric
from symphys.results.table.journal import JOURNAL_FILE, Journal, Kept, Stamp, stamp_of

Progress = Callable[[int, int], None]
"""A function of the number of folders that are read, and of those that must be read."""
MAX_ANCESTORS = 2
"""Levels above a folder that may hold its journal: that of a run is two above."""
MIN_UNKEPT = 100
"""Number of uncached folders from which a journal is begun: fewer take no time."""
ROWS_PER_WRITE = 500
"""Rows that one write adds, so that an interruption loses few."""
MAX_LINE_RATIO = 2
"""Ratio of lines to runs from which a journal is rewritten."""


@dataclass
class Rows:
    """The runs below a folder, by problem, case, solver and seed.

    Attributes:
        rows: one for each run folder.
        faults: folders that cannot be read, one clause each.
        read: how many rows were read from their folders, not from a journal.
    """

    rows: list[Row] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    read: int = 0


@dataclass
class Scan:
    """The run folders and journals below a folder.

    Attributes:
        runs: the stamp of the result of every run folder by its place; None where there is no result.
        journals: places of folders with a journal.
        faults: folders that cannot be listed, one clause each.
    """

    runs: dict[str, Stamp | None] = field(default_factory=dict)
    journals: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


def read_rows(root: Path, tell: Progress | None = None) -> Rows:
    """Read the rows of all runs at or below a folder; what was read is kept in its journal where that can be written.

    Args:
        root: the folder, or one run folder.
        tell: a ``Progress``, called for each folder.

    Raises:
        FileError: there is no such folder.
    """
    if not root.is_dir():
        raise files.FileError(f"{root}: there is no such folder; give one that `symphys solve --out` has written")
    scan = scanned(root)
    journal = journal_of(root)
    prefix = below(journal.out, root)
    kept, lines = kept_rows(root, journal, prefix, scan)
    missing = [place for place, stamp in scan.runs.items() if stamp is None or not is_right(kept.get(place), stamp)]
    found = Rows(faults=scan.faults, read=len(missing))
    keeper = Keeper(journal, prefix, len(missing))
    fresh = dict(read_missing(root, missing, scan, keeper, tell)) if missing else {}
    for place in scan.runs:
        row = fresh[place] if place in fresh else kept[place].row
        found.rows.append({"run": place, **{column: restored(column, value) for column, value in row.items()}})
    found.rows.sort(key=usual_order)
    if lines > MIN_UNKEPT and lines > MAX_LINE_RATIO * len(kept):
        tidy(journal)
    return found


def scanned(root: Path) -> Scan:
    """Look into every folder at or below one, but those of figures and those whose names begin with a dot."""
    found = Scan()
    waiting = [""]
    while waiting:
        place = waiting.pop()
        try:
            with os.scandir(f"{root}/{place}") as listing:
                entries = {entry.name: entry for entry in listing}
        except OSError as error:
            found.faults.append(f"{root / place}: {files.reason(error)}")
            continue
        if JOURNAL_FILE in entries:
            found.journals.append(place)
        if RESULT in entries or (CONFIG in entries and PROBLEM in entries):
            found.runs[place or "."] = stamp(entries.get(RESULT))
        for name, entry in entries.items():
            if name != FIGURES and not name.startswith(".") and entry.is_dir(follow_symlinks=False):
                waiting.append(f"{place}/{name}" if place else name)
    return found


def stamp(entry: os.DirEntry[str] | None) -> Stamp | None:
    """Return the stamp of a result.json; None where there is none, or only a link that leads nowhere."""
    try:
        return stamp_of(entry.stat()) if entry else None
    except OSError:
        return None


def journal_of(root: Path) -> Journal:
    """Return the journal of the folder, or of the nearest above it that has one; its own where there is none."""
    here = root.resolve()
    for folder in (here, *here.parents[:MAX_ANCESTORS]):
        if (folder / JOURNAL_FILE).is_file():
            return Journal(folder)
    return Journal(here)


def below(out: Path, root: Path) -> str:
    """Return what precedes the places of runs below ``root`` in the journal of ``out``: empty, or with a slash."""
    place = root.resolve().relative_to(out).as_posix()
    return "" if place == "." else f"{place}/"


def joined(prefix: str, place: str) -> str:
    """Return the place of a run in a journal whose folder lies higher."""
    return (f"{prefix}{place}" if place != "." else prefix.removesuffix("/")) or "."


def kept_rows(root: Path, journal: Journal, prefix: str, scan: Scan) -> tuple[dict[str, Kept], int]:
    """Return the rows of all journals by place below ``root``, and how many lines the first of them has."""
    own, lines = journal.read()
    found = {place: own[name] for place in scan.runs if (name := joined(prefix, place)) in own}
    for folder in filter(None, scan.journals):
        for name, kept in Journal(root / folder).read()[0].items():
            place = joined(f"{folder}/", name)
            if (now := scan.runs.get(place)) and is_right(kept, now):
                found[place] = kept
    return found, lines


def is_right(kept: Kept | None, now: Stamp) -> bool:
    """Whether a kept row is that of the result.json that is there."""
    return kept is not None and kept.stamp == now


@dataclass
class Keeper:
    """Appends rows to a journal in blocks, where it pays and as long as it can be written."""

    journal: Journal
    prefix: str
    expected: int
    waiting: dict[str, Kept] = field(default_factory=dict)
    refused: bool = False

    def keep(self, place: str, stamp: Stamp | None, row: Mapping[str, object]) -> None:
        """Keep the row of a run that has a result, if nothing was wrong with its files: they may be mended."""
        if stamp is None or "fault" in row:
            return
        self.waiting[joined(self.prefix, place)] = Kept(stamp, row)
        if len(self.waiting) >= ROWS_PER_WRITE:
            self.flush()

    def flush(self) -> None:
        """Append what waits."""
        worth = self.expected >= MIN_UNKEPT or self.journal.path.exists()
        if self.waiting and worth and not self.refused:
            self.refused = not self.journal.append(self.waiting)
        self.waiting.clear()


def read_missing(
    root: Path, missing: list[str], scan: Scan, keeper: Keeper, tell: Progress | None
) -> Iterator[tuple[str, Row]]:
    """Yield the rows of folders; what is read is kept, also where Ctrl-C ends it."""
    from symphys.results.table.row import read_row  # late: whoever finds all rows in journals needs none of that

    try:
        for done, place in enumerate(missing):
            if tell:
                tell(done, len(missing))
            row = read_row(root / place)
            keeper.keep(place, scan.runs[place], row)
            yield place, row
    finally:
        keeper.flush()


def restored(column: str, value: object) -> object:
    """Return a value of a row as JSON has it, with "inf" as the number that it stands for."""
    return float(value) if isinstance(value, str) and numeric(column) else value


def usual_order(row: Row) -> tuple[str, str, str, float, str]:
    """Return the key of a row in the usual order: problem, case, solver and seed."""
    return row.get("problem", ""), row.get("case", ""), row.get("solver", ""), row.get("seed", -1), row["run"]


def tidy(journal: Journal) -> None:
    """Write a journal anew with one line for each run that it has, where that can be done."""
    try:
        journal.rewrite(journal.read()[0])
    except files.FileError:
        return
