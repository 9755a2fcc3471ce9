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
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from symphys.files import FileError
from symphys.runs import claim as claims
from symphys.runs.claim import FolderBusy, Owner, claimed, numbers, owner, path_of, read_owner, take

ELSEWHERE = Owner("far", "another boot", 4711, "1", "token")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.fixture
def process() -> Iterator[subprocess.Popen[bytes]]:
    """A process of this machine that does nothing."""
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as started:
        yield started
        started.kill()


def leave(folder: Path, held: Owner, number: int = 0) -> Path:
    """Write a claim of another process."""
    folder.mkdir(parents=True, exist_ok=True)
    path_of(folder, number).symlink_to(json.dumps(asdict(held)))
    return path_of(folder, number)


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
        assert (claim.number, claim.held) == (1, True)
    assert list(folder.iterdir()) == []


def test_a_zombie_holds_nothing(folder: Path) -> None:
    """A worker that was killed is one until its parent asks how it ended."""
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    leave(folder, of_process(process.pid))
    process.kill()
    while claims.beginning(process.pid) != "over":
        time.sleep(0.01)
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
        os.utime(path, (stamp + beat, stamp + beat), follow_symlinks=False)
        with pytest.raises(FolderBusy, match="process 4711 on far"):
            take(folder)
        now[0] += claims.LEASE - 1
    with pytest.raises(FolderBusy):
        take(folder)
    now[0] += 2
    assert take(folder).number == 1


def test_a_claim_without_an_owner_is_waited_for(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On file systems without links a claim is empty for an instant; one that stays so is over."""
    folder.mkdir()
    path_of(folder, 0).write_bytes(b"")
    with pytest.raises(FolderBusy, match="another process"):
        take(folder)
    monkeypatch.setattr(claims, "LEASE", -1.0)
    assert take(folder).number == 1


def test_what_was_taken_over_is_not_held_any_more(folder: Path) -> None:
    """As by a process that slept longer than its lease: it must not write its result."""
    with claimed(folder) as slept:
        leave(folder, replace(ELSEWHERE, after="another claim"), slept.number + 1)
        assert slept.held, "a claim that is about to be withdrawn takes nothing over"
        path_of(folder, 1).unlink()
        leave(folder, replace(ELSEWHERE, after=slept.owner.token), slept.number + 1)
        assert not slept.held
        with pytest.raises(FolderBusy, match="taken over"):
            slept.check()
    assert read_owner(path_of(folder, 1)).token == ELSEWHERE.token


def test_a_held_claim_is_touched(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claims, "BEAT", 0.01)
    monkeypatch.setattr(claims, "HEART", claims.Heart())
    with claimed(folder) as claim:
        os.utime(claim.path, (1, 1), follow_symlinks=False)
        end = time.monotonic() + 5
        while claim.path.lstat().st_mtime == 1 and time.monotonic() < end:
            time.sleep(0.01)
        assert claim.path.lstat().st_mtime > 1


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
    found = [json.loads(each.communicate(timeout=60)[0]) for each in started]
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
        for number in numbers(folder):
            path_of(folder, number).unlink()


def test_a_claim_that_was_made_by_an_older_view_is_withdrawn(folder: Path) -> None:
    """Somebody saw a dead claim 0; before he made claim 1, all of it was over, and another has claim 0 now."""
    leave(folder, ELSEWHERE)
    late = claims.Claim(folder, 1, claims.myself(after="a dead claim"))
    assert claims.create(late) and not claims.settled(late, 0)
    assert numbers(folder) == [0]
    late = claims.Claim(folder, 1, claims.myself(after=ELSEWHERE.token))
    assert claims.create(late) and claims.settled(late, 0)
    assert numbers(folder) == [1]
    later = claims.Claim(folder, 0, claims.myself())
    assert claims.create(later) and not claims.settled(later)
    assert numbers(folder) == [1]


def test_where_there_are_no_links_claims_work_too(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError("no links here")

    monkeypatch.setattr(Path, "symlink_to", refuse)
    with claimed(folder) as claim:
        assert claim.held
        with pytest.raises(FolderBusy):
            take(folder)


def test_a_folder_that_cannot_be_written_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    claims.myself()

    def full(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "symlink_to", full)
    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(FileError, match=r"cannot write .*run/\.claim-0: no space left on device"):
        take(folder)
