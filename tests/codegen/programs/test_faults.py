"""Compilers that are missing, fail, hang or die give one clear line, and leave no process behind."""

from __future__ import annotations

import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from fakes.compilers import building, fake
from tools.waiting import FOREVER, assert_gone, wait_for
from worlds import programs

from symphys.codegen import Cache, KernelUnavailable, compile_program
from symphys.codegen.toolchain import compiler
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.codegen.toolchain.processes import run_all

Patch = pytest.MonkeyPatch
UNIX = pytest.mark.skipif(sys.platform == "win32", reason="the fake compilers are shell scripts")


@UNIX
@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("echo 'kernel.c:3: error: what is this' >&2; exit 1", "fakecc failed with code 1: kernel.c:3: error: what"),
        ("kill -9 $$", "fakecc was killed .often: out of memory."),
        ("echo 'fatal error: Killed signal terminated program cc1' >&2; exit 1", "fakecc was killed"),
        ("echo 'cc1: out of memory allocating 65536 bytes' >&2; exit 1", "fakecc ran out of memory"),
        (
            "echo 'error: cannot write part0.o: No space left on device' >&2; exit 1",
            r"fakecc cannot write to \S*symphys-kernel-\S*: no space left on device; make room there, or set TMPDIR",
        ),
        ("exit 3", "fakecc failed with code 3"),
    ],
)
def test_a_compiler_that_fails(tmp_path: Path, monkeypatch: Patch, script: str, message: str) -> None:
    monkeypatch.setenv("CC", fake(tmp_path, script))
    with pytest.raises(KernelUnavailable, match=message) as caught:
        compile_program(programs.pendulum(), cache=Cache(tmp_path / "cache"))
    assert "\n" not in str(caught.value)
    assert list((tmp_path / "cache").glob("*.so")) == []


def real_compiler() -> tuple[str, ...]:
    try:
        return find_compiler().command
    except KernelUnavailable as error:
        pytest.skip(str(error))


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


@UNIX
def test_a_compiler_without_memory(tmp_path: Path, monkeypatch: Patch) -> None:
    real = shlex.join(real_compiler())
    monkeypatch.setenv("CC", fake(tmp_path, f'ulimit -v 20000; exec {real} "$@"'))
    with pytest.raises(KernelUnavailable, match=r"fakecc (ran out of memory|was killed)"):
        compile_program(programs.pendulum(), cache=Cache(tmp_path / "cache"))


@UNIX
def test_a_compiler_that_hangs_is_stopped_with_all_that_it_started(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("CC", fake(tmp_path, f"sleep 100000 & echo $! >> {tmp_path}/started; wait"))
    monkeypatch.setattr("symphys.codegen.toolchain.compiler.COMPILE_TIMEOUT", 0.5)
    with pytest.raises(KernelUnavailable, match=r"fakecc did not end within 0\.5 s and was stopped"):
        compile_program(programs.pendulum(), cache=Cache(tmp_path / "cache"))
    assert_gone(tmp_path / "started")


@UNIX
def test_a_version_that_does_not_come(tmp_path: Path, monkeypatch: Patch) -> None:
    path = Path(fake(tmp_path, ""))
    path.write_text("#!/bin/sh\nexec sleep 100000\n", "utf-8")
    monkeypatch.setenv("CC", str(path))
    monkeypatch.setattr("symphys.codegen.toolchain.compiler.VERSION_TIMEOUT", 0.5)
    with pytest.raises(KernelUnavailable, match="did not end within"):
        find_compiler()


@UNIX
def test_the_first_failure_ends_the_others(tmp_path: Path) -> None:
    slow = ["sh", "-c", f"sleep 100000 & echo $! >> {tmp_path}/started; wait"]
    fails = ["sh", "-c", f"while [ ! -s {tmp_path}/started ]; do sleep 0.02; done; exit 7"]
    with pytest.raises(KernelUnavailable, match="sh failed with code 7"):
        run_all([slow, fails, slow], 2 * FOREVER, at_once=2)
    assert_gone(tmp_path / "started")


@UNIX
def test_ctrl_c_ends_the_compilers(tmp_path: Path) -> None:
    script = fake(tmp_path, f"sleep 100000 & echo $! >> {tmp_path}/started; wait")
    process = building(tmp_path, script)
    wait_for(tmp_path / "started")
    process.send_signal(signal.SIGINT)
    assert "KeyboardInterrupt" in process.communicate(timeout=FOREVER)[1]
    assert_gone(tmp_path / "started")


STRUCK = """
import os, signal
from symphys.codegen.toolchain.processes import run_all

class Struck(list):
    def __iter__(self):
        Finalized()
        return super().__iter__()

class Finalized:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        [None for _ in range(1000)]

run_all(Struck([["sleep", "100000"]]), 100000, at_once=1)
"""


ELSEWHERE = """
import signal, threading, time
from symphys.codegen.toolchain import processes

def strike():
    while not crew.started:
        time.sleep(0.01)
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)
    time.sleep(100000)

crew, plain = None, processes._Crew.run

def run(self, at_once):
    global crew
    crew = self
    threading.Thread(target=strike, daemon=True).start()
    plain(self, at_once)

processes._Crew.run = run
processes.run_all([["sleep", "100000"]], 100000, at_once=1)
"""


@UNIX
def test_ctrl_c_is_not_lost_as_a_wait_begins() -> None:
    """A signal that another thread gets does not end the main thread's wait, as one that comes just before it."""
    command = [sys.executable, "-c", ELSEWHERE]
    found = subprocess.run(command, capture_output=True, text=True, timeout=FOREVER, check=False)
    assert found.returncode and "KeyboardInterrupt" in found.stderr


@UNIX
def test_ctrl_c_is_not_lost_in_a_finalizer() -> None:
    found = subprocess.run([sys.executable, "-c", STRUCK], capture_output=True, text=True, timeout=FOREVER, check=False)
    assert found.returncode and "Exception ignored" not in found.stderr


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
    monkeypatch.setattr(compiler.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(compiler, "_features", lambda: set(features.split()))
    target = compiler.processor.__wrapped__()
    assert target.flags() == () or "-mavx2" in target.flags()
    assert (target.architecture, target.lanes(False), target.lanes(True)) == (architecture, lanes, 2 * lanes)
