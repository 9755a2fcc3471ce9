"""The benchmarks of ``benchmarks/``: each says its question and its columns; some run in their quick form."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import bench
import pytest
from tools.repeats import thorough

NAMES = bench.names()
NEEDS = {"environments": ("torch", "gymnasium"), "imports": ("mujoco",), "speed": ("mujoco",)}
"""Packages without which a benchmark cannot be imported or run."""
QUICK = ("kernels", "methods", "idto")
"""Benchmarks that run in the tests; the others' parts are tested beside what they measure."""


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_says_its_question_and_its_columns(name: str) -> None:
    for package in NEEDS.get(name, ()):
        pytest.importorskip(package)
    module = importlib.import_module(name)
    assert bench.question(name).endswith("?")
    assert all(module.COLUMNS) and all(module.COLUMNS.values())
    assert module.rows.__kwdefaults__ is None and "quick" in module.rows.__annotations__
    assert all(isinstance(value, bool | int | float | str | tuple) for value in bench.options_of(name).values())


def test_at_most_25_benchmarks() -> None:
    """More are studies: close one, and write a note of it."""
    assert 15 < len(NAMES) <= 25


def test_the_list_names_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert bench.main([]) == 0
    assert [line.split()[1] for line in capsys.readouterr().out.splitlines()] == [f"bench-{name}" for name in NAMES]


def test_an_unknown_name_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert bench.main(["nothing"]) == 2
    assert "there is no benchmark nothing" in capsys.readouterr().err


@pytest.mark.parametrize("file", sorted(bench.RESULTS.glob("*.json")), ids=lambda file: file.stem)
def test_stored_results_say_where_they_come_from(file: Path) -> None:
    """Results of quick runs are not stored."""
    found = json.loads(file.read_text(encoding="utf-8"))
    assert file.stem == found["benchmark"] in NAMES
    assert found["options"]["quick"] is False
    assert found["rows"] and all(row.keys() <= found["columns"].keys() for row in found["rows"])
    assert found["commit"] and found["date"] and {"casadi", "numpy"} <= found["versions"].keys()
    assert {"processor", "cores", "memory_gib", "load_before", "shared"} <= found["machine"].keys()


def run(name: str, tmp_path: Path, *arguments: str) -> dict[str, Any]:
    """Run a benchmark in its quick form, and return what it stores."""
    out = tmp_path / "found.json"
    assert bench.main([name, "--quick", "--out", str(out), *arguments]) == 0
    return dict(json.loads(out.read_text(encoding="utf-8")))


@pytest.mark.slow
@pytest.mark.parametrize("name", [thorough(QUICK[0]), *QUICK[1:]])
def test_a_quick_run_has_rows(name: str, tmp_path: Path) -> None:
    found = run(name, tmp_path)
    assert found["rows"] and found["options"]["quick"] is True
    assert all(row.keys() <= found["columns"].keys() for row in found["rows"])


@pytest.mark.slow
def test_every_way_to_step_is_measured(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    pytest.importorskip("gymnasium")
    (row,) = run("environments", tmp_path)["rows"]
    assert min(value for key, value in row.items() if key.endswith(("_ms", "_s"))) > 0


def test_in_process_returns_what_a_function_returns_and_says_what_failed() -> None:
    assert bench.in_process(bench.question, "compare") == bench.question("compare")
    with pytest.raises(RuntimeError, match=r"(?s)bench.question: exit 1: .*nothing.py"):
        bench.in_process(bench.question, "nothing")


def test_numbers_that_are_not_finite_are_left_out_and_columns_must_be_described(
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows = [{"a": float("nan"), "b": 1.23456}, {"a": float("inf"), "b": "x"}]
    assert list(bench.printed(rows, {"a": "m", "b": "s"})) == [{"a": None, "b": 1.23456}, {"a": None, "b": "x"}]
    assert "| - | 1.235 |" in capsys.readouterr().out
    with pytest.raises(KeyError, match="c"):
        list(bench.printed([{"c": 1}], {"a": "m"}))
