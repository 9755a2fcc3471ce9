"""Conditions, orders, the best runs, files and data frames of the table, and what differs between two runs."""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.recorded_runs import record, recorded

import symphys
from symphys import files
from symphys.errors import SymphysError
from symphys.findings.verdict import BEST_FOUND, DOUBTED, NOT_SOLVED, SOLVED
from symphys.results.file_names import CONFIG, PROBLEM, RESULT
from symphys.results.result import VariableRecord
from symphys.results.table import best, chosen, columns, ordered, read_rows, write_table
from symphys.results.table.difference import differences
from symphys.results.table.writing import json_lines, packed

ROWS = [
    {
        "run": "a/1",
        "case": "a",
        "verdict": SOLVED,
        "objective": 2.0,
        "seed": 1,
        "ground.friction": 0.5,
        "equivalents": 9,
    },
    {"run": "a/2", "case": "a", "verdict": NOT_SOLVED, "objective": 1.0, "seed": 2, "ground.friction": "rough"},
    {"run": "b/1", "case": "b", "verdict": DOUBTED, "objective": 0.5, "seed": 1, "solved": False},
    {"run": "b/2", "case": "b", "verdict": BEST_FOUND, "objective": 3.0, "seed": 10, "solved": True, "why": "x"},
    {"run": "c/1", "case": "c", "verdict": "unreadable", "output: speed [m/s]": 4.0, "cost: speed": math.inf},
]


def runs(rows: list[dict[str, object]]) -> list[object]:
    return [row["run"] for row in rows]


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        ("objective<2", ["a/2", "b/1"]),
        ("objective <= 2", ["a/1", "a/2", "b/1"]),
        ("objective>=2.0", ["a/1", "b/2"]),
        ("seed=1", ["a/1", "b/1"]),
        ("seed==1.0", ["a/1", "b/1"]),
        ("seed!=1", ["a/2", "b/2", "c/1"]),
        ("verdict=solved", ["a/1"]),
        ("verdict!=*solved", ["b/1", "b/2", "c/1"]),
        ("run=b*", ["b/1", "b/2"]),
        ("run>b", ["b/1", "b/2", "c/1"]),
        ("solved=true", ["b/2"]),
        ("solved=no", ["b/1"]),
        ("solved=perhaps", []),
        ("why=", ["a/1", "a/2", "b/1", "c/1"]),
        ("ground.friction=0.5", ["a/1"]),
        ("ground.friction=rough", ["a/2"]),
        ("ground.friction<0.9", ["a/1"]),
        ("output: speed>3", ["c/1"]),
        ("speed [m/s]>3", ["c/1"]),
        ("cost: speed=inf", ["c/1"]),
    ],
)
def test_conditions(condition: str, expected: list[str]) -> None:
    assert runs(chosen(ROWS, [condition])) == expected


def test_all_conditions_must_hold() -> None:
    assert runs(chosen(ROWS, ["seed=1", "objective<1"])) == ["b/1"]
    assert runs(chosen(ROWS, [])) == runs(ROWS)


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        ("objectiv<1", '"objective"'),
        ("nothing.like=1", "no run has a column"),
        ("speed>1", '"speed"'),
        ("objective", "no condition; write KEY"),
        ("<3", "no condition"),
    ],
)
def test_what_is_no_condition_is_said(condition: str, message: str) -> None:
    with pytest.raises(SymphysError, match=message):
        chosen(ROWS, [condition])


def test_orders() -> None:
    assert runs(ordered(ROWS, "objective")) == ["b/1", "a/2", "a/1", "b/2", "c/1"]
    assert runs(ordered(ROWS, "-objective")) == ["b/2", "a/1", "a/2", "b/1", "c/1"]
    assert runs(ordered(ROWS, "seed,-objective"))[:2] == ["a/1", "b/1"]
    assert runs(ordered(ROWS, "ground.friction"))[:2] == ["a/1", "a/2"], "numbers before texts"
    with pytest.raises(SymphysError, match="did you mean"):
        ordered(ROWS, "-objectives")


def test_the_best_is_by_verdict_then_by_a_column() -> None:
    assert runs(best(ROWS)) == ["a/1", "b/2"]
    assert runs(best(ROWS, overall=True)) == ["a/1"]
    rows = [{**ROWS[0], "run": str(k), "objective": 1.0, "equivalents": work} for k, work in enumerate((5, 3, 4))]
    assert runs(best(rows)) == ["1"], "the cheapest of equals"
    assert runs(best(rows, "-equivalents")) == ["0"]
    assert runs(best([{**rows[0], "objective": None}, rows[2]])) == ["2"], "one without an objective is not the best"


