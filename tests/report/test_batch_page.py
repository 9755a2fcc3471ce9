"""The page of a batch has every solver, every target and every broken folder by name."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tools.page_scripts import charts

from symphys.findings.writing import show
from symphys.report import write_batch_report, write_run_report
from symphys.report.pages.batch import write_batch_figures
from symphys.report.pages.check_figure import ratios
from symphys.results.discovery import read_all, run_folders, studies
from symphys.results.text_files import ReportError


def read(folder: Path) -> str:
    return write_batch_report(folder).read_text(encoding="utf-8")


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<(script|style).*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL))


@pytest.fixture(scope="module")
def page(made: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder whose page was made, to be looked at only, and the page."""
    folder = Path(shutil.copytree(made, tmp_path_factory.mktemp("shown") / "batch"))
    return folder, read(folder)


@pytest.mark.slow
def test_page_compares_all_solvers(page: tuple[Path, str]) -> None:
    text = plain(page[1])
    for word in ("Throw a giant soccer ball", "Two balls, one push", "5 of 5", "0 of 1", "not finite", "budget spent"):
        assert word in text
    for solver in ("gradient", "least_squares", "cma", "ipopt", "nelder_mead"):
        assert solver in text
    assert "cma, gradient and least_squares solved it; ipopt and nelder_mead never did." in text
    assert "Least work: least_squares, worth 50 rollouts" in text
    assert "Both solvers solved it." in text
    assert "13 of 15 runs solved" in text


def test_medians_are_over_seeds(page: tuple[Path, str]) -> None:
    row = re.search(r"<tr><td><span[^>]*>(?:<span[^>]*></span>)?gradient.*?</tr>", page[1], re.DOTALL)
    assert row is not None
    assert re.search(r">55</td>", row[0])
    assert re.search(r">225.5</td>", row[0])


def test_targets_are_told_by_name_for_every_solver(page: tuple[Path, str]) -> None:
    text = plain(page[1])
    assert re.search(r"comes to rest at 10 m 0\.\d+ ✓ met 0\.\d+ ✓ met – ✕ missed 0\.\d+ ✓ met 0\.\d+ ✕ missed", text)  # noqa: RUF001


def test_broken_and_foreign_folders_are_listed(page: tuple[Path, str]) -> None:
    text = plain(page[1])
    assert "2 folders without a readable result" in text
    assert re.search(r"two_balls/cma-seed0 result.json: not valid JSON", text)
    assert re.search(r"elsewhere result.json: a JSON object is expected", text)


@pytest.mark.slow
def test_page_needs_nothing_else_and_is_the_same_again(page: tuple[Path, str]) -> None:
    batch, text = page
    assert "http://" not in text
    assert "https://" not in text
    (player,) = re.findall(r'src="([^"]*)"', text)
    assert player.startswith("assets/viewer-") and (batch / player).is_file()
    assert read(batch) == text
    assert set(charts(text)) == {"ball_throw-convergence", "two_balls-convergence"}
    assert text.count('class="checks"') == 2 < text.count("<canvas")  # several solvers stand side by side
    assert not (batch / "figures").exists()


@pytest.mark.slow
def test_figures_of_a_batch_are_files_on_request(page: tuple[Path, str], tmp_path: Path) -> None:
    paths = write_batch_figures(page[0], tmp_path)
    stems = {f"{p}-{f}" for p in ("ball_throw", "two_balls") for f in ("convergence", "motion")}
    assert {path.name for path in paths} == {f"{stem}.{kind}" for stem in stems for kind in ("svg", "csv")}
    assert set(tmp_path.iterdir()) == set(paths)


def test_marks_of_checks_say_their_numbers(page: tuple[Path, str]) -> None:
    """A dot for each seed and a mark for each solver, hollow where its median misses, an arrow beyond the axis."""
    picture = re.search(r'<figure class="checks">.*?</figure>', page[1], re.DOTALL)
    assert picture is not None
    seen = ratios(studies(read_all(page[0])[0])[0])
    titles = re.findall(r"<title>(.*?)</title>", picture[0])
    for name, solvers in seen.items():
        assert name in titles
        for solver, values in solvers.items():
            many = f", median of {len(values)} seeds" if len(values) > 1 else ""
            assert f"{solver}{many}: {show(float(np.median(values)), 3)} of the tolerance" in titles
    assert f"gradient, seed 3: {show(float(seen['stands still']['gradient'][3]), 3)}" in titles
    assert picture[0].count('class="seed"') == sum(v.size for s in seen.values() for v in s.values() if v.size > 1)
    shown = [solvers for name, solvers in seen.items()]
    misses = sum(float(np.median(values)) > 1 for solvers in shown for values in solvers.values())
    assert misses and picture[0].count('fill="#fff"') == misses
    places = [float(x) for x in re.findall(r'<circle cx="([\d.]+)"[^>]*class="seed"', picture[0])]
    assert places and all(0 < x < 1000 for x in places)


@pytest.mark.slow
def test_links_go_to_pages_that_exist(batch: Path) -> None:
    assert 'href="./' not in read(batch)
    for folder in run_folders(batch):
        (folder / "report.html").touch()
    links = re.findall(r'href="\./([^"]+)"', read(batch))
    assert len(links) == 15
    assert all((batch / link).is_file() for link in links)


@pytest.mark.slow
def test_batch_of_one_run_folder(run_dir: Path) -> None:
    write_run_report(run_dir)
    text = read(run_dir)
    assert "gradient solved it." in plain(text)
    assert 'href="./report.html"' in text


@pytest.mark.slow
def test_same_problem_in_two_places_is_not_mixed(batch: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        shutil.copytree(batch / "two_balls", tmp_path / "both" / name / "two_balls")
    text = read(tmp_path / "both")
    assert "two_balls in a/two_balls" in plain(text)
    assert set(charts(text)) == {"two_balls-convergence", "two_balls-2-convergence"}


@pytest.mark.slow
def test_names_cannot_lead_out_of_the_folder(batch: Path, edit: Callable[..., None]) -> None:
    for folder in run_folders(batch / "two_balls"):
        if "cma" not in folder.name:
            edit(folder / "result.json", problem="../../evil<script>", title="<script>alert(1)</script>")
    text = read(batch)
    assert "<script>alert" not in text
    assert "evil<script>" not in text
    assert "evil-script-convergence" in charts(text)
    assert (batch / "figures" / "evil-script-motion.svg") in write_batch_figures(batch, batch / "figures")
    assert not list(batch.parent.glob("evil*"))


@pytest.mark.parametrize("more", ["", ', "seed": "inf", "objective": [], "checks": {}, "counts": 3'])
def test_almost_empty_results_are_runs(tmp_path: Path, more: str) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "result.json").write_text('{"solver": "x", "problem": "y"' + more + "}")
    text = plain(read(tmp_path))
    assert "x did not solve it." in text
    assert "There is no motion to draw: trajectory.npz: there is no such file." in text


def test_only_broken_folders(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "result.json").write_text("{")
    assert "1 folder without a readable result" in plain(read(tmp_path))


def test_folder_without_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="no run folder"):
        write_batch_report(tmp_path)
    with pytest.raises(ReportError, match="no such folder"):
        write_batch_report(tmp_path / "nowhere")
