"""Calls of one row have a library of their own: which runs, when it is made, and that the bits are the same."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from tools.repeats import few, thorough
from worlds import programs
from worlds.heaps import heap
from worlds.toys import require

import symphys
from symphys.codegen import Cache, Kernel, KernelUnavailable, ProcessorKernel, Program, compile_program
from symphys.codegen.runtime.widths import suited
from symphys.codegen.toolchain import build
from symphys.codegen.toolchain.compiler import processor
from symphys.codegen.toolchain.warm_start import ProgramSource, compile_source
from symphys.transcription import rollout_program
from symphys.transcription.rollout import symbolic_rollout

pytestmark = pytest.mark.skipif(processor().lanes(False) < 4, reason="a block of this processor has two lanes")


@pytest.fixture
def own(tmp_path: Path) -> Cache:
    require("simd")
    return Cache(tmp_path / "kernels")


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody waits before a library that is missing is compiled."""
    monkeypatch.setattr(build, "COMPILE_TIME", (0.0, 0.0))


@pytest.fixture
def never(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "COMPILE_TIME", (inf, 0.0))


def falling(folder: Path) -> Program:
    """Spheres on one another, with guards and sections."""
    path = folder / "heap.toml"
    path.write_text(heap(["sphere"] * 3), "utf-8")
    program = rollout_program(symbolic_rollout(symphys.load(path)), exact=True)
    assert any(call.guard for call in program.body)
    return program


def draw(program: Program, rows: int) -> np.ndarray:
    return np.random.default_rng(rows).normal(size=(rows, program.z.size))


def loaded(kernel: Kernel) -> list[int]:
    assert isinstance(kernel, ProcessorKernel)
    return sorted(kernel.widths.loaded)


def test_the_rows_choose_the_lanes() -> None:
    assert [suited(rows, 8) for rows in (1, 2, 3, 8, 100)] == [1, 8, 8, 8, 8]
    assert [suited(rows, 1) for rows in (1, 2)] == [1, 1]


@pytest.mark.slow
@pytest.mark.usefixtures("never")
@few(
    ("name", "precision"),
    [
        *((name, precision) for name in ("pendulum", "chain") for precision in ("double", "single")),
        thorough("spheres", "double"),
        thorough("spheres", "single"),
    ],
    1,
)
def test_all_widths_give_the_same_bits(name: str, precision: Literal["double", "single"], own: Cache) -> None:
    program = falling(own.folder.parent) if name == "spheres" else getattr(programs, name)()
    caches = {rows: Cache(own.folder / str(rows)) for rows in (9, 1)}  # none finds what another has built
    kernels = [compile_program(program, precision=precision, cache=caches[n], threads=1, rows=n) for n in caches]
    assert [loaded(kernel) for kernel in kernels] == [[kernels[0].report.lanes], [1]]
    Z, given = draw(program, 9), np.full(program.parameters.size, 0.0 if name == "spheres" else 0.5)
    seed = np.ones(sum(place.size for place in program.outputs.values()))
    (values, gradient), (others, expected) = (kernel.gradient(Z, seed, given) for kernel in kernels)
    np.testing.assert_array_equal(gradient, expected)
    for output, value in values.items():
        np.testing.assert_array_equal(value, others[output])
    assert np.isfinite(gradient).all()
    assert [len(loaded(kernel)) for kernel in kernels] == [1, 1]  # each computed all nine rows alone


@pytest.mark.usefixtures("never")
def test_a_library_that_is_not_needed_for_long_is_not_compiled(own: Cache) -> None:
    kernel = compile_program(programs.pendulum(), cache=own, threads=1)
    for rows in (1, 2, 1, 20):
        kernel.forward(draw(kernel.program, rows), [1.0])
    assert loaded(kernel) == [kernel.report.lanes]
    assert own.info().kernels == 1


@pytest.mark.slow
@pytest.mark.usefixtures("at_once")
def test_a_library_that_is_needed_for_long_is_compiled_and_used(own: Cache) -> None:
    kernel = compile_program(programs.pendulum(), cache=own, threads=1)
    full, Z = kernel.report.lanes, draw(kernel.program, 20)
    before = kernel.forward(Z[0], [1.0])["merit"]
    assert loaded(kernel) == [1, full]
    assert kernel.widths.ready(1).lanes == 1
    np.testing.assert_array_equal(kernel.forward(Z[0], [1.0])["merit"], before)
    kernel.forward(Z[:2], [1.0])
    assert loaded(kernel) == [1, full]
    assert [kernel.widths.ready(rows).lanes for rows in (1, 2, 20)] == [1, full, full]


