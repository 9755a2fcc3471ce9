"""The page of a sweep shows what was found against the keys that were swept, and names what is not solved."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tools.page_scripts import charts

from symphys.report import write_batch_report
from symphys.report.pages.answers import found_numbers
from symphys.report.pages.sweep import sweep_of
from symphys.results.discovery import read_all, studies
from symphys.results.drawable import OVERSIZED
from symphys.results.run import BriefReader, read_run

Edit = Callable[..., None]


def swept(root: Path, run: Path, edit: Edit, points: list[dict[str, float]], missed: int = -1) -> Path:
    """Copies of a run under settings, whose speed grows from one to the next; one of them is not solved."""
    for k, settings in enumerate(points):
        name = ",".join(f"{key}={value}" for key, value in settings.items())
        folder = root / f"ball_throw@{name}" / "gradient-seed0"
        shutil.copytree(run, folder)
        z = json.loads((folder / "result.json").read_text())["z"]
        z["throw"]["value"][0] = 4.0 + k
        edit(folder / "config.json", settings=settings)
        edit(folder / "result.json", z=z)
        if k == missed:
            edit(folder / "result.json", solved=False, status="stalled", verdict="not_solved")
        (folder / "report.html").touch()  # a page that is there is linked
    return root


def test_one_key_gives_curves_whose_points_lead_to_runs(run_dir: Path, tmp_path: Path, edit: Edit) -> None:
    root = swept(tmp_path / "out", run_dir, edit, [{"ground.friction": 0.1 * k} for k in range(1, 6)], missed=2)
    text = write_batch_report(root).read_text("utf-8")
    chart = charts(text)["sweep"]
    panels = {panel["title"]: panel for panel in chart["panels"]}
    line, dots, rings = panels["throw.x"]["lines"]
    assert panels["throw.x"]["along"] == "ground.friction"
    assert len(dots["links"]) == 4 and rings["links"] == [
        "./ball_throw%40ground.friction%3D0.30000000000000004/gradient-seed0/report.html"
    ]
    assert line["y"]["d"][0] * line["y"]["q"] == pytest.approx(4.0, abs=2e-3)
    assert "throw.y" not in panels and "throw.y 0" in text  # the same in all runs: said, not drawn
    words = re.sub(r"<[^>]+>", " ", text)
    assert "4 of 5 runs solved" in words and "Runs that are not solved" in words and "All runs" in words
    assert "problems by every solver" not in words


def test_two_keys_give_tables_with_a_link_in_each_cell(run_dir: Path, tmp_path: Path, edit: Edit) -> None:
    points = [{"ball.mass": m, "ground.friction": f} for m in (1.0, 2.0) for f in (0.2, 0.4, 0.6)]
    text = write_batch_report(swept(tmp_path / "out", run_dir, edit, points, missed=1)).read_text("utf-8")
    table = re.search(r'<table class="heat" aria-label="throw.x">.*?</table>', text)
    assert table is not None
    assert re.findall(r">([\d.]+)</a>", table[0]) == ["4", "7", "5", "8", "6", "9"]
    assert len(re.findall(r'class="number missed"', table[0])) == 1


def test_more_keys_give_a_panel_for_each(run_dir: Path, tmp_path: Path, edit: Edit) -> None:
    points = [{"ball.mass": 1.0 + k, "ground.friction": 0.1 * k, "world.drag": 0.01 * k} for k in range(1, 5)]
    text = write_batch_report(swept(tmp_path / "out", run_dir, edit, points)).read_text("utf-8")
    panels = [panel for panel in charts(text)["sweep"]["panels"] if panel["title"] == "throw.x"]
    assert [panel["along"] for panel in panels] == ["ball.mass", "ground.friction", "world.drag"]


def test_other_problems_and_words_are_no_sweep(batch: Path, run_dir: Path, tmp_path: Path, edit: Edit) -> None:
    assert sweep_of(studies(read_all(batch, BriefReader(batch))[0])) is None
    root = tmp_path / "out"
    for name in "abc":
        shutil.copytree(run_dir, root / name / "gradient-seed0")
        edit(root / name / "gradient-seed0" / "config.json", settings={"world.gravity": name})
    assert sweep_of(studies(read_all(root, BriefReader(root))[0])) is None
    assert write_batch_report(root).is_file()


def test_what_solvers_found_stands_side_by_side(batch: Path, edit: Edit) -> None:
    text = write_batch_report(batch).read_text("utf-8")
    table = re.search(r'<table aria-label="What was found">.*?</table>', text)
    assert table is not None
    row = re.search(r"<tr><td><b>spin.y</b>.*?</tr>", table[0])
    assert row is not None and row[0].count("−12") == 4  # noqa: RUF001  cma, gradient, least_squares, nelder_mead
    assert "found the same" in text
    file = batch / "ball_throw" / "least_squares-seed0" / "result.json"
    z = json.loads(file.read_text())["z"]
    z["spin"]["value"][1] = 30.0
    edit(file, z=z)
    assert "There are several answers: least_squares found another than cma." in write_batch_report(batch).read_text()


def test_numbers_that_were_found_have_names_and_units(run_dir: Path, edit: Edit) -> None:
    z = json.loads((run_dir / "result.json").read_text())["z"]
    z["throw"]["unit"] = "m/s"
    edit(run_dir / "result.json", z=z)
    assert found_numbers(read_run(run_dir, run_dir))["throw.x [m/s]"] == 4.0


def test_of_very_many_runs_some_are_drawn_and_all_are_counted(
    run_dir: Path, tmp_path: Path, edit: Edit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("symphys.report.pages.sweep.MOST_RUNS", 4)
    root = swept(tmp_path / "out", run_dir, edit, [{"ground.friction": 0.1 * k} for k in range(1, 8)], missed=1)
    text = write_batch_report(root).read_text("utf-8")
    (panel,) = [panel for panel in charts(text)["sweep"]["panels"] if panel["title"] == "throw.x"]
    assert sum(len(line.get("links", ())) for line in panel["lines"]) == 4
    assert "6 of 7 runs solved" in text and "Drawn are 4 of 7 runs" in text


def test_numbers_near_the_largest_double(run_dir: Path, tmp_path: Path, edit: Edit) -> None:
    root = swept(tmp_path / "out", run_dir, edit, [{"ground.friction": 0.1 * k} for k in range(1, 4)])
    for k, file in enumerate(sorted(root.rglob("result.json"))):
        z = json.loads(file.read_text())["z"]
        z["throw"]["value"][:2] = [1.7e308 * (-1) ** k, 1.7e308]
        edit(file, z=z, objective=1.7e308)
    text = write_batch_report(root).read_text("utf-8")
    assert OVERSIZED in text
    assert not {"throw.x", "throw.y", "objective"} & {panel["title"] for panel in charts(text)["sweep"]["panels"]}


def test_three_keys_give_a_line_for_each_run(run_dir: Path, tmp_path: Path, edit: Edit) -> None:
    points = [
        {"ball.mass": m, "ground.friction": f, "ground.restitution": 0.5 * m} for m in (1.0, 2.0) for f in (0.2, 9e3)
    ]
    text = write_batch_report(swept(tmp_path / "out", run_dir, edit, points, missed=1)).read_text("utf-8")
    (picture,) = re.findall(r'<div class="parallel">.*?</svg>', text, re.DOTALL)
    lines = re.findall(r'<a href="([^"]*)"><title>([^<]*)</title><path d="([^"]*)"', picture)
    assert len(lines) == 4 and all("report.html" in link for link, *_ in lines)
    assert lines[1][1] == "ball.mass=1.0, ground.friction=9000.0, ground.restitution=0.5, gradient, seed 0"
    assert picture.count("stroke-dasharray") == 1
    heights = [[float(y) for y in re.findall(r"[ML][\d.]+ ([\d.]+)", path)] for *_, path in lines]
    assert heights[0][:3] == heights[0][:1] * 3 and heights[3][:3] == heights[3][:1] * 3
    assert heights[0][0] > heights[3][0] and len({len(each) for each in heights}) == 1
