"""Ctrl-C while pages are made ends the work after the page, even where it strikes inside a figure."""

from __future__ import annotations

import contextlib
import signal
from pathlib import Path

import pytest

from symphys.report.making import batch, run_pages
from symphys.report.making.batch import WantedPages, make_pages


def lose() -> None:
    """Ctrl-C in code that catches everything, as callbacks and finalizers do."""
    with contextlib.suppress(BaseException):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("place", ["a run", "the batch"])
def test_ctrl_c_is_not_swallowed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    made: list[Path] = []

    def make_run_page(folder: Path, figures: bool) -> None:
        made.append(folder)
        if place == "a run":
            lose()

    def write_batch_report(folder: Path, unmade: object) -> Path:
        made.append(folder)
        lose()
        return folder

    monkeypatch.setattr(run_pages, "make_run_page", make_run_page)
    monkeypatch.setattr(batch, "write_batch_report", write_batch_report)
    folders = tuple(tmp_path / name for name in "ab")
    with pytest.raises(KeyboardInterrupt):
        make_pages(WantedPages(tmp_path, folders))
    assert made == ([folders[0]] if place == "a run" else [*folders, tmp_path])
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
