"""What a page was made from, as a checksum that it carries: a page is made again only where that has changed.

A stamp takes in the folder's path, the content of its files, and the sources and versions of what draws pages. Clocks
are no part of it, so copies, restored backups and clocks that are wrong keep no stale page alive.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import sys
from functools import cache
from pathlib import Path

import numpy as np

from symphys.report.making.neighbours import neighbours
from symphys.results.discovery import run_folders
from symphys.results.table.journal import JOURNAL_FILE

RUN_PAGE, BATCH_PAGE = "report.html", "index.html"
OWN_PAGES = frozenset({RUN_PAGE, BATCH_PAGE})
"""What lies in a folder and is made from it."""
PACKAGE = Path(__file__).parents[2]
DRAWING = (
    "archives.py",
    "deprecated.py",
    "errors.py",
    "files.py",
    "findings",
    "interrupts.py",
    "json_values.py",
    "later.py",
    "model",
    "records.py",
    "report",
    "results",
    "suggest.py",
    "trajectory.py",
    "types.py",
    "version.py",
)
"""Modules and rooms of the package whose code takes part in a page."""
SOURCES = (".py", ".js", ".css")
MOST_UP = 3
"""Folders between a run's and that of a batch, at most."""
HEAD = 4096
"""[bytes] of a page that hold its stamp."""
STAMP = re.compile(rb'<meta name="made-from" content="([0-9a-f]{64})">')


def is_current(page: Path, digest: str) -> bool:
    """Whether a page is there and was made from this."""
    return read_stamp(page) == digest


def read_stamp(page: Path) -> str:
    """Read the checksum that a page carries; empty where there is no page, or none with a checksum."""
    try:
        if not stat.S_ISREG(page.stat().st_mode):
            return ""
        with page.open("rb") as file:
            found = STAMP.search(file.read(HEAD))
    except OSError:
        return ""
    return found[1].decode("ascii") if found else ""


def batch_page(folder: Path) -> str:
    """Return the address of the page of all runs, seen from a run's; empty where no folder above keeps runs."""
    for up, above in enumerate(folder.resolve().parents[:MOST_UP], start=1):
        if (above / JOURNAL_FILE).is_file():
            return "../" * up + BATCH_PAGE
    return ""


def folder_digest(folder: Path) -> str:
    """Return the checksum of a folder's path, of the files in it but its pages, and of the drawing code."""
    made = f"{drawing_digest()} {folder.resolve()} {batch_page(folder)} {neighbours(folder, RUN_PAGE)}"
    found = hashlib.sha256(made.encode(errors="surrogateescape"))
    try:
        with os.scandir(folder) as inside:
            names = sorted(each.name for each in inside if each.name[0] != "." and each.name not in OWN_PAGES)
    except OSError as error:
        names = []
        found.update(f"\0unread {error.errno}".encode())
    for path in (folder / name for name in names):
        if not path.is_dir():
            found.update(f"\0{path.name}\0{file_digest(path)}".encode(errors="surrogateescape"))
    return found.hexdigest()


def file_digest(path: Path) -> str:
    """Return the checksum of a file's content, or a word for what is no file or cannot be read."""
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            return f"of kind {stat.S_IFMT(mode)}"
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        return f"unread {error.errno}"


def batch_digest(root: Path) -> str:
    """Return the checksum of a batch: its run folders, and which of them have a page.

    Raises:
        ReportError: there is no such folder.
    """
    found = hashlib.sha256(f"{drawing_digest()} {root.resolve()}".encode(errors="surrogateescape"))
    for folder in run_folders(root):
        linked = (folder / RUN_PAGE).is_file()
        place = folder.relative_to(root)
        found.update(f"\0{place}\0{linked} {folder_digest(folder)}".encode(errors="surrogateescape"))
    return found.hexdigest()


@cache
def drawing_digest() -> str:
    """Return the checksum of the code that draws pages, and of the versions of Python and numpy."""
    found = hashlib.sha256(f"{sys.version} {np.__version__}".encode())
    for path in sorted(each for name in DRAWING for each in sources(PACKAGE / name)):
        found.update(f"\0{path.relative_to(PACKAGE)}\0{file_digest(path)}".encode())
    return found.hexdigest()


def sources(path: Path) -> list[Path]:
    """Return a module, or those of a room and what its pages hold."""
    return [path] if path.is_file() else [each for each in path.rglob("*") if each.suffix in SOURCES]
