"""Kernels are kept and found again; a cache that fails is done without."""

from __future__ import annotations

import errno
import os
import shutil
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from fakes.compilers import HANGS, building, fake, logged, waits
from tools.waiting import FOREVER, until, wait_for
from worlds import programs

from symphys.codegen import Cache, Kernel, KernelUnavailable, compile_program, default_cache
from symphys.codegen.toolchain.cache import LOCK_TIMEOUT
from symphys.codegen.toolchain.compiler import find_compiler

Patch = pytest.MonkeyPatch
UNIX = pytest.mark.skipif(sys.platform == "win32", reason="the fake compilers are shell scripts")
LINUX = pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="nothing says which files a process has opened")


@UNIX
def test_a_builder_that_is_killed_holds_up_nobody(tmp_path: Path) -> None:
    process = building(tmp_path, fake(tmp_path, f"echo $$ > {tmp_path}/started; {HANGS}"))
    wait_for(tmp_path / "started")
    process.kill()
    process.communicate(timeout=FOREVER)
    kernel = compile_program(programs.pendulum(), cache=Cache(tmp_path / "cache"), threads=1)
    assert not kernel.report.cached
    assert compile_program(kernel.program, cache=Cache(tmp_path / "cache")).report.cached


def test_the_second_time_it_comes_from_the_cache(chain: Kernel, cache: Cache, monkeypatch: Patch) -> None:
    monkeypatch.setattr("symphys.codegen.toolchain.compiler.run_all", pytest.fail)
    assert compile_program(chain.program, cache=cache).report.cached


def test_time_and_sweeps_are_data(chain: Kernel, cache: Cache, monkeypatch: Patch) -> None:
    monkeypatch.setattr(programs, "SWEEPS", 7)
    assert compile_program(programs.chain(), cache=cache).report.cached


def test_the_key_holds_flags_and_lanes(pendulum: Kernel, cache: Cache, monkeypatch: Patch) -> None:
    before = cache.info().kernels
    assert compile_program(pendulum.program, cache=cache, threads=1).report.cached
    monkeypatch.setattr("symphys.codegen.toolchain.compiler.FLAGS", ("-O1", "-fPIC"))
    assert not compile_program(pendulum.program, cache=cache, threads=1).report.cached
    assert cache.info().kernels == before + 1


