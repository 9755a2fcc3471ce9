"""Files that are no problem files: one clear message each."""

from __future__ import annotations

from pathlib import Path

import pytest

from symphys.errors import ProblemError
from symphys.problem import load_problem


def message(path: Path) -> str:
    with pytest.raises(ProblemError) as caught:
        load_problem(path)
    text = str(caught.value)
    assert text.startswith(str(path))
    assert len(text) < 2000
    return text


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "the file is empty"),
        (b" \n\t\n", "the file is empty"),
        (b"\xff\xfe\x00\x01" * 100, "not UTF-8 text (line 1)"),
        (b"title = 'a'\n\x80", "not UTF-8 text (line 2)"),
        (bytes(range(128)), "not valid TOML"),
        (b"\x7fELF\x00\x00", "not valid TOML"),
        (b"just some words", "not valid TOML"),
        (b"[simulation]\ndt = \n", "(at line 2, column 6)"),
        (b"dt = 0.01\ndt = 0.02\n", "not valid TOML"),
        (b'{"json": true}', "not valid TOML"),
        (b"a = " + b"9" * 5000, "not valid TOML"),
        (b"a = " + b"[" * 1_000_000, "nested too deep"),
        (b"[" * 1_000_000, "not valid TOML"),
        (b"a = " + b"{a=" * 100_000, "nested too deep"),
        (b"a = " + b"[" * 100 + b"]" * 100, "unknown key; "),
        (b".".join([b"a"] * 1_000_000) + b" = 1", "line 1: a name with more than 20 dots"),
        (b"\n[" + b" . ".join([b'"a"'] * 1_000_000) + b"]", "line 2: a name with more than 20 dots"),
        (b"a" * 9_000_000, "not valid TOML"),
        (b"#" * 10_000_001, "larger than 10 MB"),
        (b"a = 1\n", "simulation: this key is required"),
        (b"a = 1\n", "a: unknown key"),
    ],
)
def test_content(tmp_path: Path, content: bytes, expected: str) -> None:
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    assert expected in message(path)


def test_missing(tmp_path: Path) -> None:
    assert "there is no such file" in message(tmp_path / "absent.toml")


def test_folder(tmp_path: Path) -> None:
    assert "this is a folder" in message(tmp_path)


def test_name_too_long_for_the_system(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="File name too long"):
        load_problem(tmp_path / ("a" * 5000))


def test_name_with_a_null_byte(tmp_path: Path) -> None:
    assert "no such file" in message(tmp_path / "a\x00b") or "no valid path" in message(tmp_path / "a\x00b")


@pytest.mark.slow
def test_many_tables_are_refused(tmp_path: Path, valid: str) -> None:
    body = '[[body]]\nname = "b{}"\nmass = 1\nshape = {{ sphere = {{ radius = 1 }} }}\n'
    path = tmp_path / "crowd.toml"
    path.write_text(valid + "".join(body.format(i) for i in range(3000)))
    assert "points of contact in every step are too many" in message(path)
