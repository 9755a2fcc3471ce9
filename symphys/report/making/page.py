"""One page of many: made whole or not at all, and the reason where it cannot be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from symphys import files
from symphys.report.making.stamps import FULL, LIGHT
from symphys.report.pages.run import PAGE, write_light_report, write_run_report
from symphys.results.text_files import ReportError

AUTO = "auto"
KINDS = (AUTO, FULL, LIGHT)
MOST_FULL = 50
"""With "auto", so many pages made at once are full at most; of more all are light."""


@dataclass(frozen=True)
class PageFault:
    """A page that could not be made, and why."""

    page: Path
    reason: str

    def __str__(self) -> str:
        """In a line."""
        return f"{self.page} could not be made: {self.reason}"


def is_light(kind: str, count: int) -> bool:
    """Whether ``count`` pages that are made at once are light; ReportError for a kind that there is not."""
    if kind not in KINDS:
        raise ReportError(f"there are no pages of the kind {kind!r}; there are {', '.join(KINDS)}")
    return kind == LIGHT or (kind == AUTO and count > MOST_FULL)


def fitting_kinds(kind: str, count: int) -> tuple[str, ...]:
    """Which kinds a page may be that is not to be made again, of ``count`` at once; a full one is never too much."""
    if kind == AUTO:
        return (FULL, LIGHT) if is_light(kind, count) else (FULL,)
    return (LIGHT,) if is_light(kind, count) else (FULL,)


def make_run_page(folder: Path, light: bool) -> PageFault | None:
    """Make the page of a run folder; why it could not be made, if it was not."""
    return attempt(folder / PAGE, lambda: write_light_report(folder) if light else write_run_report(folder))


def attempt(page: Path, make: Callable[[], object]) -> PageFault | None:
    """Call what makes a page; any failure but an interruption becomes a fault."""
    try:
        make()
    except (ReportError, files.FileError) as error:
        return PageFault(page, str(error))
    except Exception as error:
        return PageFault(page, f"{type(error).__name__}: {error}" if str(error) else type(error).__name__)
    return None