def test_a_damaged_kernel_is_built_again(pendulum: Kernel, cache: Cache, tmp_path: Path) -> None:
    own = Cache(tmp_path)
    shutil.copytree(cache.folder, own.folder, dirs_exist_ok=True)
    for path in own.folder.glob("*.so"):
        os.truncate(path, path.stat().st_size // 2)
    rebuilt = compile_program(pendulum.program, cache=own, threads=1)
    assert not rebuilt.report.cached
    assert rebuilt.forward([0.0] * 30, [1.0])["merit"].shape == (1, 1)
    assert compile_program(pendulum.program, cache=own, threads=1).report.cached


def test_a_folder_that_cannot_be_written(pendulum: Kernel, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way", "utf-8")
    kernel = compile_program(pendulum.program, cache=Cache(blocked / "cache"))
    assert not kernel.report.cached
    assert "was not kept" in kernel.report.note
    kernel.forward([0.0] * 30, [1.0])


def test_a_full_disk(pendulum: Kernel, tmp_path: Path, monkeypatch: Patch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("shutil.copyfile", full)
    kernel = compile_program(pendulum.program, cache=Cache(tmp_path))
    assert "No space left" in kernel.report.note
    kernel.forward([0.0] * 30, [1.0])
    assert [path for path in tmp_path.iterdir() if path.name.startswith(".new")] == []


@UNIX
def test_a_disk_that_becomes_full_while_a_kernel_is_kept(tmp_path: Path) -> None:
    import resource

    built = tmp_path / "built"
    built.write_bytes(bytes(100_000))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            Cache(tmp_path / "cache").store("key", built)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_cache_that_can_only_be_read_is_used(pendulum: Kernel, cache: Cache, monkeypatch: Patch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    for name in ("os.utime", "pathlib.Path.mkdir", "pathlib.Path.unlink"):
        monkeypatch.setattr(name, refuse)
    monkeypatch.setattr("symphys.codegen.toolchain.cache.tempfile.mkstemp", refuse)
    assert compile_program(pendulum.program, cache=cache, threads=1).report.cached
    kernel = compile_program(pendulum.program, lanes=1, cache=cache, threads=1, seeded=["merit"])
    assert "was not kept" in kernel.report.note
    assert "Read-only file system" in kernel.report.note
    kernel.forward([0.0] * 30, [1.0])


def test_what_killed_processes_left_is_swept(tmp_path: Path) -> None:
    built, own = tmp_path / "built", Cache(tmp_path / "cache")
    built.write_bytes(b"1")
    own.store("a", built)
    old, new = own.folder / ".new-old", own.folder / ".new-new"
    for path, age in ((old, 7200), (new, 0)):
        path.write_bytes(b"half")
        os.utime(path, (time.time() - age, time.time() - age))
    own.store("b", built)
    assert not old.exists()
    assert new.exists()
    own.clear()
    assert list(own.folder.iterdir()) == []


def planted(own: Cache) -> Path:
    """A kernel of the key "k"."""
    built = own.folder.parent / "built"
    built.write_bytes(b"code")
    return own.store("k", built)


def given_away(path: Path, monkeypatch: Patch) -> None:
    """Make it somebody else's; who is not root becomes somebody else."""
    if os.geteuid() == 0:
        os.chown(path, 4321, -1)
    else:
        monkeypatch.setattr("os.geteuid", lambda: 4321)


@UNIX
def test_a_new_cache_is_for_the_user_alone(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        kernel = planted(Cache(tmp_path / "cache"))
    finally:
        os.umask(before)
    assert kernel.parent.stat().st_mode & 0o777 == 0o700
    assert kernel.stat().st_mode & 0o077 == 0
    assert Cache(tmp_path / "cache").find("k") == kernel


@UNIX
@pytest.mark.parametrize("mode", [0o770, 0o707])
def test_a_cache_that_others_may_write_to_is_not_used(
    pendulum: Kernel, cache: Cache, tmp_path: Path, mode: int
) -> None:
    own = Cache(tmp_path / "cache")
    shutil.copytree(cache.folder, own.folder)
    own.folder.chmod(mode)
    before = sorted(own.folder.iterdir())
    kernel = compile_program(pendulum.program, cache=own, threads=1)
    assert not kernel.report.cached
    assert f"run chmod go-w {own.folder}, or set SYMPHYS_CACHE" in kernel.report.note
    assert sorted(own.folder.iterdir()) == before
    kernel.forward([0.0] * 30, [1.0])
    own.folder.chmod(0o700)
    assert compile_program(pendulum.program, cache=own, threads=1).report.cached


@UNIX
def test_a_cache_of_somebody_else_is_not_used(tmp_path: Path, monkeypatch: Patch) -> None:
    own = Cache(tmp_path / "cache")
    kernel = planted(own)
    given_away(own.folder, monkeypatch)
    assert own.find("k") is None
    with pytest.raises(OSError, match="belongs to somebody else"):
        own.store("new", kernel)


@UNIX
def test_a_kernel_of_somebody_else_is_not_used(tmp_path: Path, monkeypatch: Patch) -> None:
    own = Cache(tmp_path / "cache")
    given_away(planted(own), monkeypatch)
    assert own.find("k") is None


@UNIX
def test_a_kernel_that_others_may_write_is_not_used(tmp_path: Path) -> None:
    own = Cache(tmp_path / "cache")
    planted(own).chmod(0o666)
    assert own.find("k") is None


def test_a_user_without_a_home(monkeypatch: Patch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("SYMPHYS_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pathlib.Path.home", homeless)
    with pytest.raises(KernelUnavailable, match="SYMPHYS_CACHE"):
        default_cache()


def test_the_oldest_kernels_go_first(tmp_path: Path) -> None:
    built = tmp_path / "built"
    small = Cache(tmp_path / "cache", limit=250)
    for i, key in enumerate(("a", "b", "c")):
        built.write_bytes(bytes([i]) * 100)
        stored = small.store(key, built)
        os.utime(stored, (1000 + i, 1000 + i))
        small.find("a")
    assert small.find("b") is None
    assert small.find("a") is not None
    assert small.find("c") is not None
    assert small.info().bytes == 200
    assert small.clear() == 2
    assert small.info().kernels == 0


def test_where_the_cache_lies(monkeypatch: Patch) -> None:
    monkeypatch.setenv("SYMPHYS_CACHE", "there")
    assert default_cache().folder == Path("there")
    monkeypatch.delenv("SYMPHYS_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "base")
    assert default_cache().folder == Path("base", "symphys", "kernels")


def kernels(folder: Path) -> list[str]:
    """What is in the cache but locks: the endings of its files."""
    return [path.suffix for path in (folder / "cache").iterdir() if path.suffix != ".lock"]


@pytest.mark.slow
@LINUX
def test_one_process_builds_a_kernel_while_others_wait_and_one_of_these_where_it_is_killed(
    pendulum: Kernel, tmp_path: Path
) -> None:
    log, gate = tmp_path / "log", tmp_path / "gate"
    path = logged(tmp_path / "bin", log, gate, find_compiler().command)
    gate.touch()
    own = "from symphys.codegen.graph.graph import library as build; build()"
    building(tmp_path, "", own, PATH=path).communicate(timeout=FOREVER)
    gate.unlink()
    log.unlink()
    started = [building(tmp_path, "", PATH=path, TMPDIR=str(tmp_path)) for _ in range(3)]
    wait_for(log)
    until(lambda: all(map(waits, started)))
    first = next(process for process in started if {process.pid} == callers(log))
    first.kill()
    first.communicate(timeout=FOREVER)
    gate.touch()
    said = sorted(process.communicate(timeout=FOREVER)[0].strip() for process in started if process is not first)
    assert said == ["False", "True"]
    assert log.read_text("utf-8").count("-shared") == 1
    assert len(callers(log)) == 2
    assert [path.suffix for path in (tmp_path / "cache").iterdir()] == [".so", ".so"]  # and what makes graphs


def callers(log: Path) -> set[int]:
    """The processes that have called the compiler."""
    found = {int(line.split()[0]) for line in log.read_text("utf-8").splitlines()}
    return found - {1}  # whom the children of a killed process fall to


@UNIX
def test_without_locks_nobody_waits_and_one_kernel_is_kept(tmp_path: Path, monkeypatch: Patch) -> None:
    def refuse(*given: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refuse)
    monkeypatch.setattr("symphys.codegen.toolchain.cache.time.sleep", pytest.fail)
    own = Cache(tmp_path / "cache")
    with own.building("k"), own.building("k"):
        kernel = planted(own)
        assert planted(own) == kernel
    assert own.find("k") == kernel
    assert list(own.folder.iterdir()) == [kernel]


@UNIX
def test_a_builder_that_stands_still_is_not_waited_for_for_ever(tmp_path: Path, monkeypatch: Patch) -> None:
    """Who waits has slept for as long as his patience lasts, and whoever comes later does not sleep."""
    slept = [0.0]
    clock = SimpleNamespace(monotonic=lambda: sum(slept), time=time.time, sleep=slept.append)
    monkeypatch.setattr("symphys.codegen.toolchain.cache.time", clock)
    monkeypatch.setattr("symphys.codegen.toolchain.cache.LOCK_INTERVAL", LOCK_TIMEOUT / 100)
    own = Cache(tmp_path / "cache")
    with own.building("k"), own.building("k"):
        assert LOCK_TIMEOUT <= sum(slept) < 1.02 * LOCK_TIMEOUT
    count = len(slept)
    with own.building("k"):
        assert len(slept) == count


def test_a_kernel_that_cannot_be_read_now_is_kept(tmp_path: Path, monkeypatch: Patch) -> None:
    def refuse(path: Path) -> bytes:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    own = Cache(tmp_path / "cache")
    kernel = planted(own)
    with monkeypatch.context() as patch:
        patch.setattr("pathlib.Path.read_bytes", refuse)
        assert own.find("k") is None
    assert own.find("k") == kernel


def test_kernels_of_a_clock_that_was_ahead_do_not_stay_for_ever(tmp_path: Path) -> None:
    """Those that are used now would go instead, one after the other."""
    built, small = tmp_path / "built", Cache(tmp_path / "cache", limit=250)
    for i, key in enumerate("abcd"):
        built.write_bytes(bytes([i]) * 100)
        stored = small.store(key, built)
        if key == "a":
            os.utime(stored, (time.time() + 86400, time.time() + 86400))
    assert [key for key in "abcd" if small.find(key)] == ["c", "d"]


@UNIX
@pytest.mark.parametrize("ahead", [86400, -86400])
def test_what_was_left_goes_whatever_the_clock_says(tmp_path: Path, monkeypatch: Patch, ahead: float) -> None:
    """As one that was set forward, and back, by a day; what a process holds stays."""
    own, now = Cache(tmp_path / "cache"), time.time() + ahead
    built = planted(own)
    for name in (".new-left", ".left.lock"):
        (own.folder / name).touch()
    with own.building("held"):
        monkeypatch.setattr("time.time", lambda: now)
        own.store("k", built)
        assert sorted(path.name for path in own.folder.iterdir() if path != built) == [".held.lock"]
        (own.folder / ".new-left").touch()
        own.clear()
        assert [path.name for path in own.folder.iterdir()] == [".held.lock"]


def test_a_long_compile_is_told_beforehand_once(
    tmp_path: Path, monkeypatch: Patch, caplog: pytest.LogCaptureFixture
) -> None:
    """With the seconds that its operations take; what is kept takes none."""
    monkeypatch.setattr("symphys.codegen.toolchain.build.MIN_ANNOUNCED_TIME", 2.0)
    for _ in range(2):
        compile_program(programs.pendulum(), cache=Cache(tmp_path / "cache"), threads=1)
    (record,) = caplog.records
    operations = int(record.getMessage().split()[1].replace(",", ""))
    assert record.name == "symphys" and operations > 0
    assert f"about {2 + 1e-4 * operations:.0f} s" in record.getMessage()
