"""Nothing that somebody else wrote is overwritten, and what was interrupted can be done again."""

from __future__ import annotations

from pathlib import Path

import pytest

from symphys import files
from symphys.export import ExportError, write_folders
from symphys.export.folder import LIST_FILE

CONTENT = {"a.c": b"one", "b.c": b"two"}


def test_what_was_written_can_be_written_again(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    assert write_folders({folder: CONTENT}) == [folder / "a.c", folder / "b.c"]
    write_folders({folder: {"a.c": b"three"}})
    assert (folder / "a.c").read_bytes() == b"three"
    write_folders({folder: CONTENT})
    assert (folder / "a.c").read_bytes() == b"one"
    assert {path.name for path in folder.iterdir()} == {"a.c", "b.c", LIST_FILE}


@pytest.mark.parametrize("kind", ["foreign", "changed", "folder", "link"])
def test_what_is_not_ours_stays_and_nothing_is_written(tmp_path: Path, kind: str) -> None:
    target, other = tmp_path / "here" / "b.c", tmp_path / "other"
    target.parent.mkdir()
    other.write_bytes(b"theirs")
    if kind == "changed":
        write_folders({tmp_path / "here": {"b.c": b"old"}})
        target.write_bytes(b"theirs")
    elif kind == "foreign":
        target.write_bytes(b"theirs")
    elif kind == "folder":
        target.mkdir()
    else:
        target.symlink_to(other)
    with pytest.raises(ExportError, match=r"b\.c"):
        write_folders({tmp_path / "first": CONTENT, tmp_path / "here": CONTENT})
    assert not (tmp_path / "first").exists()
    assert not (tmp_path / "here" / "a.c").exists()
    assert kind == "folder" or target.read_bytes() == b"theirs"


def test_an_interrupted_export_can_be_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_folders({tmp_path: CONTENT})
    write = files.write_bytes

    def stop_at_b(path: Path, content: bytes, at_once: bool = True) -> None:
        if path.name == "b.c":
            raise KeyboardInterrupt
        write(path, content)

    new = {"a.c": b"new", "b.c": b"newer"}
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(files, "write_bytes", stop_at_b)
        write_folders({tmp_path: new})
    write_folders({tmp_path: CONTENT})
    write_folders({tmp_path: new})
    assert (tmp_path / "b.c").read_bytes() == b"newer"


def test_a_list_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / LIST_FILE).write_text("[1]", "utf-8")
    with pytest.raises(ExportError, match="exported files"):
        write_folders({tmp_path: CONTENT})
    (tmp_path / LIST_FILE).write_text("{", "utf-8")
    with pytest.raises(files.FileError, match="JSON"):
        write_folders({tmp_path: CONTENT})