@pytest.mark.slow
@pytest.mark.usefixtures("at_once")
def test_who_expects_one_rollout_gets_the_others_later(own: Cache) -> None:
    kernel = compile_program(programs.pendulum(), cache=own, threads=1, rows=1)
    Z = draw(kernel.program, 20)
    assert own.info().kernels == 1
    first = kernel.forward(Z, [1.0])["merit"]
    assert loaded(kernel) == [1, kernel.report.lanes]
    np.testing.assert_array_equal(kernel.forward(Z, [1.0])["merit"], first)


@pytest.mark.slow
@pytest.mark.usefixtures("never")
def test_what_is_in_the_cache_is_used_at_once(own: Cache) -> None:
    compile_program(programs.pendulum(), cache=own, threads=1, rows=1)
    kernel = compile_program(programs.pendulum(), cache=own, threads=1)
    assert loaded(kernel) == [kernel.report.lanes]
    kernel.forward(draw(kernel.program, 1), [1.0])
    assert loaded(kernel) == [1, kernel.report.lanes]
    again = compile_program(programs.pendulum(), cache=own, threads=1, rows=1)
    assert again.report.cached
    fixed = kernel.fixed_batch(1), kernel.fixed()
    assert fixed[1].loaded is kernel.widths.loaded[1].loaded
    fixed[0].run()
    expected = kernel.forward(np.zeros(kernel.program.z.size), [0.0])
    np.testing.assert_array_equal(fixed[0].outputs[0], np.concatenate([part[0] for part in expected.values()]))


@pytest.mark.slow
def test_a_plan_that_was_kept_has_all_widths(own: Cache, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    def make() -> Program:
        made.append(1)
        return programs.pendulum()

    monkeypatch.setattr(build, "COMPILE_TIME", (0.0, 0.0))
    source = ProgramSource(make, "a pendulum")
    cold = compile_source(source, ("merit",), 1, cache=own)
    Z = draw(cold.program, 2)
    expected, full = cold.gradient(Z, [1.0], [1.0])[1][:1], cold.report.lanes
    assert (loaded(cold), len(made), own.info().kernels) == ([full], 1, 1)
    for _ in range(2):  # at first what was not kept is planned anew
        warm = compile_source(source, ("merit",), 1, cache=own)
        for _ in range(2):
            np.testing.assert_array_equal(warm.gradient(Z[:1], [1.0], [1.0])[1], expected)
        assert (loaded(warm), len(made), own.info().kernels) == ([1, full], 2, 2)


@pytest.mark.usefixtures("at_once")
@few("found", [False, True], 1)
def test_a_library_that_cannot_be_made_is_done_without(
    found: bool, own: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel = compile_program(programs.pendulum(), cache=own, threads=1)
    tried = []

    def refuse(*_: object) -> None:
        tried.append(1)
        raise KernelUnavailable("the disk is full")

    monkeypatch.setattr(build.KeptLibraries, "build", refuse)
    if found:
        monkeypatch.setattr(build.KeptLibraries, "find", refuse)
    z = draw(kernel.program, 1)
    merits = [kernel.forward(z, [1.0])["merit"][0, 0] for _ in range(3)]
    assert merits[0] == merits[1] == merits[2]
    assert (loaded(kernel), len(tried)) == ([kernel.report.lanes], 1 + found)


@pytest.mark.usefixtures("at_once")
def test_lanes_that_are_asked_for_are_the_only_ones(own: Cache) -> None:
    kernel = compile_program(programs.pendulum(), lanes=4, cache=own, threads=1)
    kernel.forward(draw(kernel.program, 1), [1.0])
    assert loaded(kernel) == [4]


@pytest.mark.usefixtures("never")
def test_the_first_bad_value_is_found_by_any_library(own: Cache) -> None:
    kernel = compile_program(programs.pendulum(), cache=own, threads=1, rows=1)
    z = draw(kernel.program, 1)[0]
    z[20] = 1e200
    found = kernel.first_bad(z, [1.0])
    assert found is not None
    assert (found.phase, found.step, found.function) == ("body", 20, "cost")
    assert loaded(kernel) == [1]
