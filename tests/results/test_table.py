"""The table of runs says what the folders say, whatever is kept of it; damage is named, and the rest goes on."""

from __future__ import annotations

import copy
import json
import math
import os
import shutil
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
from data.recorded_runs import record, recorded

from symphys import files
from symphys.cli.runs import lines, summary, usual_columns
from symphys.results.file_names import CONFIG, RESULT
from symphys.results.result import Result
from symphys.results.table import Journal, best, columns, ordered, read_rows
from symphys.results.table import rows as table_rows
from symphys.results.table.journal import BODY_START, LINE_PREFIX, Kept, entry, stamp_of
from symphys.results.table.row import read_row
from symphys.results.table.writing import csv_text, json_lines
from symphys.results.text_files import LARGE_FIELDS


def test_a_row_has_what_the_files_say(tmp_path: Path) -> None:
    record(tmp_path, recorded(seed=3, verdict="not_solved"), ground__friction=0.6)
    (row,) = read_rows(tmp_path).rows
    assert row == {
        "run": "throw@ground.friction=0.6/gradient-seed3",
        "problem": "throw",
        "case": "throw@ground.friction=0.6",
        "solver": "gradient",
        "seed": 3,
        "ground.friction": 0.6,
        "verdict": "not_solved",
        "status": "budget",
        "solved": False,
        "objective": 0.5,
        "worst": 0.5,
        "output: speed [m/s]": 3.0,
        "cost: effort": 0.25,
        "iterations": 7,
        "equivalents": 30.5,
        "solve_seconds": 0.3,
        "compile_seconds": 0.2,
        "build_seconds": 0.1,
        "peak_memory": 2**30,
        "host": "here",
        "when": "2026-11-23T22:00:00+00:00",
        "why": "try more iterations",
    }


def test_only_the_heavy_tables_are_cut_and_only_from_the_usual_layouts(tmp_path: Path) -> None:
    """A key a line, as files have it now, and lines for nested values too, as older ones."""
    whole = files.strict(recorded(advice='},\n "z": {\n').to_json())
    files.write_json(tmp_path / RESULT, whole)
    for text in ((tmp_path / RESULT).read_bytes(), json.dumps(whole, indent=1).encode()):
        cut = files.emptied(text, LARGE_FIELDS)
        assert json.loads(cut) == {**whole, "z": {}, "trust": {}} and len(cut) < len(text)
    for layout in (None, 0, 2):
        text = json.dumps(whole, indent=layout).encode()
        assert files.emptied(text, LARGE_FIELDS) == text
    files.write_json(tmp_path / RESULT, {"z": None, "trust": {}})
    absent = (tmp_path / RESULT).read_bytes()
    assert files.emptied(absent, LARGE_FIELDS) == absent
    assert files.emptied(b'{\n "trust": {"a": 1', LARGE_FIELDS) == b'{\n "trust": {"a": 1'


def test_a_file_older_than_verdicts_is_ruled_on(tmp_path: Path) -> None:
    folder = record(tmp_path, recorded(trust={"deepest": 0.2, "size": 0.1}))
    value = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    del value["verdict"], value["doubts"]
    files.write_json(folder / RESULT, value)
    row = read_row(folder)
    assert (row["verdict"], row["solved"]) == ("doubted", False) and row["why"]


def doctored(row: dict[str, Any], objective: float) -> dict[str, Any]:
    return {**{key: value for key, value in row.items() if key != "run"}, "objective": objective}


def test_a_kept_row_counts_as_long_as_its_file_is_the_same(tmp_path: Path) -> None:
    folder = record(tmp_path)
    place = folder.relative_to(tmp_path).as_posix()
    row = doctored(read_rows(tmp_path).rows[0], objective=77.0)
    status = (folder / RESULT).stat()
    Journal(tmp_path).append({place: Kept(stamp_of(status), row)})
    found = read_rows(tmp_path)
    assert (found.rows[0]["objective"], found.read) == (77.0, 0)
    os.utime(folder / RESULT, ns=(status.st_atime_ns, status.st_mtime_ns + 1))
    found = read_rows(tmp_path)
    assert (found.rows[0]["objective"], found.read) == (0.5, 1)
    assert read_rows(tmp_path).read == 0, "what was read is kept"
    shutil.rmtree(folder)
    assert read_rows(tmp_path).rows == []


def test_numbers_survive_the_journal(tmp_path: Path) -> None:
    folder = record(tmp_path, recorded(objective=math.inf, outputs={"speed [m/s]": math.nan}), text__kind="inf")
    fresh = read_rows(tmp_path).rows
    Journal(tmp_path).add(folder)
    kept = read_rows(tmp_path)
    assert kept.read == 0 and kept.rows == fresh
    assert kept.rows[0]["objective"] == math.inf and kept.rows[0]["text.kind"] == "inf"
    assert "output: speed [m/s]" not in kept.rows[0]


