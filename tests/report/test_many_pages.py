"""Many pages at once: one that fails keeps no other away, workers change no byte, an end leaves whole pages only."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
from collections import deque
from pathlib import Path

import pytest

import symphys.report
from symphys.report import WantedPages, make_pages, outdated, wanted_below
from symphys.report.making import batch as making
from symphys.report.making import run_pages, stamps
from symphys.report.making.run_pages import PageFault
from symphys.report.making.stamps import read_stamp
from symphys.results.text_files import ReportError

PAGE = "report.html"


@pytest.fixture
def runs(made: Path, tmp_path: Path) -> list[Path]:
    """Six run folders without a motion, which are quick to draw."""
    folders = [tmp_path / "many" / "throw" / f"gradient-seed{seed}" for seed in range(6)]
    for folder in folders:
        shutil.copytree(
            made / "ball_throw" / "gradient-seed0", folder, ignore=shutil.ignore_patterns("*.npz", "figures")
        )
    return folders


def block(folder: Path) -> Path:
    """Put a folder where the page has to go."""
    (folder / PAGE / "inside").mkdir(parents=True)
    return folder / PAGE


def is_whole(page: Path) -> bool:
    return page.read_text(encoding="utf-8").endswith("</html>\n")


@pytest.fixture
def two_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start them however few pages there are."""
    monkeypatch.setattr(run_pages, "MIN_PAGES_PER_WORKER", 1)


