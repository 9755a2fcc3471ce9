"""The page of a long batch: rows as data, a page of them at a time, read from no more than it needs."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.page_scripts import NODE, held, run_script

from symphys import files
from symphys.report import write_batch_report
from symphys.report.pages.batch import MOST_STUDIES
from symphys.report.pages.comparison import NumberColumn, WordColumn, setting_columns
from symphys.results.discovery import Entry, Study, read_all, run_folders, sample
from symphys.results.result import Result
from symphys.results.run import BriefReader, read_brief_table, read_run

EMPTY = {"z", "trust", "price", "guess", "costs", "advice", "iterations", "absent"}


def write(folder: Path, solver: str, seed: int, objective: float, **more: Any) -> None:
    """A run without a motion."""
    folder.mkdir(parents=True)
    check = {"kind": "target", "name": "there", "error": objective, "tolerance": 1.0, "ratio": objective, "unit": "m"}
    met = objective <= 1
    result = {
        "format": 1, "problem": "throw", "title": "A throw", "solver": solver, "seed": seed, "solved": met,
        "status": "met" if met else "budget", "verdict": "solved" if met else "not solved", "objective": objective,
        "checks": [{**check, "met": met}], "counts": {"rollouts": 10 + seed}, "seconds": {"solve": 0.1},
        "equivalents": 1.5 * seed, "z": {"throw": {"value": [1.0]}}, "trust": {"energy": {"time": [0.0, 1.0]}},
    }  # fmt: skip
    files.write_json(folder / "result.json", result)
    files.write_json(folder / "config.json", {"problem": "throw", "solver": solver, "seed": seed, **more})


def rows_of(text: str) -> list[dict[str, Any]]:
    """The data of the tables that are shown a page at a time."""
    return held(text, 'class="rows">')


def column(table: dict[str, Any], title: str) -> dict[str, Any]:
    return next(each for each in table["columns"] if each["title"] == title)


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """300 runs of two solvers, of which every tenth is not solved."""
    root = tmp_path_factory.mktemp("long")
    for seed in range(150):
        for solver in ("cma", "gradient"):
            write(root / "throw" / f"{solver}-seed{seed}", solver, seed, 0.5 + 0.001 * seed + (seed % 10 == 0))
    for seed in (3, 4):
        (root / "throw" / f"cma-seed{seed}" / "report.html").touch()
    return root, write_batch_report(root).read_text(encoding="utf-8")


def test_rows_are_data_that_hold_every_run(long: tuple[Path, str]) -> None:
    root, text = long
    (table,) = rows_of(text)
    assert text.count("<tr") < 20
    assert [len(each["of"]) for each in table["columns"]] == [300] * len(table["columns"])
    assert table["page"] < 100
    assert column(table, "seed")["of"] == [*range(150), *range(150)]
    assert column(table, "objective")["of"][:3] == [1.5, 0.501, 0.502]
    assert column(table, "solver")["words"] == ["cma", "gradient"]
    links = column(table, "page")["of"]
    assert [link for link in links if link] == [f"./throw/cma-seed{seed}/report.html" for seed in (3, 4)]
    assert all((root / link).is_file() for link in links if link)
    assert "270 of 300 runs solved" in text and text.count("✓</i>135") == 2
    assert text.count("sha256-") == 2 and "http" not in text.replace("http-equiv", "")


@pytest.mark.slow
def test_few_runs_have_chips_and_a_table_and_one_has_none(made: Path, tmp_path: Path) -> None:
    shutil.copytree(made / "ball_throw", tmp_path / "few")
    text = write_batch_report(tmp_path / "few").read_text(encoding="utf-8")
    assert len(rows_of(text)) == 1 and 'class="pill good"' in text
    shutil.copytree(made / "ball_throw" / "cma-seed0", tmp_path / "one" / "cma-seed0")
    assert not rows_of(write_batch_report(tmp_path / "one").read_text(encoding="utf-8"))


def test_many_settings_are_tables_without_figures(tmp_path: Path) -> None:
    for number in range(MOST_STUDIES + 1):
        settings = {"ground.friction": number / 10, "name": f"n{number}"}
        for seed in range(2):
            write(tmp_path / f"throw@{number:02}" / f"cma-seed{seed}", "cma", seed, 0.1 * number, settings=settings)
    text = write_batch_report(tmp_path).read_text(encoding="utf-8")
    groups, runs = rows_of(text)
    assert column(groups, "ground.friction")["of"] == pytest.approx([n / 10 for n in range(MOST_STUDIES + 1)])
    assert column(runs, "name")["words"][:2] == ["n0", "n1"]
    assert column(groups, "solved")["of"] == [2] * 11 + [0] * 10
    assert len(column(runs, "seed")["of"]) == 2 * (MOST_STUDIES + 1)
    assert not (tmp_path / "figures").exists()


def test_settings_that_are_many_stand_in_one_column() -> None:
    (one,) = setting_columns([{f"k{n}": n for n in range(20)}])
    assert isinstance(one, WordColumn) and one.values[0].startswith("k0=0, k1=1")
    mixed = setting_columns([{"a": 1}, {"b": "x"}])
    assert [type(each) for each in mixed] == [NumberColumn, WordColumn]


@pytest.mark.parametrize("more", [{}, {"verdict": "doubted", "doubts": ["it flies"]}])
def test_brief_reading_gives_what_whole_reading_gives(made: Path, tmp_path: Path, more: dict[str, Any]) -> None:
    """Of every folder, broken ones and those from before verdicts among them, whatever is not left out."""
    shutil.copytree(made, tmp_path / "batch", ignore=shutil.ignore_patterns("*.npz", "trace.csv"))
    read, folders = BriefReader(tmp_path), run_folders(tmp_path)
    shown = {each.name for each in dataclasses.fields(Result)} - EMPTY | {
        "folder",
        "place",
        "readable",
        "settings",
        "met",
    }
    assert len(folders) == 17
    for folder in folders:
        if "solver" in (folder / "result.json").read_text():
            stages = [{"smoothing": 0.1, "status": "met", "counts": {"rollouts": 3}}] * folder.name.endswith("3")
            files.write_json(
                folder / "result.json", json.loads((folder / "result.json").read_text()) | more | {"stages": stages}
            )
        brief, whole = read(folder), read_run(folder, tmp_path)
        for name in sorted(shown):
            assert repr(getattr(brief, name)) == repr(getattr(whole, name)), f"{folder.name}: {name}"
        assert brief.trace.rows == 0 and not brief.z and not brief.trust


def test_only_large_objects_are_left_out(tmp_path: Path) -> None:
    inner = {"a": {"b": [1, 2]}, "text": '\n "trust": {\n'}
    for value in ({"verdict": "x", "trust": inner, "z": inner}, {"z": {}, "verdict": "x", "trust": {}, "seed": 3}):
        files.write_json(tmp_path / "result.json", value)
        content = read_brief_table(str(tmp_path / "result.json"))
        kept = {key: entry for key, entry in value.items() if key not in ("z", "trust")}
        assert {key: content[key] for key in kept} == kept
    files.write_json(tmp_path / "result.json", {"verdict": "x", "trust": inner, "seed": 3})
    assert read_brief_table(str(tmp_path / "result.json"))["trust"] == {}
    (tmp_path / "result.json").write_text(json.dumps({"verdict": "x", "trust": inner}))
    assert read_brief_table(str(tmp_path / "result.json"))["trust"] == inner


def test_a_sample_has_the_first_and_the_last(made: Path) -> None:
    runs, _ = read_all(made)
    study = Study("p", "", (Entry("gradient", tuple(runs[:5])),))
    assert [run.place for run in sample(study, 3).runs] == [runs[place].place for place in (0, 2, 4)]
    assert sample(study, 9).runs == study.runs


@NODE
def test_the_script_sorts_filters_and_turns_pages(long: tuple[Path, str]) -> None:
    (table,) = rows_of(long[1])
    acts = f"""(() => {{
      const rows = new Rows({json.dumps(table)}), seen = {{}};
      const seed = rows.data.columns.find((c) => c.title === "seed"), of = (row) => seed.of[row];
      const objective = rows.data.columns.find((c) => c.title === "objective");
      seen.first = rows.place();
      rows.turn(1); seen.second = rows.place(); rows.turn(99); seen.last = rows.place();
      rows.filter("gradient seed<3"); seen.few = rows.shown.map(of); seen.words = rows.place();
      rows.filter("not solved"); seen.unsolved = rows.shown.length;
      rows.filter("objective>=1.6"); seen.large = rows.shown.map(of);
      rows.sort(objective); rows.filter(""); seen.lowest = of(rows.shown[0]);
      rows.sort(objective); rows.filter(""); seen.highest = of(rows.shown[0]);
      rows.filter("nowhere"); seen.none = rows.place();
      rows.filter("cma seed=3"); seen.cells = rows.body();
      return seen;
    }})()"""
    seen = run_script(acts, "numbers.js", "rows.js")
    page = table["page"]
    assert seen["first"] == f"1 to {page} of 300 runs" and seen["second"] == f"{page + 1} to {2 * page} of 300 runs"
    assert seen["last"].endswith("to 300 of 300 runs")
    assert seen["few"] == [0, 1, 2] and seen["words"] == "1 to 3 of 3 of 300 runs"
    assert seen["unsolved"] == 30
    assert seen["large"] == [*range(100, 150, 10)] * 2
    assert (seen["lowest"], seen["highest"]) == (1, 140)
    assert seen["none"] == "no run of 300 passes the filter"
    assert seen["cells"].count("<tr>") == 1 and 'href="./throw/cma-seed3/report.html"' in seen["cells"]


@NODE
def test_infinite_and_unknown_numbers_come_last_and_are_shown() -> None:
    data = {"columns": [NumberColumn("x", [np.inf, np.nan, -np.inf, 1e-7]).to_json()], "noun": "run", "page": 9}
    made = f"const r = new Rows({json.dumps(data)});"
    code = f"(() => {{ {made} r.sort(r.data.columns[0]); r.filter(''); return r.body(); }})()"
    cells = re.findall(r">([^<>]+)</td>", run_script(code, "numbers.js", "rows.js"))
    assert cells == ["−∞", "10⁻⁷", "∞", "–"]  # noqa: RUF001
