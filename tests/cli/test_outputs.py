"""Outputs that nobody reads, and names of files that are no UTF-8: an exit code and no traceback."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import pytest

from symphys.cli import main

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="pipes, and names of any bytes")


def unread() -> io.TextIOWrapper:
    """An output whose reader has gone."""
    there, here = os.pipe()
    os.close(there)
    return io.TextIOWrapper(io.FileIO(here, "w"), encoding="utf-8")


@pytest.mark.parametrize("command", ["schema", "--help"])
def test_an_output_that_nobody_reads(monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    stream = unread()
    monkeypatch.setattr("sys.stdout", stream)
    assert main([command]) == 141
    assert sys.stdout is stream
    stream.close()  # as at exit: what was printed goes nowhere


def test_an_error_that_nobody_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = unread()
    monkeypatch.setattr("sys.stderr", stream)
    assert main(["solf"]) == 141
    stream.close()


def test_an_output_that_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdout", None)
    assert main(["schema"]) == 0
    assert sys.stdout is None


def test_names_that_are_no_text(throw: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    printed = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(printed, encoding="utf-8"))
    monkeypatch.chdir(tmp_path)
    named = throw.rename(os.fsdecode(b"bad\xff.toml"))
    out = os.fsdecode(b"out\xff")
    quick = ["--solver", "least_squares", "--backend", "casadi", "--unexamined"]
    assert main(["solve", str(named), "--out", out, *quick]) == 0
    assert printed.getvalue().decode().endswith("/out%FF/index.html\n")
    config = Path(out) / "bad\ufffd" / "least_squares-seed0" / "config.json"
    assert "bad\ufffd" in config.read_text("utf-8")
    assert main(["new", os.fsdecode(b"new\xff.toml")]) == 0
    assert "new?.toml: try" in printed.getvalue().decode()
    assert Path(os.fsdecode(b"new\xff.toml")).is_file()


def test_messages_that_a_full_disk_does_not_take_end_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr("sys.stderr", full)
        assert main(["solf"]) == 2
        assert sys.stderr is full