@pytest.mark.slow
def test_a_page_that_cannot_be_made_is_named_and_the_others_are_made(runs: list[Path]) -> None:
    blocked = block(runs[2])
    made = make_pages(wanted_below(runs[0].parents[1]))
    assert [str(fault.page) for fault in made.faults] == [str(blocked)]
    assert str(blocked) in str(made.faults[0]) and "could not be made: " in str(made.faults[0])
    assert list(made.runs) == [folder / PAGE for folder in runs if folder != runs[2]]
    assert all(map(is_whole, [*made.runs, made.page]))
    said = made.page.read_text(encoding="utf-8").partition("Pages that could not be made")[2]
    assert "throw/gradient-seed2" in said and "directory" in said
    with pytest.raises(ReportError, match="gradient-seed2"):
        symphys.write_report(runs[0].parents[1])
    (blocked / "inside").rmdir()
    blocked.rmdir()
    mended = make_pages(wanted_below(runs[0].parents[1]))
    assert mended.runs == (blocked,) and "could not be made" not in mended.page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_motion_that_cannot_be_drawn_ends_no_page_of_others(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page of its own run is a fault, that of the folder says why."""
    shutil.copytree(made / "ball_throw" / "gradient-seed0", tmp_path / "all" / "throw" / "gradient-seed0")

    def fails(*_: object) -> None:
        raise ValueError("cannot convert float NaN to integer")

    monkeypatch.setattr("symphys.report.scene.animation.motion_data", fails)
    found = make_pages(wanted_below(tmp_path / "all", remake=True))
    assert [fault.page.name for fault in found.faults] == [PAGE]
    text = found.page.read_text(encoding="utf-8")
    assert is_whole(found.page) and text.count("ValueError: cannot convert float NaN to integer") == 2
    assert "The motion could not be drawn" in text and "Pages that could not be made" in text


@pytest.mark.slow
def test_pages_that_take_too_long_are_given_up(runs: list[Path]) -> None:
    """Their workers are killed, and others take their places."""
    made = make_pages(WantedPages(runs[0].parents[1], tuple(runs[:2])), limit=0.0)
    assert [fault.reason for fault in made.faults] == ["it was not made within 0 s"] * 2
    assert is_whole(made.page) and "it was not made within 0 s" in made.page.read_text(encoding="utf-8")
    assert not multiprocessing.active_children()


def test_any_error_is_a_fault_with_its_kind(runs: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    draw = run_pages.write_run_report

    def fails(folder: Path) -> Path:
        if folder == runs[0]:
            raise ZeroDivisionError("by nothing")
        return draw(folder)

    monkeypatch.setattr(run_pages, "write_run_report", fails)
    monkeypatch.setattr(making, "write_batch_report", lambda root, unmade: 1 / 0)
    made = make_pages(wanted_below(runs[0].parents[1]))
    assert [fault.reason for fault in made.faults] == [
        "ZeroDivisionError: by nothing",
        "ZeroDivisionError: division by zero",
    ]
    assert [fault.page.name for fault in made.faults] == [PAGE, "index.html"]
    assert len(made.runs) == 5


@pytest.mark.slow
@pytest.mark.usefixtures("two_workers")
def test_workers_change_no_byte_and_name_what_fails(runs: list[Path]) -> None:
    for folder in runs:
        assert run_pages.make_run_page(folder, figures=False) is None
    alone = {folder: (folder / PAGE).read_bytes() for folder in runs}
    for folder in runs:
        (folder / PAGE).unlink()
    blocked = block(runs[3])
    told: list[int] = []
    made = make_pages(WantedPages(runs[0].parents[1], tuple(runs), batch=False), 2, told.append)
    assert [fault.page for fault in made.faults] == [blocked]
    assert {page.parent: page.read_bytes() for page in made.runs} == {f: alone[f] for f in runs if f != runs[3]}
    assert told[-1] == 6 and sorted(told) == told
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_a_worker_that_dies_fails_its_page_only(runs: list[Path]) -> None:
    """Killed after its first page, it cannot make the second; who takes its place makes the rest."""
    found: dict[Path, PageFault | None] = {}

    def done(folder: Path, fault: PageFault | None) -> None:
        if not found:
            for child in multiprocessing.active_children():
                assert child.pid is not None
                os.kill(child.pid, signal.SIGKILL)
        found[folder] = fault

    run_pages.PagePool(deque(runs), figures=False, done=done).run(1)
    assert list(found) == runs
    faults = {folder: fault.reason for folder, fault in found.items() if fault is not None}
    assert faults == {runs[1]: run_pages.DIED}
    assert all(is_whole(folder / PAGE) for folder in runs if folder not in faults)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 1])
def test_an_interruption_leaves_whole_pages_only(runs: list[Path], workers: int) -> None:
    def interrupt(folder: Path, fault: PageFault | None) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        if workers:
            run_pages.PagePool(deque(runs), figures=False, done=interrupt).run(workers)
        else:
            run_pages.make_run_pages(runs, figures=False, jobs=1, done=interrupt)
    pages = [folder / PAGE for folder in runs if (folder / PAGE).exists()]
    assert 1 <= len(pages) < len(runs)
    assert all(map(is_whole, pages))
    assert not [path for folder in runs for path in folder.iterdir() if path.name.startswith(".")]
    assert not multiprocessing.active_children()


def test_only_what_is_new(runs: list[Path], tmp_path: Path) -> None:
    (tmp_path / "nothing").mkdir()
    root = runs[0].parents[1]
    make_pages(WantedPages(root, tuple(runs[:5]), batch=False))
    os.utime(runs[0] / "result.json", (2**31, 2**31))
    (runs[1] / "log.txt").write_text("another line", "utf-8")
    (runs[2] / "trace.csv").unlink()
    page = runs[3] / PAGE
    page.write_text(page.read_text("utf-8").replace("made-from", "made-by"), "utf-8")
    assert [folder for folder in runs if outdated(folder)] == [runs[1], runs[2], runs[3], runs[5]]
    wanted = wanted_below(root)
    assert wanted.runs == (runs[1], runs[2], runs[3], runs[5]) and wanted.batch and wanted.kept == 2
    assert wanted_below(root, remake=True).runs == tuple(runs)
    assert not wanted_below(runs[0]).batch
    with pytest.raises(ReportError, match="no run folder"):
        wanted_below(tmp_path / "nothing")


@pytest.mark.slow
def test_a_page_that_is_kept_is_the_page_that_would_be_made(runs: list[Path]) -> None:
    """Of a batch that was made a second time no byte has changed, and nothing was written."""
    root = runs[0].parents[1]
    make_pages(wanted_below(root))
    pages = {page: (page.read_bytes(), page.stat().st_ino) for page in sorted(root.rglob("*.html"))}
    assert len(pages) == 7
    again = make_pages(wanted_below(root))
    assert again.runs == () and again.kept == 6 and again.page == root / "index.html"
    assert {page: (page.read_bytes(), page.stat().st_ino) for page in pages} == pages
    make_pages(wanted_below(root, remake=True))
    assert {page: page.read_bytes() for page in pages} == {page: content for page, (content, _) in pages.items()}
    assert not any(page.stat().st_ino == number for page, (_, number) in pages.items())


@pytest.mark.slow
def test_the_page_of_the_batch_follows_what_it_shows(runs: list[Path]) -> None:
    """A run that changes, comes, goes, or loses its page, which it would link to."""
    root = runs[0].parents[1]
    index = make_pages(wanted_below(root)).page

    def follows() -> bool:
        before = index.stat().st_ino
        page = make_pages(WantedPages(root, tuple(f for f in wanted_below(root).runs if f not in lost))).page
        return page.stat().st_ino != before

    lost: list[Path] = []
    assert not follows()
    result = runs[0] / "result.json"
    result.write_text(result.read_text("utf-8").replace('"seed": 0', '"seed": 70'), "utf-8")
    assert follows() and ">70<" in index.read_text("utf-8")
    shutil.copytree(runs[1], runs[1].with_name("gradient-seed9"))
    assert follows() and "gradient-seed9" in index.read_text("utf-8")
    shutil.rmtree(runs[1].with_name("gradient-seed9"))
    assert follows() and "gradient-seed9" not in index.read_text("utf-8")
    lost.append(runs[2])
    (runs[2] / PAGE).unlink()
    assert follows() and "gradient-seed2/report.html" not in index.read_text("utf-8")
    assert not follows()


@pytest.mark.parametrize("kind", ["full", "light"])
def test_pages_of_older_versions_are_made_again(runs: list[Path], kind: str) -> None:
    """Their stamps have a kind, and names of figures that lay beside them."""
    make_pages(WantedPages(runs[0], (runs[0],), batch=False))
    page = runs[0] / PAGE
    digest = read_stamp(page)
    assert len(digest) == 64 and not outdated(runs[0])
    new = page.read_text("utf-8")
    page.write_text(new.replace(digest, f"{kind} {digest} convergence states"), "utf-8")
    assert outdated(runs[0]) and wanted_below(runs[0]).runs == (runs[0],)
    make_pages(wanted_below(runs[0]))
    assert page.read_text("utf-8") == new


@pytest.mark.thorough
def test_figures_are_written_where_they_are_asked_for(made: Path, tmp_path: Path) -> None:
    """Of all runs, also where their pages are up to date; the kinds of pages of older versions are warned of."""
    root = Path(shutil.copytree(made / "two_balls", tmp_path / "two_balls"))
    shutil.rmtree(root / "cma-seed0")
    symphys.write_report(root)
    assert not list(root.rglob("figures"))
    pages = {path: path.read_bytes() for path in root.rglob("*.html")}
    assert len(pages) == 3
    symphys.write_report(root, figures=True)
    drawn = {path.name for path in (root / "gradient-seed0" / "figures").iterdir()}
    assert {"convergence.svg", "convergence.csv", "motion.svg", "variables.csv"} <= drawn
    assert (root / "ipopt-seed1" / "figures" / "states.svg").is_file()
    assert (root / "figures" / "two_balls-convergence.svg").is_file()
    for folder in [*root.rglob("figures")]:
        shutil.rmtree(folder)
    with pytest.warns(DeprecationWarning, match="figures=True"):
        symphys.write_report(root, pages="light")
    assert not list(root.rglob("figures"))
    with pytest.warns(DeprecationWarning, match="figures=True"):
        symphys.write_report(root, pages="full")
    assert {path.name for path in (root / "gradient-seed0" / "figures").iterdir()} == drawn
    assert {path: path.read_bytes() for path in root.rglob("*.html")} == pages


def test_pages_need_no_matplotlib(made: Path, tmp_path: Path) -> None:
    """Neither importing the package nor writing every page of a batch, nor a page of a motion alone."""
    shutil.copytree(made, tmp_path / "batch", ignore=shutil.ignore_patterns("cma-*", "gradient-seed[1-4]"))
    code = f"""
import sys
from pathlib import Path
import symphys, symphys.report
root = Path({str(tmp_path / "batch")!r})
try: symphys.write_report(root)
except symphys.SymphysError: pass
run = root / "two_balls" / "gradient-seed0"
symphys.report.write_motion(run / "trajectory.npz", run / "scene.json", root / "motion.html")
print(len(list(root.rglob("*.html"))), "matplotlib" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    count, imported = done.stdout.split()
    assert int(count) >= 7 and imported == "False"


def test_other_code_makes_pages_again(runs: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    make_pages(WantedPages(runs[0], (runs[0],), batch=False))
    assert not outdated(runs[0])
    monkeypatch.setattr(stamps, "drawing_digest", lambda: "of other code")
    assert outdated(runs[0])


@pytest.mark.slow
def test_what_draws_is_known_to_stamps() -> None:
    """All modules of the package that reporting loads are among those whose change makes pages again."""
    code = "import sys, symphys.report; print(*(name for name in sys.modules if name.startswith('symphys.')))"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    known = {name.removesuffix(".py") for name in stamps.DRAWING}
    assert {name.split(".")[1] for name in loaded} <= known
    assert stamps.sources(stamps.PACKAGE / "report") and all(
        (stamps.PACKAGE / each).exists() for each in stamps.DRAWING
    )
