"""A run folder belongs to one process at a time; what a dead process held is taken up by exactly one other."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from tools.waiting import FOREVER, until

from symphys.files import FileError
from symphys.runs import claim as claims
from symphys.runs.claim import Claim, FolderBusy, Owner, claimed, occupied, owner, take

ELSEWHERE = Owner("far", "another boot", 4711, "1", "token")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.fixture
def process() -> Iterator[subprocess.Popen[bytes]]:
    """A process of this machine that does nothing."""
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1800)"]) as started:
        yield started
        started.kill()


def leave(folder: Path, held: Owner) -> Path:
    """Write a claim of another process."""
    folder.mkdir(parents=True, exist_ok=True)
    claim = Claim(folder, held)
    assert claim.enter()
    return claim.path


def of_process(number: int) -> Owner:
    """The owner that a process of this machine is."""
    return Owner("here", claims.machine(), number, claims.beginning(number), "token")


def test_a_claimed_folder_lets_nobody_in_until_it_is_released(folder: Path) -> None:
    with claimed(folder) as claim:
        assert claim.held
        with pytest.raises(FolderBusy, match=f"process {os.getpid()} on"), claimed(folder):
            pytest.fail("two are in")
    assert list(folder.iterdir()) == []
    with claimed(folder):
        pass


def test_a_claim_is_released_where_the_work_fails(folder: Path) -> None:
    with pytest.raises(ZeroDivisionError), claimed(folder):
        _ = 1 / 0
    assert list(folder.iterdir()) == []


def test_the_claim_of_a_living_process_is_respected_and_that_of_a_dead_one_is_not(
    folder: Path, process: subprocess.Popen[bytes]
) -> None:
    leave(folder, of_process(process.pid))
    with pytest.raises(FolderBusy, match=f"process {process.pid} on here"):
        take(folder)
    assert owner(folder) is not None
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert owner(folder) is None
    with claimed(folder) as claim:
        assert claim.held
    assert list(folder.iterdir()) == []


def test_a_zombie_holds_nothing(folder: Path) -> None:
    """A worker that was killed is one until its parent asks how it ended."""
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1800)"])
    leave(folder, of_process(process.pid))
    process.kill()
    until(lambda: claims.beginning(process.pid) == "over")
    with claimed(folder) as claim:
        assert claim.held
    process.wait()


def test_the_number_of_a_dead_process_that_another_has_now_holds_nothing(
    folder: Path, process: subprocess.Popen[bytes]
) -> None:
    leave(folder, replace(of_process(process.pid), begun="1"))
    with claimed(folder) as claim:
        assert claim.held


@pytest.mark.parametrize("day", [-86400, 0, 86400])
def test_a_claim_of_another_machine_is_over_once_nobody_touches_it_whatever_its_clock_says(
    folder: Path, monkeypatch: pytest.MonkeyPatch, day: int
) -> None:
    """How long it was not touched is measured here: its time stamp is compared with itself only."""
    now = [1000.0]
    monkeypatch.setattr(claims.time, "monotonic", lambda: now[0])
    path = leave(folder, ELSEWHERE)
    stamp = time.time() + day
    for beat in range(3):
        os.utime(path, (stamp + beat, stamp + beat))
        with pytest.raises(FolderBusy, match="process 4711 on far"):
            take(folder)
        now[0] += claims.LEASE - 1
    with pytest.raises(FolderBusy):
        take(folder)
    now[0] += 2
    assert take(folder).held


@pytest.mark.parametrize("kind", ["folder", "file"])
def test_what_names_no_owner_is_waited_for_and_then_put_away(
    folder: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    (folder / ".claim").mkdir(parents=True)
    odd = folder / ".claim" / "odd"
    odd.mkdir() if kind == "folder" else odd.write_bytes(b"")
    with pytest.raises(FolderBusy, match="another process"):
        take(folder)
    monkeypatch.setattr(claims, "LEASE", -1.0)
    take(folder).release()
    assert list(folder.iterdir()) == []


def test_who_was_taken_over_can_publish_nothing_and_ends_no_claim_but_its_own(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a process that slept longer than its lease, and whose successor is over, too, and followed by a third."""
    monkeypatch.setattr(claims.Owner, "here", False)
    monkeypatch.setattr(claims, "LEASE", -1.0)
    slept, after = take_late(folder), take_late(folder)
    assert not slept.held and after.held
    with pytest.raises(FolderBusy, match="taken over"):
        slept.check()
    with pytest.raises(FolderBusy, match="taken over"):
        slept.publish("result.json", b"mine")
    after.release()
    third = take_late(folder)
    slept.touch()
    slept.release()
    assert third.held and not (folder / "result.json").exists()
    third.publish("result.json", b"third")
    assert (folder / "result.json").read_bytes() == b"third"


def take_late(folder: Path) -> Claim:
    """Claim a folder; what is there was looked at before, and not touched since."""
    for path in occupied(folder):
        claims.is_over(path, Owner())
    return take(folder)


def test_what_killed_processes_leave_of_claims_is_removed(folder: Path) -> None:
    for name in (".claim-abc/abc", ".claim-def.over"):
        (folder / name).mkdir(parents=True)
        (folder / name / "owner").write_text("{}", "utf-8")
    (folder / ".claim-0").symlink_to("{}")
    with claimed(folder) as claim:
        claims.clear(folder, claim)
        assert [path.name for path in folder.iterdir()] == [".claim"]


def test_a_held_claim_is_touched(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claims, "TOUCH_INTERVAL", 0.01)
    monkeypatch.setattr(claims, "HEART", claims.Heart())
    with claimed(folder) as claim:
        os.utime(claim.path, (1, 1))
        until(lambda: claim.path.lstat().st_mtime > 1)


HOLD = """
import json, sys, time
from pathlib import Path
from symphys.runs.claim import FolderBusy, claimed
folder, seen = Path(sys.argv[1]), {"in": 0, "busy": 0, "both": 0}
mark = folder.with_name("inside")
while seen["in"] < 25:
    try:
        with claimed(folder):
            with mark.open("xb"):
                time.sleep(0.0005)
            mark.unlink()
            seen["in"] += 1
    except FolderBusy:
        seen["busy"] += 1
    except FileExistsError:
        seen["both"] += 1
print(json.dumps(seen))
"""
"""Gets in as often as that, and counts how often somebody else was there, by a file that only one may make."""


def test_of_many_processes_one_is_in_at_a_time(folder: Path) -> None:
    command = [sys.executable, "-c", HOLD, str(folder)]
    started = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    found = [json.loads(each.communicate(timeout=FOREVER)[0]) for each in started]
    assert [each["in"] for each in found] == [25] * 3
    assert sum(each["both"] for each in found) == 0


def test_of_many_who_take_over_one_succeeds(folder: Path) -> None:
    """All have seen the same dead claim."""
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    for turn in range(20):
        leave(folder, of_process(dead.pid))
        together = threading.Barrier(4)

        def get(together: threading.Barrier = together) -> bool:
            together.wait()
            try:
                take(folder)
            except FolderBusy:
                return False
            return True

        with ThreadPoolExecutor(4) as pool:
            won = [each.result() for each in [pool.submit(get) for _ in range(4)]]
        assert sum(won) == 1, turn
        for path in occupied(folder):
            claims.evict(path)


def test_a_folder_that_cannot_be_written_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    folder.mkdir()
    monkeypatch.setattr(Path, "mkdir", full)
    monkeypatch.setattr(claims.files, "make_folder", lambda path: None)
    with pytest.raises(FileError, match=r"cannot write .*run/\.claim: no space left on device"):
        take(folder)
