"""Runs are found again: listed, the best of them, what differs between two, and one rolled out again."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from data.recorded_runs import record, recorded

import symphys
from symphys.cli import runs as shown
from symphys.cli.runs import ReadingProgress
from symphys.results.file_names import CONFIG, RESULT
from symphys.results.table import Rows, read_rows

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """Three good runs in two cases, one of them not solved, and one that is damaged."""
    folder = tmp_path / "runs"
    record(folder, recorded(objective=0.5))
    record(folder, recorded(seed=1, objective=0.25, outputs={"speed [m/s]": 9.0}))
    record(folder, recorded(seed=10, objective=0.125, verdict="not_solved"), ground__friction=0.6)
    (record(folder, recorded(seed=2)) / RESULT).write_text('{\n "format"', encoding="utf-8")
    return folder


def test_ls_lists_all_runs_and_names_what_cannot_be_read(run: Run, out: Path) -> None:
    code, printed, err = run("ls", out)
    assert code == 0
    lines = printed.splitlines()
    columns = ["run", "verdict", "objective", "worst", "output: speed [m/s]", "equivalents", "solve_seconds", "why"]
    assert "  ".join(lines[0].split()) == "  ".join(" ".join(columns).split())
    assert [line.split()[:3] for line in lines[1:5]] == [
        ["throw/gradient-seed0", "solved", "0.5"],
        ["throw/gradient-seed1", "solved", "0.25"],
        ["throw/gradient-seed2", "unreadable", "-"],
        ["throw@ground.friction=0.6/gradient-seed10", "not_solved", "0.125"],
    ]
    assert "result.json: not valid JSON" in lines[3]
    assert lines[-1] == "4 runs: 2 solved, 1 unreadable, 1 not solved"
    assert err.splitlines()[0].startswith("symphys: throw/gradient-seed2: result.json: not valid JSON")


def test_ls_filters_sorts_and_chooses_columns(run: Run, out: Path) -> None:
    code, printed, _ = run("ls", out, "--where", "solver=gradient", "--where", "objective<1", "--sort=-seed")
    assert code == 0 and [line.split()[0][-6:] for line in printed.splitlines()[1:4]] == ["seed10", "-seed1", "-seed0"]
    _, printed, _ = run("ls", out, "--columns", "seed, speed", "--sort", "speed", "--limit", 2)
    assert [line.split() for line in printed.splitlines()[1:3]] == [["0", "3"], ["10", "3"]]
    assert printed.splitlines()[-1].endswith("(2 shown)")
    _, printed, _ = run("ls", out, "--columns", "all")
    assert "ground.friction" in printed.splitlines()[0] and "peak_memory" in printed.splitlines()[0]


def test_ls_prints_csv_and_json(run: Run, out: Path) -> None:
    _, text, _ = run("ls", out, "--csv", "--where", "objective<0.3")
    assert [row["seed"] for row in csv.DictReader(io.StringIO(text))] == ["1", "10"]
    _, text, _ = run("ls", out, "--json", "--columns", "run,objective", "--limit", 1)
    assert json.loads(text) == [{"run": "throw/gradient-seed0", "objective": 0.5}]
    _, text, _ = run("ls", out, "--json")
    assert {row["verdict"] for row in json.loads(text)} == {"solved", "not_solved", "unreadable"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--where", "objektive<1"), 'did you mean "objective"?'),
        (("--where", "objective"), "is no condition; write KEY"),
        (("--sort", "nothing"), "no run has a column"),
        (("--columns", "run,spede"), "did you mean"),
        (("--csv", "--json"), "give one of them"),
        (("--limit", "0"), "--limit"),
    ],
)
def test_wrong_usage_exits_2_and_says_what_would_be_valid(
    run: Run, out: Path, arguments: tuple[str, ...], message: str
) -> None:
    code, _, err = run("ls", out, *arguments)
    assert code == 2 and message in err


def test_without_runs_and_without_a_folder(run: Run, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert run("ls", tmp_path / "empty") == (0, "\nno run\n", "")
    assert run("best", tmp_path / "empty")[:2] == (0, f"no run below {tmp_path / 'empty'} has a result\n")
    for command in ("ls", "best"):
        code, _, err = run(command)
        assert code == 2 and err.startswith("symphys: reports: there is no such folder")


def test_best(run: Run, out: Path) -> None:
    _, printed, _ = run("best", out)
    assert [line.split()[0] for line in printed.splitlines()[1:]] == [
        "throw/gradient-seed1",
        "throw@ground.friction=0.6/gradient-seed10",
    ]
    _, printed, _ = run("best", out, "--overall", "--by", "seed")
    assert printed.splitlines()[0].split()[:3] == ["run", "verdict", "seed"]
    assert printed.splitlines()[1].split()[:3] == ["throw/gradient-seed0", "solved", "0"]
    _, printed, _ = run("best", out, "--json", "--where", "seed>5")
    assert [row["seed"] for row in json.loads(printed)] == [10]
    code, _, err = run("best", out, "--by", "spede")
    assert code == 2 and "did you mean" in err


def test_diff(run: Run, out: Path) -> None:
    first, second = out / "throw" / "gradient-seed0", out / "throw@ground.friction=0.6" / "gradient-seed10"
    code, printed, _ = run("diff", first, second)
    assert code == 0
    for line in ("settings", "  ground.friction: - -> 0.6", "  objective: 0.5 -> 0.125 (-0.375)"):
        assert line in printed.splitlines()
    assert run("diff", first, first)[1].startswith("no difference")
    _, printed, _ = run("diff", first, out / "throw" / "gradient-seed2")
    assert "second run: result.json: not valid JSON" in printed
    code, _, err = run("diff", first, out)
    assert code == 2 and f"{out} is no run folder; `symphys ls DIR` lists those below a folder" in err
    assert run("diff", first, out / "nothing")[0] == 2


def test_open_makes_a_page_that_is_missing_and_shows_it(run: Run, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr("webbrowser.open", shown.append)
    single = out / "throw" / "gradient-seed0"
    for folder, page in ((out, out / "index.html"), (single, single / "report.html")):
        code, printed, _ = run("open", folder)
        assert (code, printed.strip()) == (0, page.resolve().as_uri())
        assert page.is_file() and shown[-1] == page.resolve().as_uri()
    before = (out / "index.html").stat().st_mtime_ns
    assert run("open", out)[0] == 0 and (out / "index.html").stat().st_mtime_ns == before
    assert run("open", out / "nothing")[0] == 2


def test_replay(run: Run, throw: Path) -> None:
    folder = symphys.solve(throw, "least_squares", folder="reports", backend="casadi").folder
    code, printed, _ = run("replay", folder)
    assert code == 0 and printed.startswith(f"{folder}: the same, to the bit")
    config = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
    (folder / CONFIG).write_text(json.dumps({**config, "settings": {"world.gravity": -5}}), encoding="utf-8")
    code, _, err = run("replay", folder)
    assert code == 2 and "gravity" in err
    (folder / CONFIG).write_text(json.dumps({**config, "settings": {"ball.position": [0, 0, 2]}}), encoding="utf-8")
    code, printed, err = run("replay", folder)
    assert code == 1, err
    assert "ball.position: 1 m at 0 s" in printed
    code, _, err = run("replay", "nothing")
    assert code == 2 and "there is no such folder" in err


def test_text_of_a_file_cannot_reach_the_terminal_as_codes(run: Run, tmp_path: Path) -> None:
    record(tmp_path / "o", recorded(verdict="not_solved", advice="\x1b[2Jgone", outputs={"a\x1bb": 1.0}))
    _, printed, _ = run("ls", tmp_path / "o")
    assert "gone" in printed and "\x1b" not in printed


def test_a_long_reading_shows_how_far_it_is(
    out: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shown, "QUIET_TIME", 0.0)
    monkeypatch.setattr(shown, "LINE_INTERVAL", 0.0)
    with ReadingProgress() as tell:
        assert len(read_rows(out, tell).rows) == 4
    assert capsys.readouterr().err == "reading run folders: 0 of 4\n"
    many = Rows(faults=[f"folder {k}: no" for k in range(12)])
    shown.print_faults(many)
    assert capsys.readouterr().err.splitlines()[-1].startswith("symphys: and 2 more")
