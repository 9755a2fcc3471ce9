"""Compilers that are missing, fail or die give one clear line; a cache that fails is done without."""

from __future__ import annotations

import errno
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import programs
import pytest

from symphys.kernel import Cache, Kernel, KernelUnavailable, compile_program, default_cache, processor
from symphys.kernel.compiler import find_compiler

Patch = pytest.MonkeyPatch
UNIX = pytest.mark.skipif(sys.platform == "win32", reason="the fake compilers are shell scripts")


def fake(folder: Path, script: str) -> str:
    """A compiler that knows its version and then does as the script says."""
    path = folder / "fakecc"
    path.write_text(f'#!/bin/sh\nif [ "$1" = --version ]; then echo fake 1.0; exit 0; fi\n{script}\n', "utf-8")
    path.chmod(0o755)
    return str(path)


@UNIX
@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("echo 'kernel.c:3: error: what is this' >&2; exit 1", "fakecc failed with code 1: kernel.c:3: error: what"),
        ("kill -9 $$", "fakecc was killed .often: out of memory."),
        ("echo 'fatal error: Killed signal terminated program cc1' >&2; exit 1", "fakecc was killed"),
        ("echo 'cc1: out of memory allocating 65536 bytes' >&2; exit 1", "fakecc ran out of memory"),
        ("exit 3", "fakecc failed with code 3"),
    ],
)
def test_a_compiler_that_fails(tmp_path: Path, monkeypatch: Patch, script: str, message: str) -> None:
    monkeypatch.setenv("CC", fake(tmp_path, script))
    with pytest.raises(KernelUnavailable, match=message) as caught:
        compile_program(programs.pendulum(), cache=Cache(tmp_path / "cache"))
    assert "\n" not in str(caught.value)
    assert list((tmp_path / "cache").glob("*.so")) == []


def test_a_compiler_that_is_missing(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("CC", "nocc -x")
    with pytest.raises(KernelUnavailable, match="compiler 'nocc' that CC names was not found: install gcc"):
        find_compiler()
    monkeypatch.delenv("CC")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(KernelUnavailable, match="no C compiler was found: install gcc"):
        find_compiler()


@UNIX
def test_a_compiler_that_cannot_be_run(tmp_path: Path, monkeypatch: Patch) -> None:
    path = Path(fake(tmp_path, ""))
    path.write_text("no program", "utf-8")
    monkeypatch.setenv("CC", str(path))
    with pytest.raises(KernelUnavailable, match="fakecc cannot be run"):
        find_compiler()


def test_the_second_time_it_comes_from_the_cache(chain: Kernel, cache: Cache) -> None:
    again = compile_program(chain.program, cache=cache)
    assert again.report.cached
    assert again.report.seconds < 1


def test_time_and_sweeps_are_data(chain: Kernel, cache: Cache, monkeypatch: Patch) -> None:
    monkeypatch.setattr(programs, "SWEEPS", 7)
    assert compile_program(programs.chain(), cache=cache).report.cached


def test_the_key_holds_flags_and_lanes(pendulum: Kernel, cache: Cache, monkeypatch: Patch) -> None:
    before = cache.info().kernels
    assert compile_program(pendulum.program, cache=cache, threads=1).report.cached
    monkeypatch.setattr("symphys.kernel.compiler.FLAGS", ("-O1", "-fPIC"))
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


@UNIX
def test_two_processes_build_a_kernel_once(pendulum: Kernel, tmp_path: Path) -> None:
    real = shlex.join(find_compiler().command)
    script = f'echo "$@" >> {tmp_path}/log; exec {real} "$@"'
    code = (
        "import programs; from symphys.kernel import compile_program as c; print(c(programs.pendulum()).report.cached)"
    )
    environment = os.environ | {
        "CC": fake(tmp_path, script),
        "SYMPHYS_CACHE": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(Path(programs.__file__).parent), *sys.path]),
    }
    started = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    said = sorted(process.communicate(timeout=60)[0].strip() for process in started)
    assert said == ["False", "True"]
    assert (tmp_path / "log").read_text("utf-8").count("-shared") == 1
    assert len(list((tmp_path / "cache").glob("*.so"))) == 1
    assert [p.name for p in (tmp_path / "cache").iterdir() if p.suffix != ".so"] == []


@pytest.mark.parametrize(
    ("features", "architecture", "lanes"),
    [
        ("fpu sse2", "x86-64", 2),
        ("avx2 bmi1 bmi2 f16c fma", "x86-64-v3", 4),
        ("avx2 bmi1 bmi2 f16c fma avx512f avx512bw avx512cd avx512dq avx512vl", "x86-64-v4", 8),
        ("avx2 fma avx512f", "x86-64", 2),
    ],
)
def test_lanes_follow_the_processor(monkeypatch: Patch, features: str, architecture: str, lanes: int) -> None:
    monkeypatch.setattr(processor.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(processor, "_features", lambda: set(features.split()))
    target = processor.processor.__wrapped__()
    assert target.flags() == () or "-mavx2" in target.flags()
    assert (target.architecture, target.lanes(False), target.lanes(True)) == (architecture, lanes, 2 * lanes)
