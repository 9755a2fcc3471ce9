"""The page of a run as one file that can be sent, and that of a batch, whose pages share what plays motions."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from symphys.report import write_run_report
from symphys.report.pages.markup import packed_viewer
from symphys.report.pages.run import write_single_page
from symphys.results.table.journal import JOURNAL_FILE
from symphys.results.text_files import ReportError


def test_a_page_that_holds_all(run_dir: Path, tmp_path: Path) -> None:
    """That of a batch takes its player from beside it, the single one has it, and no links to other pages."""
    batch = tmp_path / "out"
    folder = Path(shutil.copytree(run_dir, batch / "ball_throw" / "gradient-seed0"))
    shutil.copytree(run_dir, folder.with_name("gradient-seed1"))
    (batch / JOURNAL_FILE).touch()
    shared = write_run_report(folder).read_text("utf-8")
    assert [path.suffix for path in (batch / "assets").iterdir()] == [".js"]
    assert 'src="../../assets/viewer-' in shared and "seed 1</a>" in shared
    text = write_single_page(folder, tmp_path / "sent.html").read_text("utf-8")
    assert packed_viewer() in text and "src=" not in text and "report.html" not in text and "index.html" not in text
    assert len(shared) + len(packed_viewer()) < len(text) < len(shared) + len(packed_viewer()) + 20_000


def test_a_folder_of_several_runs_has_no_single_page(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="no run folder"):
        write_single_page(tmp_path, tmp_path / "sent.html")
    assert not (tmp_path / "sent.html").exists()
