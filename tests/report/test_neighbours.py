"""The page of a run leads to those beside it: other seeds, other solvers, the next settings of a sweep."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from symphys.report import write_run_report
from symphys.report.making.neighbours import neighbours
from symphys.report.making.stamps import folder_digest

PAGE = "report.html"


def a_run(folder: Path) -> Path:
    """Make what is taken for a run folder."""
    folder.mkdir(parents=True)
    (folder / "result.json").write_text("{}")
    return folder


@pytest.fixture
def batch(tmp_path: Path) -> Path:
    """A sweep over two keys; of one point several solvers and seeds."""
    for mass in (0.5, 1, 10):
        for friction in (0.2, 1e-05):
            a_run(tmp_path / f"throw@ball.mass={mass},ground.friction={friction}" / "cma-seed0")
    for name in ("cma-seed2", "cma-seed11", "cma-seed12", "ilqr-seed3"):
        a_run(tmp_path / "throw@ball.mass=1,ground.friction=0.2" / name)
    a_run(tmp_path / "throw" / "cma-seed0")
    return tmp_path


def test_seeds_solvers_and_settings_that_come_next(batch: Path) -> None:
    """Numbers are ordered as such; of two keys each is gone along by itself."""
    found = dict(neighbours(batch / "throw@ball.mass=1,ground.friction=0.2" / "cma-seed2", PAGE))
    assert list(found) == ["seed 0", "seed 11", "ilqr"]
    first = dict(neighbours(batch / "throw@ball.mass=1,ground.friction=0.2" / "cma-seed0", PAGE))
    assert list(first) == ["seed 2", "ilqr", "ball.mass=0.5", "ball.mass=10", "ground.friction=1e-05"]
    assert first["ball.mass=10"] == "../../throw%40ball.mass%3D10%2Cground.friction%3D0.2/cma-seed0/report.html"
    assert neighbours(batch / "throw" / "cma-seed0", PAGE) == []
    assert neighbours(batch / "somewhere", PAGE) == []


def test_a_page_is_made_again_where_a_run_comes_beside_it(batch: Path) -> None:
    folder = batch / "throw" / "cma-seed0"
    before = folder_digest(folder)
    a_run(folder.with_name("cma-seed1"))
    assert folder_digest(folder) != before


def test_a_page_has_the_links(run_dir: Path) -> None:
    shutil.copytree(run_dir, run_dir.with_name(run_dir.name.replace("seed0", "seed7")))
    text = write_run_report(run_dir).read_text("utf-8")
    (address,) = re.findall(r'<a href="([^"]*)">seed 7</a>', text)
    write_run_report(run_dir.with_name(run_dir.name.replace("seed0", "seed7")))
    assert (run_dir / address).is_file()
