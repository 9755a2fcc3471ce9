"""Full disks, folders that can only be read, and clocks that are set: what is said, and what is left."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from worlds import programs

from symphys import files
from symphys.cli import main
from symphys.codegen import Cache, KernelUnavailable, compile_program
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.problem import load_problem
from symphys.report import outdated, write_run_report
from symphys.runs import Job, execute
from symphys.runs.execute import TranscriptionCache
from symphys.solvers import solver
from symphys.transcription import transcribe

Patch = pytest.MonkeyPatch
Capture = pytest.CaptureFixture[str]
FULL = "no space left on device"
REFUSED = {errno.ENOSPC: FULL, errno.EROFS: "read-only file system", errno.EACCES: "permission denied"}
ROOM = 512 * 1024
DAY = 86400.0


@pytest.fixture
def compiler() -> None:
    try:
        find_compiler()
    except KernelUnavailable as error:
        pytest.skip(str(error))


def run(job: Job) -> None:
    execute(job, lambda row: None, TranscriptionCache(transcribe))


def refusing(number: int) -> Callable[..., None]:
    def refuse(*given: object, **more: object) -> None:
        raise OSError(number, os.strerror(number))

    return refuse


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("number", REFUSED)
@pytest.mark.parametrize("call", ["write_bytes", "replace"])
def test_what_cannot_be_written_is_named_and_what_was_there_stays(
    tmp_path: Path, monkeypatch: Patch, number: int, call: str
) -> None:
    path = tmp_path / "kept.txt"
    files.write_text(path, "old")
    monkeypatch.setattr(Path, call, refusing(number))
    with pytest.raises(files.FileError, match=rf"^cannot write .*kept\.txt: {REFUSED[number]}$"):
        files.write_text(path, "new")
    assert (names(tmp_path), path.read_text("utf-8")) == (["kept.txt"], "old")


@pytest.mark.parametrize("number", REFUSED)
def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path, monkeypatch: Patch, number: int) -> None:
    monkeypatch.setattr(os, "mkdir", refusing(number))
    for make in (lambda: files.make_folder(tmp_path / "a"), lambda: files.write_text(tmp_path / "a" / "b.txt", "")):
        with pytest.raises(files.FileError, match=rf"^cannot make the folder .*a: {REFUSED[number]}$"):
            make()


def test_processes_of_one_number_on_two_machines_do_not_write_into_one_file(tmp_path: Path, monkeypatch: Patch) -> None:
    written, real = list[str](), Path.write_bytes

    def write(path: Path, content: bytes) -> int:
        written.append(path.name)
        return real(path, content)

    monkeypatch.setattr("os.getpid", lambda: 7)
    monkeypatch.setattr(Path, "write_bytes", write)
    for text in ("one", "two"):
        files.write_text(tmp_path / "index.html", text)
    assert len(set(written)) == 2
    assert names(tmp_path) == ["index.html"]


@pytest.mark.parametrize("call", ["tempfile.mkdtemp", "pathlib.Path.write_text"])
def test_without_room_for_a_kernel_casadi_evaluates_and_the_note_says_where(
    problem_file: Path, tmp_path: Path, compiler: None, monkeypatch: Patch, call: str
) -> None:
    """While its folder is made, and while its C is written."""
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(call, refusing(errno.ENOSPC))
    found = transcribe(load_problem(problem_file)).backend
    assert found.name == "casadi"
    assert FULL in found.note.lower()
    assert found.note.endswith("make room there, or set TMPDIR to another folder")


@pytest.mark.slow
def test_without_room_for_its_copy_ipopt_does_without_the_kernel(
    problem_file: Path, compiler: None, monkeypatch: Patch
) -> None:
    """All others are evaluated by it."""
    problem = load_problem(problem_file)
    whole = transcribe(problem)  # so that nothing needs to be built but what is copied
    assert whole.shooting.nlp.gradient is not None
    monkeypatch.setattr("shutil.copyfile", refusing(errno.ENOSPC))
    found = transcribe(problem)
    assert (found.backend.name, found.backend.cached) == ("simd", True)
    assert found.shooting.nlp.gradient is None
    said = found.backend.said()  # by now somebody has asked for what IPOPT takes
    assert "for ipopt casadi's virtual machine evaluates" in said
    assert "symphys-external-" in said and FULL in said.lower()
    assert (
        solver("ipopt").solve(found.shooting, found.shooting.start(0), solver("ipopt").Options()).status.value == "met"
    )


@pytest.mark.slow
def test_compiled_functions_that_cannot_be_loaded_give_way_to_casadi(
    problem_file: Path, compiler: None, monkeypatch: Patch
) -> None:
    """As where the cache lies on a disk from which nothing may be run."""

    def refuse(*given: object) -> None:
        raise RuntimeError("failed to map segment\nfrom shared object")

    monkeypatch.setattr("casadi.external", refuse)
    found = transcribe(load_problem(problem_file), backend="c").backend
    assert (found.name, found.note.count("failed to map segment from shared object")) == ("casadi", 1)


@dataclass
class SmallDisk:
    """A file system of ROOM bytes of its own."""

    path: Path

    def fill(self, left: int) -> None:
        """Leave room for so many bytes."""
        free = shutil.disk_usage(self.path).free
        (self.path / "filling").write_bytes(bytes(max(0, free - left)))

    def clear(self) -> None:
        """Make room."""
        (self.path / "filling").unlink()

    def close(self) -> None:
        """From now on it can only be read."""
        subprocess.run(["mount", "-o", "remount,ro", str(self.path)], check=True, capture_output=True)


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    place = tmp_path / "disk"
    place.mkdir()
    try:
        command = ["mount", "-t", "tmpfs", "-o", f"size={ROOM},mode=700", "tmpfs", str(place)]
        made = subprocess.run(command, check=False, capture_output=True, text=True)
    except OSError as error:
        pytest.skip(f"no mount: {error}")
    if made.returncode:
        pytest.skip(f"no disk can be mounted here: {made.stderr.strip()}")
    yield SmallDisk(place)
    subprocess.run(["umount", "-l", str(place)], check=True, capture_output=True)


def test_a_real_full_disk_keeps_the_old_file_whole(disk: SmallDisk) -> None:
    path = disk.path / "kept.txt"
    files.write_text(path, "old")
    disk.fill(0)
    with pytest.raises(files.FileError, match=rf"cannot write .*kept\.txt: {FULL}"):
        files.write_text(path, "new" * 10_000)
    assert (names(disk.path), path.read_text("utf-8")) == (["filling", "kept.txt"], "old")
    disk.clear()
    files.write_text(path, "new" * 10_000)
    assert path.read_text("utf-8") == "new" * 10_000


@pytest.mark.parametrize("left", [0, 4096, 16384])
def test_a_real_full_disk_while_a_kernel_is_compiled_is_named(
    disk: SmallDisk, tmp_path: Path, compiler: None, monkeypatch: Patch, left: int
) -> None:
    """The compiler keeps what is temporary there too, and nothing of it stays."""
    monkeypatch.setattr("tempfile.tempdir", str(disk.path))
    disk.fill(left)
    with pytest.raises(KernelUnavailable, match=rf"(?i)symphys-kernel-.*: {FULL}; make room there, or set TMPDIR"):
        compile_program(programs.pendulum(), cache=Cache(tmp_path / "cache"))
    assert names(disk.path) == ["filling"]
    assert list((tmp_path / "cache").glob("*.so")) == []


@pytest.mark.slow
def test_a_kernel_that_a_real_full_disk_does_not_keep_is_used(disk: SmallDisk, compiler: None) -> None:
    own = Cache(disk.path / "cache")
    disk.fill(4096)
    kernel = compile_program(programs.pendulum(), cache=own, threads=1)
    assert f"was not kept in {own.folder} (No space left on device)" in kernel.report.note
    assert kernel.forward([0.0] * 30, [1.0])["merit"].shape == (1, 1)
    assert names(own.folder) == []
    disk.clear()
    assert compile_program(programs.pendulum(), cache=own, threads=1).report.note == ""


@pytest.mark.slow
def test_a_cache_on_a_disk_that_can_only_be_read_is_used(
    disk: SmallDisk, compiler: None, monkeypatch: Patch, capsys: Capture
) -> None:
    own = Cache(disk.path / "cache")
    compile_program(programs.pendulum(), cache=own, threads=1)
    disk.close()
    assert compile_program(programs.pendulum(), cache=own, threads=1).report.cached
    kernel = compile_program(programs.pendulum(), lanes=1, cache=own, threads=1)
    assert "was not kept" in kernel.report.note and "Read-only file system" in kernel.report.note
    monkeypatch.setenv("SYMPHYS_CACHE", str(own.folder))
    assert main(["cache", "clear"]) == 1
    assert "1 cannot be removed" in capsys.readouterr().err
    assert main(["cache", "info"]) == 0


@pytest.mark.slow
def test_a_run_and_a_report_on_a_disk_that_can_only_be_read_say_so(
    disk: SmallDisk, make_job: Callable[..., Job], problem_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    job = make_job(does="refuse")
    run(job)
    shutil.copytree(job.folder.path, disk.path / "run")
    disk.close()
    for command in (
        ["report", str(disk.path)],
        ["solve", str(problem_file), "--solver", "told", "--unexamined", "--out", str(disk.path / "out")],
    ):
        assert main(command) in (2, 3)
        printed = capsys.readouterr()
        assert REFUSED[errno.EROFS] in printed.err + printed.out
        assert str(disk.path) in printed.err + printed.out
        assert "Traceback" not in printed.err + printed.out


def test_a_page_that_is_later_than_a_newer_result_is_made_again(make_job: Callable[..., Job]) -> None:
    """The clock was a day ahead when it was made; what a page was made from decides, not a clock."""
    job, later = make_job(does="refuse"), time.time() + DAY
    page, result = job.folder.path / "report.html", job.folder.path / "result.json"
    run(job)
    page.write_text("of an earlier result", "utf-8")
    os.utime(page, (later, later))
    assert outdated(job.folder.path)
    write_run_report(job.folder.path)
    assert not outdated(job.folder.path)
    os.utime(result, (later, later))
    assert not outdated(job.folder.path)
    files.write_text(result, result.read_text("utf-8") + "\n")
    assert outdated(job.folder.path)
