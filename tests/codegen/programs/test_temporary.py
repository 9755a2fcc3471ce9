"""Temporary folders of killed processes go with the next build; those in use stay."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest
from fakes.compilers import HANGS, building, fake
from tools.waiting import FOREVER, until, wait_for

from symphys.codegen.toolchain.temporary import LOCK, MAX_UNLOCKED_AGE, MIN_UNLOCKED_AGE, TemporaryFolder

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no files are locked there")
KIND = "symphys-kernel-"


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where temporary folders are made."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


def aged(folder: Path, seconds: float) -> Path:
    """The folder, as if it had been left alone for so long."""
    os.utime(folder, (time.time() - seconds, time.time() - seconds))
    return folder


def made(place: Path, name: str, locked: bool = False) -> Path:
    """A folder with something in it, which no process uses."""
    folder = place / f"{KIND}{name}"
    folder.mkdir()
    (folder / "part.c").write_text("int x;", "utf-8")
    if locked:
        (folder / LOCK).touch()
    return folder


def test_what_a_killed_build_left_goes_with_the_next(tmp_path: Path, place: Path) -> None:
    process = building(tmp_path, fake(tmp_path, f"echo $$ > {tmp_path}/started; {HANGS}"))
    try:
        wait_for(tmp_path / "started")
        (left,) = place.iterdir()
        aged(left, 2 * MAX_UNLOCKED_AGE)
        with TemporaryFolder(KIND):
            assert left.is_dir(), "its process is at work"
    finally:
        process.kill()
        process.communicate(timeout=FOREVER)
    aged(left, 2 * MIN_UNLOCKED_AGE)

    def only_the_next() -> bool:
        with TemporaryFolder(KIND) as own:
            return list(place.iterdir()) == [Path(own)]

    until(only_the_next)  # a compiler that is about to start holds the lock until it does
    assert list(place.iterdir()) == []


def test_what_may_be_in_use_stays(place: Path) -> None:
    new = aged(made(place, "new", locked=True), MIN_UNLOCKED_AGE / 2)
    unlocked = aged(made(place, "unlocked"), MAX_UNLOCKED_AGE / 2)
    old, other = aged(made(place, "old"), 2 * MAX_UNLOCKED_AGE), made(place, "other")
    other = aged(other.rename(place / "other-folder"), 2 * MAX_UNLOCKED_AGE)
    elsewhere = place.parent / "elsewhere"
    elsewhere.mkdir()
    (place / f"{KIND}link").symlink_to(aged(elsewhere, 2 * MAX_UNLOCKED_AGE))
    with TemporaryFolder(KIND):
        assert new.is_dir() and unlocked.is_dir() and other.is_dir() and elsewhere.is_dir()
        assert not old.exists()


def test_folders_of_one_process_do_not_remove_each_other(place: Path) -> None:
    with TemporaryFolder(KIND) as first:
        aged(Path(first), 2 * MAX_UNLOCKED_AGE)
        with TemporaryFolder("symphys-external-") as second:
            assert {Path(first), Path(second)} == set(place.iterdir())


@pytest.mark.parametrize("seconds", [2 * MAX_UNLOCKED_AGE, -2 * MAX_UNLOCKED_AGE])
def test_a_clock_that_was_set_removes_nothing_in_use_and_keeps_nothing_else(place: Path, seconds: float) -> None:
    """Forward: all that there is is old. Back: it was made at a time that is still to come."""
    left = aged(made(place, "left", locked=True), seconds)
    with TemporaryFolder(KIND) as own:
        aged(Path(own), seconds)
        with TemporaryFolder(KIND):
            assert Path(own).is_dir()
            assert not left.exists()
