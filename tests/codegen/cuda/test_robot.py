"""A leg that hops, 100 steps with joints and contact, in CUDA's words: numbers, the compiler, a GPU if there is one."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes.emulated import Emulated, needs_compiler
from tools.agreement import transcribed
from worlds import programs
from worlds.monopod import MONOPOD

from symphys.codegen import Cache, Kernel, KernelUnavailable, Program, compile_program
from symphys.codegen.cuda import DeviceKernel, compile_on, find_gpu
from symphys.codegen.cuda.gpu import compiled, image, linked
from symphys.codegen.cuda.kernel import device_sources, schedules
from symphys.codegen.emit.plan import FAST_MEMORY, plan
from symphys.transcription import rollout_program

LEG = (
    """
[simulation]
duration = 1.0
dt = 0.01
cuts = 0
time_of_impact = false
"""
    + MONOPOD
    + """
[[variable]]
name = "command"
sets = "leg.command"
knots = 10
[[variable]]
name = "start"
sets = ["torso.velocity[0]", "foot.velocity[0]"]
guess = 0.1
[[cost]]
name = "height"
at = "always"
value = "torso.position[2] - torso.position[0]"
"""
)
SEEDED = ("merit",)


@cache
def hopping() -> Program:
    return rollout_program(transcribed(LEG, "casadi").rollout, exact=True)


def points(count: int) -> Any:
    guess = transcribed(LEG, "casadi").shooting.start(0)
    return guess + 0.05 * np.random.default_rng(0).standard_normal((count, guess.size))


def agree(there: Kernel, here: Kernel, Z: Any, within: float) -> None:
    (outputs, gradient), (wanted, slopes) = (kernel.gradient(Z, [1.0], [0.0]) for kernel in (there, here))
    for name, values in wanted.items():
        np.testing.assert_allclose(outputs[name], values, rtol=within, atol=within * np.abs(values).max())
    np.testing.assert_allclose(gradient, slopes, atol=within * np.abs(slopes).max())


@pytest.mark.thorough
@needs_compiler
def test_a_hundred_steps_with_contact_are_the_processors(tmp_path: Path) -> None:
    here = compile_program(hopping(), seeded=SEEDED, threads=1)
    there = compile_on(Emulated(tmp_path, backwards=True), hopping(), seeded=SEEDED)
    assert hopping().steps == 100
    agree(there, here, points(5), 1e-9)


@pytest.mark.slow
def test_nvrtc_compiles_and_links_it_for_recent_architectures() -> None:
    pytest.importorskip("cuda.bindings.nvrtc", reason="NVRTC is part of the extra cuda")
    texts = device_sources(plan(hopping(), SEEDED, FAST_MEMORY), hopping().steps, 32, 4, single=False)
    ((_, said),) = compiled(texts[-1:], "sm_120", ["--ptxas-options=-v"])
    assert re.search("Compiling entry function 'advance' for 'sm_120'", said)
    objects = [part for part, _ in compiled(texts, "sm_90")]
    assert linked(objects, "sm_90").startswith(b"\x7fELF")
    with pytest.raises(KernelUnavailable, match="cannot be linked"):
        linked(objects[1:], "sm_90")
    with pytest.raises(KernelUnavailable, match=r"nvrtc refuses the kernel: .*error"):
        compiled(["nonsense"], "sm_90")


def test_what_was_compiled_is_kept(tmp_path: Path) -> None:
    pytest.importorskip("cuda.bindings.nvrtc", reason="NVRTC is part of the extra cuda")
    cache = Cache(tmp_path / "cache")
    texts = device_sources(plan(programs.pendulum(), SEEDED, FAST_MEMORY), programs.STEPS, 32, 1, single=True)
    first, again = (image(texts, "sm_90", cache, tmp_path) for _ in range(2))
    assert (first.cached, again.cached, first.path) == (False, True, again.path)
    assert first.path.suffix == ".cubin"
    assert (cache.info().kernels, cache.clear(), cache.info().kernels) == (1, 1, 0)


@pytest.mark.slow
def test_warps_share_the_work_and_meet_no_word_at_once() -> None:
    planned = plan(hopping(), SEEDED, FAST_MEMORY)
    alone, shared = (schedules(planned, hopping(), warps) for warps in (1, 4))
    for phase, each in shared.items():
        assert np.diff(each.spans).sum() == np.diff(alone[phase].spans).sum() == len(each.entries)
        assert sorted(each.entries.tolist()) == sorted(alone[phase].entries.tolist())
        assert each.work == alone[phase].work == alone[phase].longest
    assert shared["body"].longest < 0.8 * shared["body"].work


@pytest.fixture(scope="module")
def gpu() -> Any:
    try:
        return find_gpu()
    except KernelUnavailable as error:
        pytest.skip(str(error))


@pytest.mark.gpu
@pytest.mark.parametrize("warps", [1, 4])
def test_a_gpu_gives_the_processors_numbers(gpu: Any, warps: int) -> None:
    here = compile_program(hopping(), seeded=SEEDED, threads=1)
    there = compile_on(gpu, hopping(), seeded=SEEDED, warps=warps)
    assert isinstance(there, DeviceKernel)
    for count in (1, 33, 500):
        agree(there, here, points(count), 1e-9)


@pytest.mark.gpu
def test_a_gpu_in_single_precision(gpu: Any) -> None:
    """Of some starts its gradient cancels to nothing that is right, on a processor too."""
    here = compile_program(hopping(), seeded=SEEDED, threads=1)
    there = compile_on(gpu, hopping(), "single", SEEDED)
    (outputs, gradient), (wanted, slopes) = (kernel.gradient(points(33), [1.0], [0.0]) for kernel in (there, here))
    np.testing.assert_allclose(outputs["merit"], wanted["merit"], rtol=1e-5)
    errors = np.linalg.norm(gradient - slopes, axis=1) / np.linalg.norm(slopes, axis=1)
    assert 1e-9 < np.median(errors) < 1e-5
