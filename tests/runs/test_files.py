"""Files appear whole or not at all; JSON is strict and brings back what is not finite."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symphys import files

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats() | st.text(alphabet="abcäö ", max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=4),
    max_leaves=10,
)


@settings(deadline=None)
@given(VALUES)
def test_strict_json_brings_every_value_back(value: object) -> None:
    text = json.dumps(files.strict(value), allow_nan=False)
    assert repr(files.numbers(json.loads(text))) == repr(value)


def test_arrays_become_lists() -> None:
    given = {"a": np.array([[1.0, np.nan]]), "b": np.float64(np.inf), "c": (np.int64(3),)}
    assert files.strict(given) == {"a": [[1.0, "nan"]], "b": "inf", "c": [3]}


def test_what_json_does_not_know_is_refused() -> None:
    with pytest.raises(TypeError, match="complex"):
        files.strict({"a": 1j})


def test_written_text_is_read_back_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.txt"
    files.write_text(path, "Grüße\n")
    files.write_text(path, "zwei\n")
    assert files.read_text(path) == "zwei\n"
    assert [entry.name for entry in path.parent.iterdir()] == ["a.txt"]


def test_a_write_that_fails_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.txt"
    files.write_text(path, "old")

    def full(self: Path, content: bytes) -> int:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(files.FileError, match=r"cannot write .*a\.txt: no space left on device"):
        files.write_text(path, "new")
    assert path.read_text(encoding="utf-8") == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.txt"]


def test_arrays_are_read_back(tmp_path: Path) -> None:
    files.write_npz(tmp_path / "a.npz", {"x": np.arange(3.0), "names": np.array(["ball", "wall"])})
    with np.load(tmp_path / "a.npz", allow_pickle=False) as read:
        assert read["x"].tolist() == [0, 1, 2]
        assert read["names"].tolist() == ["ball", "wall"]


@pytest.mark.parametrize("content", [b"{", b"\xff\xfe", b"[" * 100_000])
def test_bad_json_is_one_error_that_names_the_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.json"
    path.write_bytes(content)
    with pytest.raises(files.FileError, match=r"bad\.json"):
        files.read_json(path)


def test_a_folder_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(files.FileError, match="cannot make the folder"):
        files.write_text(tmp_path / "file" / "below.txt", "")


def test_numbers_leave_other_text_alone() -> None:
    assert files.numbers(["-inf", "infinite", {"a": "nan"}])[:2] == [-math.inf, "infinite"]