@pytest.mark.parametrize(
    "damage",
    [
        lambda line: line[: len(line) // 2],
        lambda line: line[: len(line) // 2] + b"\n",
        lambda line: line.replace(b'"objective":0.5', b'"objective":0.6'),
        lambda line: b"\0" * len(line) + b"\n",
        lambda line: b"not a line\n" + line[:-3] + b"\n",
    ],
)
def test_damaged_lines_are_skipped_and_the_others_count(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    """A line that a torn one was glued to is found, too."""
    folders = [record(tmp_path, recorded(seed=seed)) for seed in range(3)]
    for folder in folders:
        Journal(tmp_path).add(folder)
    lines = Journal(tmp_path).path.read_bytes().splitlines(keepends=True)
    Journal(tmp_path).path.write_bytes(lines[0] + damage(lines[1]) + lines[2])
    found = read_rows(tmp_path)
    assert found.read == 1
    assert [row["objective"] for row in found.rows] == [0.5, 0.5, 0.5]


def test_lines_of_another_format_are_skipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Journal(tmp_path).add(record(tmp_path))
    (line,) = Journal(tmp_path).path.read_bytes().splitlines()
    assert len(list(entry(line))) == 1
    monkeypatch.setattr("symphys.results.table.journal.ROW_FORMAT", 2)
    assert list(entry(line)) == []


def test_many_append_at_once_and_no_line_is_lost(tmp_path: Path) -> None:
    row = doctored(read_row(record(tmp_path)), 1.0) | {"why": "x" * 5000}

    def append(writer: int) -> None:
        for number in range(50):
            assert Journal(tmp_path).append({f"{writer}-{number}": Kept((1, 2), row)})

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(append, range(8)))
    kept, lines = Journal(tmp_path).read()
    assert len(kept) == lines == 400


NUMBER = [0, -1, 3.5, True, None, "x", "nan", "inf", [], {}, [1], 10**400, 1e308, "\ud800", "", {"a": []}]


def mutated(value: Any, random: Random) -> Any:
    """A value of JSON with a change somewhere."""
    inside = list(value) if isinstance(value, dict) else list(range(len(value))) if isinstance(value, list) else []
    if not inside or random.random() < 0.2:
        return random.choice(NUMBER)
    found, key = copy.copy(value), random.choice(inside)
    change = random.randrange(4)
    if change == 0:
        del found[key]
    elif change == 1 and isinstance(found, dict):
        found[random.choice(["run", "fault", "solved", "seed", "verdict", "\n", "output: x"])] = random.choice(NUMBER)
    else:
        found[key] = mutated(found[key], random)
    return found


@pytest.mark.slow
def test_what_is_odd_in_a_journal_is_read_from_the_folders(tmp_path: Path) -> None:
    """Lines with a right checksum and other content: a column is right by its type, or all is as the folder says."""
    folder = record(tmp_path, ground__friction=0.6, text__kind="inf")
    truth = read_rows(tmp_path).rows
    Journal(tmp_path).add(folder)
    (line,) = Journal(tmp_path).path.read_bytes().splitlines()
    content = json.loads(b"{" + line[BODY_START:])
    random, read = Random(0), 0
    for _ in range(1000):
        changed = mutated(content, random)
        body = json.dumps(changed).encode()[1:]
        if random.random() < 0.1:
            cut = random.randrange(len(body) + 1)
            body = body[:cut] + random.randbytes(random.randint(0, 2)).replace(b"\n", b"") + body[cut + 1 :]
        Journal(tmp_path).path.write_bytes(LINE_PREFIX + b'%08x",' % zlib.crc32(body) + body + b"\n")
        found = read_rows(tmp_path)
        (row,) = found.rows
        read += found.read
        if found.read:
            assert found.rows == truth
        assert {key: type(row.get(key)) for key in ("run", "case", "solver", "verdict", "solved")} == {
            **dict.fromkeys(("run", "case", "solver", "verdict"), str),
            "solved": bool,
        }
        for key in ("objective", "-seed", "why", "host"):
            assert ordered(found.rows, key) == best(found.rows, key) == found.rows
        csv_text(found.rows, columns(found.rows)).encode()
        assert json.loads("".join(json_lines(found.rows, columns(found.rows))))
        assert list(lines(found.rows, usual_columns(found.rows))) and summary(found.rows)
    assert read > 500, "most changes are odd"


def test_a_journal_above_and_those_below_are_used(tmp_path: Path) -> None:
    """Of a folder of runs, of a case in it, of one run, and of a folder of several such folders."""
    for out in ("a", "b"):
        Journal(tmp_path / out).add(record(tmp_path / out))
    case = tmp_path / "a" / "throw"
    for root, places in {
        tmp_path / "a": ["throw/gradient-seed0"],
        case: ["gradient-seed0"],
        case / "gradient-seed0": ["."],
        tmp_path: ["a/throw/gradient-seed0", "b/throw/gradient-seed0"],
    }.items():
        found = read_rows(root)
        assert ([row["run"] for row in found.rows], found.read) == (places, 0)
    assert not (case / ".runs.jsonl").exists()


def test_a_journal_is_begun_where_many_folders_were_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record(tmp_path)
    assert read_rows(tmp_path).read == read_rows(tmp_path).read == 1
    assert not Journal(tmp_path).path.exists()
    monkeypatch.setattr(table_rows, "MIN_UNKEPT", 1)
    assert (read_rows(tmp_path).read, read_rows(tmp_path).read) == (1, 0)


def test_without_a_place_for_the_journal_all_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a folder that is read-only: what is kept cannot be written, or read."""
    monkeypatch.setattr(table_rows, "MIN_UNKEPT", 1)
    folder = record(tmp_path)
    Journal(tmp_path).path.mkdir()
    Journal(tmp_path).add(folder)
    assert [read_rows(tmp_path).read for _ in range(2)] == [1, 1]
    assert read_rows(tmp_path).rows[0]["objective"] == 0.5
    assert sorted(path.name for path in tmp_path.iterdir()) == [".runs.jsonl", "throw"]


def test_a_journal_full_of_old_lines_is_written_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_rows, "MIN_UNKEPT", 1)
    folder = record(tmp_path)
    for _ in range(5):
        Journal(tmp_path).add(folder)
    read_rows(tmp_path)
    assert Journal(tmp_path).read()[1] == 1 and read_rows(tmp_path).read == 0


def cut_short(path: Path) -> None:
    path.write_text(path.read_text(encoding="utf-8")[:-20], encoding="utf-8")


@pytest.mark.parametrize(
    ("damage", "verdict", "why"),
    [
        (cut_short, "unreadable", "result.json: not valid JSON, perhaps half written"),
        (lambda path: path.write_bytes(b"\xff\xfe\x00"), "unreadable", "result.json: not valid JSON"),
        (lambda path: path.write_text("[1]"), "unreadable", "result.json: a JSON object is expected"),
        (lambda path: path.write_text("{}"), "unreadable", "result.json: not a result of symphys"),
        (lambda path: (path.unlink(), path.mkdir()), "unreadable", "result.json: "),
        (lambda path: (path.unlink(), os.mkfifo(path)), "unreadable", "result.json: this is a named pipe"),
        (lambda path: (path.unlink(), path.symlink_to("nowhere")), "unfinished", "no result yet"),
        (lambda path: path.unlink(), "unfinished", "no result yet"),
    ],
)
def test_damage_is_named_and_the_other_runs_are_there(
    tmp_path: Path, damage: Callable[[Path], None], verdict: str, why: str
) -> None:
    damage(record(tmp_path, recorded(seed=1)) / RESULT)
    record(tmp_path, recorded(seed=2))
    for _ in range(2):
        bad, good = read_rows(tmp_path).rows
        assert (bad["run"], bad["solver"], bad["seed"], bad["verdict"]) == (
            "throw/gradient-seed1",
            "gradient",
            1,
            verdict,
        )
        assert bad["why"].startswith(why) and ("fault" in bad) is (verdict == "unreadable")
        assert good["verdict"] == "solved"


def test_a_result_whose_configuration_is_damaged_is_there_with_the_fault(tmp_path: Path) -> None:
    """Until it is mended."""
    folder = record(tmp_path, recorded(), ground__friction=0.5)
    whole = (folder / CONFIG).read_bytes()
    (folder / CONFIG).write_text("{", encoding="utf-8")
    Journal(tmp_path).add(folder)
    for _ in range(2):
        (row,) = read_rows(tmp_path).rows
        assert row["verdict"] == "solved" and row["fault"].startswith("config.json: not valid JSON")
        assert "ground.friction" not in row
    (folder / CONFIG).write_bytes(whole)
    assert read_rows(tmp_path).rows[0]["ground.friction"] == 0.5


def test_values_of_any_kind_are_read(tmp_path: Path) -> None:
    """Whoever wrote them."""
    folder = record(tmp_path)
    value = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    for key in ("objective", "outputs", "costs", "checks", "seconds", "provenance", "backend", "when", "doubts"):
        for other in (None, [], {"a": {"b": 1}}, "text", True, 10**400, [[1]]):
            files.write_text(folder / RESULT, json.dumps({**value, key: other}, indent=1))
            row = read_row(folder)
            assert row["verdict"] == "solved" and isinstance(row.get("objective", 0.0), int | float)
            json.dumps(row)


def test_a_run_that_failed_says_why(tmp_path: Path) -> None:
    failed = Result("throw", "A throw", "gradient", 0, False, "failed", "no memory", absent=frozenset(["objective"]))
    record(tmp_path, replace(failed, verdict="not_solved"))
    (row,) = read_rows(tmp_path).rows
    assert (row["status"], row["why"]) == ("failed", "no memory") and "objective" not in row


def test_no_such_folder_is_said(tmp_path: Path) -> None:
    with pytest.raises(files.FileError, match="no such folder"):
        read_rows(tmp_path / "nothing")
