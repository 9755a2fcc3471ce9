"""The motion of a run as a moving picture, drawn by a browser without a window."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from PIL import Image
from tools.browser import BROWSER

from symphys.report.making import video
from symphys.report.making.video import SIZE, write_video
from symphys.results.text_files import ReportError


@BROWSER
def test_the_ball_moves(run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "RATE", 3)
    found = Image.open(io.BytesIO(write_video(run_dir, tmp_path / "throw.webp").read_bytes()))
    assert found.size == SIZE and found.n_frames >= 9 and found.info["loop"] == 0
    first = found.convert("RGB").tobytes()
    found.seek(found.n_frames - 1)
    assert found.convert("RGB").tobytes() != first
    assert len({first[k : k + 3] for k in range(0, len(first), 3)}) > 100  # something is drawn


def test_without_a_browser_it_says_what_is_missing(
    run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video.shutil, "which", lambda _: None)
    with pytest.raises(ReportError, match="need Chromium, which is not installed"):
        write_video(run_dir, tmp_path / "throw.webp")
    assert not (tmp_path / "throw.webp").exists()


def test_what_cannot_be_written_is_refused(run_dir: Path, tmp_path: Path) -> None:
    with pytest.raises(ReportError, match=r"ends in .webp, .gif, .png"):
        write_video(run_dir, tmp_path / "throw.mp4")
    (run_dir / "trajectory.npz").unlink()
    with pytest.raises(ReportError, match="there is no motion to draw"):
        write_video(run_dir, tmp_path / "throw.webp")
