"""A first start does not wait for the compiler: an interpreter runs, with the same bits, until the kernel is there."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import few, thorough
from tools.waiting import until
from worlds import programs
from worlds.heaps import heap
from worlds.operations import alone, every_operation
from worlds.toys import require

import symphys
from symphys.codegen import Cache, Program, compile_program
from symphys.codegen.runtime import widths
from symphys.codegen.toolchain import build
from symphys.codegen.toolchain.build import BlockWidth, compiled, width_of
from symphys.codegen.toolchain.warm_start import ProgramSource, compile_source
from symphys.transcription import rollout_program
from symphys.transcription.rollout import symbolic_rollout

FAILS_LATER = """#!/bin/sh
case "$*" in *part1.c*) echo 'part1.c: error: no more' >&2; exit 1;; esac
exec gcc "$@"
"""
ENDS_AT_ONCE = """
import os, signal, sys
from worlds import programs
from symphys.codegen.toolchain import build
from symphys.codegen.toolchain.warm_start import ProgramSource, compile_source
build.MIN_LONG_OPERATIONS = 0
kernel = compile_source(ProgramSource(programs.chain, "a chain"), ("merit",), 1, wait=False)
for _ in range(2):  # the second call begins to compile
    kernel.forward([0.5] * kernel.program.z.size, [1.0] * kernel.program.parameters.size)
os.kill(os.getpid(), signal.{signal})
"""


@pytest.fixture(autouse=True)
def worth(monkeypatch: pytest.MonkeyPatch) -> None:
    require("simd")
    monkeypatch.delenv("SYMPHYS_WAIT", raising=False)
    monkeypatch.setattr(build, "MIN_LONG_OPERATIONS", 0)


class Never:
    """A compiler that never ends."""

    running = True

    def __init__(self, *_: Any) -> None:
        """Begin."""


def spheres(folder: Path) -> Program:
    path = folder / "heap.toml"
    path.write_text(heap(["sphere"] * 3), "utf-8")
    return rollout_program(symbolic_rollout(symphys.load(path)), exact=True)


def made(program: Program, cache: Cache, single: bool = False) -> Any:
    """The kernel of a program, whose compiler is not waited for."""
    width = BlockWidth(width_of("auto", single), single)
    return compiled(program, tuple(program.outputs), width, cache, threads=1, wait=False)[0]


def arguments(program: Program, rows: int) -> tuple[Any, Any, Any]:
    draw = np.random.default_rng(rows).uniform(0.1, 0.9, (rows, program.z.size))
    return draw, np.ones(sum(p.size for p in program.outputs.values())), np.zeros(program.parameters.size)


def same(found: Any, wanted: Any) -> None:
    np.testing.assert_array_equal(found[1], wanted[1])
    for name, values in wanted[0].items():
        np.testing.assert_array_equal(found[0][name], values)


@few(
    ("name", "single"),
    [
        *((name, single) for name in ("pendulum", "chain", "operations") for single in (False, True)),
        pytest.param("spheres", False, marks=pytest.mark.slow),
        thorough("spheres", True),
    ],
    1,
)
def test_the_interpreter_gives_the_same_bits(
    name: str, single: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    makers: dict[str, Callable[[], Program]] = {
        "operations": lambda: alone(every_operation()),
        "spheres": lambda: spheres(tmp_path),
        "pendulum": programs.pendulum,
        "chain": programs.chain,
    }
    monkeypatch.setattr(widths, "Background", Never)
    program, cache = makers[name](), Cache(tmp_path / "kernels")
    interpreted = made(program, cache, single)
    assert cache.info().kernels == 1  # the interpreter; the kernel is never there
    whole = compile_program(program, cache=cache, threads=1, precision="single" if single else "double")
    for rows in (1, 9):
        same(interpreted.gradient(*arguments(program, rows)), whole.gradient(*arguments(program, rows)))


@pytest.mark.slow
def test_a_kernel_changes_over_when_it_is_compiled(tmp_path: Path) -> None:
    cache = Cache(tmp_path / "kernels")
    kernel = made(programs.chain(), cache)
    given = arguments(kernel.program, 9)
    before, first = kernel.widths.ready(9), kernel.gradient(*given)
    assert not kernel.report.cached
    kernel.widths.finish()
    after = kernel.widths.ready(9)
    assert after.lanes == before.lanes
    assert after.loaded is not before.loaded
    same(kernel.gradient(*given), first)
    assert (kernel.chosen, cache.info().kernels) == ("", 2)
    again = made(programs.chain(), cache)
    assert again.report.cached
    same(again.gradient(*given), first)


@pytest.mark.slow
def test_who_waits_is_given_what_was_compiled(tmp_path: Path) -> None:
    cache = Cache(tmp_path / "kernels")
    kernel = compile_source(ProgramSource(programs.chain), ("merit",), 1, cache=cache)
    assert cache.info().kernels == 1
    kernel.widths.finish()  # nothing is at work
    fixed = made(programs.pendulum(), cache).fixed()
    assert cache.info().kernels == 3  # callers in C keep what they have, so they are given what is compiled
    assert fixed.outputs.size


@pytest.mark.slow
def test_a_compiler_that_fails_later_leaves_the_interpreter_and_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrapper = tmp_path / "cc"
    wrapper.write_text(FAILS_LATER, "utf-8")
    wrapper.chmod(0o755)
    monkeypatch.setenv("CC", str(wrapper))
    cache = Cache(tmp_path / "kernels")
    kernel = made(programs.chain(), cache)
    first = kernel.gradient(*arguments(kernel.program, 9))
    kernel.widths.finish()
    assert (
        kernel.chosen == "an interpreter evaluates, which is slower: the compiler cc failed with code 1: part1.c: "
        "error: no more"
    )
    same(kernel.gradient(*arguments(kernel.program, 9)), first)
    assert cache.info().kernels == 1


@pytest.mark.slow
def test_without_a_cache_the_compiler_is_waited_for(tmp_path: Path) -> None:
    blocked = tmp_path / "a file"
    blocked.write_text("", "utf-8")
    kernel = made(programs.chain(), Cache(blocked / "kernels"))
    assert "was not kept" in kernel.report.note


@few("how", ["SIGINT", "SIGKILL"], 1)
def test_a_process_that_ends_leaves_the_kernel_to_the_next(how: str, tmp_path: Path) -> None:
    cache = Cache(tmp_path / "kernels")
    environment = os.environ | {
        "SYMPHYS_CACHE": str(cache.folder),
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    code = ENDS_AT_ONCE.format(signal=how)
    ended = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == -signal.Signals[how]
    until(lambda: cache.info().kernels >= 3)  # what makes graphs, and the interpreter, too
    kernel = compile_source(ProgramSource(programs.chain, "a chain"), ("merit",), 1, cache=cache, wait=False)
    assert kernel.report.cached