@pytest.mark.slow
def test_the_table_as_files(tmp_path: Path) -> None:
    record(tmp_path, recorded(objective=1 / 3), ground__friction=0.6, objective__stop="met", ball__fixed=True)
    record(tmp_path, recorded(seed=1, objective=math.inf, verdict="not_solved", outputs={"height [m]": 1.0}))
    assert write_table(tmp_path) == [tmp_path / "runs.csv", tmp_path / "runs.parquet"]
    rows = read_rows(tmp_path).rows
    read = list(csv.DictReader(io.StringIO((tmp_path / "runs.csv").read_text(encoding="utf-8"))))
    assert list(read[0]) == columns(rows)
    assert list(read[0])[5:8] == ["ball.fixed", "ground.friction", "objective.stop"]
    (plain,) = (line for line in read if line["run"] == "throw/gradient-seed1")
    (other,) = (line for line in read if line["run"] != "throw/gradient-seed1")
    assert (plain["objective"], plain["ground.friction"], plain["solved"]) == ("inf", "", "false")
    assert float(other["objective"]) == 1 / 3 and other["ball.fixed"] == "true"
    parquet = pytest.importorskip("pyarrow.parquet").read_table(tmp_path / "runs.parquet").to_pylist()
    for line, row in zip(parquet, rows, strict=True):
        assert {name: value for name, value in line.items() if value is not None} == row


@pytest.mark.parametrize(
    "column",
    [
        ["a", None, "\N{ROCKET}", ""],
        [1.5, None, math.nan, -math.inf],
        [None, True, False],
        [1, -2, 3],
        [None, None],
        [],
    ],
)
def test_columns_are_those_that_arrow_makes(column: list[Any]) -> None:
    """To the bit of what is known; made without pandas."""
    arrow = pytest.importorskip("pyarrow")
    found, expected = packed(arrow, column, None), arrow.array(column)
    found.validate(full=True)
    assert found.type == expected.type
    assert repr(found.to_pylist()) == repr(expected.to_pylist())


def test_without_pyarrow_there_is_csv_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record(tmp_path)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert write_table(tmp_path) == [tmp_path / "runs.csv"]
    assert not (tmp_path / "runs.parquet").exists()


def test_the_table_as_a_data_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    for seed in (0, 1, 2):
        record(tmp_path, recorded(seed=seed, objective=3.0 - seed), ground__friction=0.1 * seed)
    (record(tmp_path, recorded(seed=9)) / RESULT).write_text("{", encoding="utf-8")
    table = symphys.results.runs(tmp_path, where="verdict=solved", sort="objective")
    assert list(table["seed"]) == [2, 1, 0] and table["objective"].dtype == float
    assert list(table.columns[:5]) == ["run", "problem", "case", "solver", "seed"]
    assert list(symphys.results.runs(tmp_path)["verdict"]).count("unreadable") == 1
    assert list(symphys.results.best(tmp_path, overall=True)["seed"]) == [2]
    assert symphys.results.diff is not None
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(SymphysError, match="pip install pandas"):
        symphys.results.runs(tmp_path)


def test_json_is_strict() -> None:
    text = "\n".join(json_lines(ROWS, ["run", "cost: speed", "seed"]))
    assert json.loads(text)[0] == {"run": "a/1", "seed": 1}
    assert json.loads(text)[-1] == {"run": "c/1", "cost: speed": "inf"}
    assert json.loads("".join(json_lines([], ["run"]))) == []


def test_what_differs_between_two_runs(tmp_path: Path) -> None:
    value = np.array([[1.0], [2.5]])
    other = recorded(
        seed=1,
        objective=0.75,
        outputs={"speed [m/s]": 3.5},
        z={"throw": VariableRecord("throw", ("ball.velocity",), value, value, value, value)},
        provenance={"host": "there", "pid": 8, "peak_memory": 5},
        seconds={"solve": 9.0},
    )
    first, second = record(tmp_path / "a"), record(tmp_path / "b", other, ground__friction=0.6)
    (second / PROBLEM).write_text('title = "Another"\n', encoding="utf-8")
    found = {(each.part, each.name): (each.first, each.second) for each in differences(first, second)}
    lines = [name for part, name in found if part == "problem.toml"]
    assert {"-" + 'title = "A throw"', "+" + 'title = "Another"'} <= set(lines)
    assert {key: value for key, value in found.items() if key[0] != "problem.toml"} == {
        ("asked for", "seed"): (0, 1),
        ("settings", "ground.friction"): (None, 0.6),
        ("found", "objective"): (0.5, 0.75),
        ("outputs", "speed [m/s]"): (3.0, 3.5),
        ("variables", "throw[1]"): (2.0, 2.5),
        ("provenance", "host"): ("here", "there"),
    }
    assert "objective: 0.5 -> 0.75 (+0.25)" in map(str, differences(first, second))
    assert differences(first, first) == []


def test_digits_are_shown_as_far_as_they_differ(tmp_path: Path) -> None:
    first = record(tmp_path / "a", recorded(objective=1.0))
    second = record(tmp_path / "b", recorded(objective=1.0 + 2**-52))
    assert "objective: 1.0 -> 1.0000000000000002 (+2.22e-16)" in map(str, differences(first, second))


def test_a_damaged_file_is_named_and_the_others_are_compared(tmp_path: Path) -> None:
    first, second = record(tmp_path / "a"), record(tmp_path / "b", ground__friction=0.6)
    (second / RESULT).write_text("{", encoding="utf-8")
    found = differences(first, second)
    assert {each.part for each in found} == {"settings", "files"}
    assert str(found[0]).startswith("second run: result.json: not valid JSON")
    (second / CONFIG).unlink()
    assert any("config.json: there is no such file" in str(each) for each in differences(first, second))
    with pytest.raises(files.FileError, match="no such folder"):
        differences(first, tmp_path / "c")
