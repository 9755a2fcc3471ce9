"""Figures as files, and names that are safe for files."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from symphys import files
from symphys.report.figures.style import Picture
from symphys.results.file_names import FIGURES


def write_figures(folder: Path, pictures: Iterable[Picture]) -> None:
    """Write every picture into ``folder``/figures. Raises FileError."""
    for picture in pictures:
        files.write_text(folder / FIGURES / f"{picture.name}.svg", picture.svg)


def slug(text: str) -> str:
    """A name that is safe as a file name and as an anchor."""
    return re.sub(r"[^a-z0-9_]+", "-", text.lower()).strip("-")[:60] or "unnamed"
