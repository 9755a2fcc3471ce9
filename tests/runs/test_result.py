"""A result survives its file, and a file older than verdicts is judged as a new one is."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from symphys import files
from symphys.results.config import make_config
from symphys.results.result import CheckRecord
from symphys.runs import Result, read_result

NAN = float("nan")
GROWN = {"time": [0, 1], "factor": [1e5, 1]}
FINER = {"what": "dt / 2", "objective": 1.0, "worst": 0.6}
ENERGY = {name: [0.0, 1.0] for name in ("time", "kinetic", "potential", "applied", "contact")}
GAIN = {"step": 1, "time": 0.1, "energy": 9.0, "contacts": ["a-b"]}


def result(*errors: float) -> Result:
    checks = tuple(CheckRecord("target", "inf", error=e, tolerance=0.5, ratio=2 * e, met=e <= 0.5) for e in errors)
    return Result("p", "nan", "gradient", 0, False, "budget", "", objective=NAN, checks=checks)


def test_a_result_survives_its_file(tmp_path: Path) -> None:
    written = result(0.25, math.inf)
    files.write_json(tmp_path / "result.json", written.to_json())
    read = read_result(tmp_path / "result.json")
    assert repr(read) == repr(written)
    assert "NaN" not in (tmp_path / "result.json").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("fields", "verdict"),
    [
        ({}, "solved"),
        ({"solved": False}, "not_solved"),
        ({"checks": []}, "best_found"),
        ({"checks": [], "status": "converged"}, "solved"),
        ({"checks": [], "status": "failed"}, "not_solved"),
        ({"status": "interrupted", "solved": False}, "interrupted"),
        ({"status": "interrupted"}, "interrupted"),
        ({"status": "interrupted", "trust": {"refined": [FINER]}}, "solved"),
        ({"status": "interrupted", "trust": {"refined": [FINER], "passed": 1.5}}, "doubted"),
        ({"status": "interrupted", "trust": {"refined": [FINER]}, "checks": []}, "interrupted"),
        ({"trust": {"deepest": 0.2, "size": 0.1}}, "doubted"),
        ({"trust": {"passed": 1.5}}, "doubted"),
        ({"trust": {"residual": 0.5, "impulse": 1.0}}, "doubted"),
        ({"trust": {"residual": 0.01, "impulse": 1.0}}, "solved"),
        ({"trust": {"growth": GROWN}}, "doubted"),
        ({"trust": {"growth": {"time": [0, 1], "factor": [1e3, 1]}}}, "solved"),
        ({"trust": {"growth": GROWN, "refined": [{"what": "dt / 2", "objective": 1.0, "worst": 0.6}]}}, "solved"),
        ({"trust": {"growth": GROWN, "refined": [{"what": "dt / 2", "objective": 1.0, "worst": 9.0}]}}, "doubted"),
        ({"trust": {"refined": [{"what": "dt / 2", "objective": 1.0, "worst": 2.0}]}}, "solved"),
        ({"trust": {"refined": [{"what": "dt / 2", "objective": 1.0, "worst": 9.0}]}}, "doubted"),
        ({"trust": {"refined": [{"what": "dt / 2", "objective": None, "worst": None}]}}, "doubted"),
        ({"checks": [], "trust": {"refined": [{"what": "dt / 2", "objective": 9.0, "worst": None}]}}, "best_found"),
        ({"trust": {"gained": 9.0, "energy": ENERGY, "gains": [GAIN]}}, "doubted"),
        ({"trust": {"momentum": 0.0, "drift": 0.1, "drifted": 0.1, "energy": ENERGY}}, "doubted"),
    ],
)
def test_a_file_that_is_older_than_verdicts_is_ruled_on(
    tmp_path: Path, fields: dict[str, object], verdict: str
) -> None:
    value = {**result(0.25).to_json(), "solved": True, "objective": 1.0, **fields}
    del value["verdict"], value["doubts"]
    files.write_json(tmp_path / "result.json", value)
    read = read_result(tmp_path / "result.json")
    assert (read.verdict, read.solved) == (verdict, verdict == "solved")
    assert bool(read.doubts) == (verdict == "doubted")


@pytest.mark.parametrize(("errors", "worst"), [((0.25, 1.0), 2.0), ((0.25, NAN), NAN), ((NAN, 0.25), NAN), ((), None)])
def test_worst_is_the_largest_ratio_and_nan_is_worse(errors: tuple[float, ...], worst: float | None) -> None:
    assert repr(result(*errors).worst) == repr(worst)


@pytest.mark.parametrize("content", [[], {}, {"format": 2}, {"format": 1, "problem": "p"}])
def test_other_objects_are_refused_by_name_of_file(tmp_path: Path, content: object) -> None:
    files.write_json(tmp_path / "result.json", content)
    with pytest.raises(files.FileError, match=r"result\.json"):
        read_result(tmp_path / "result.json")


def test_the_key_depends_on_all_that_decides_the_result() -> None:
    base = ("p", "text", "gradient", 0, {"simulation.dt": 0.01}, {"iterations": 5}, "auto")
    changes = [
        (1, "texts"),
        (2, "cma"),
        (3, 1),
        (4, {"simulation.dt": 0.02}),
        (4, {}),
        (5, {"iterations": 6}),
        (6, "casadi"),
    ]
    keys = {make_config(*base).key}
    for place, value in changes:
        keys.add(make_config(*base[:place], value, *base[place + 1 :]).key)  # type: ignore[arg-type]
    assert len(keys) == 1 + len(changes)
    assert make_config("other stem", *base[1:]).key in keys
