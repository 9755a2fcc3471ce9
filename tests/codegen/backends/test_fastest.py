"""``auto``: small batches stay on the processor, large ones go where they are faster, and the result says so."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from fakes.emulated import Emulated, needs_compiler
from worlds.toys import require

from symphys.codegen import KernelUnavailable, ProcessorKernel, compile_program
from symphys.codegen.backends import BEST, build_kernel, kernels
from symphys.codegen.backends.kernels import FastestKernel, described
from symphys.codegen.cuda import DeviceKernel, compile_on
from symphys.codegen.runtime.batch import RolloutBatch
from symphys.problem import load_problem
from symphys.problems import find
from symphys.runs.record import evaluated_by
from symphys.transcription import rollout_program, symbolic_rollout, transcribe

LARGE = 8


@pytest.fixture(scope="module")
def here() -> ProcessorKernel:
    """A program on the processor."""
    require("simd")
    problem = load_problem(find("ball_throw"), {"simulation.duration": 0.2})
    return compile_program(rollout_program(symbolic_rollout(problem), exact=True), threads=1)


@pytest.fixture(scope="module")
def there(here: ProcessorKernel, tmp_path_factory: pytest.TempPathFactory) -> DeviceKernel:
    """The same on what plays a GPU."""
    return compile_on(Emulated(tmp_path_factory.mktemp("device")), here.program)


class Timed:
    """A kernel's ``_run`` that takes so many seconds of its clock, and keeps the rows of each call."""

    def __init__(self, run: Callable[[RolloutBatch], None], seconds: float) -> None:
        self.run, self.seconds, self.rows, self.now = run, seconds, list[int](), 0.0

    def __call__(self, batch: RolloutBatch) -> None:
        self.rows.append(batch.rows)
        self.now += self.seconds
        self.run(batch)

    def clock(self) -> float:
        return self.now


def points(kernel: ProcessorKernel, count: int) -> np.ndarray:
    return np.random.default_rng(3).normal(0, 1, (count, kernel.program.z.size))


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("faster", [True, False])
def test_a_large_batch_goes_where_the_first_of_its_size_was_faster(
    here: ProcessorKernel, there: DeviceKernel, faster: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = Timed(there._run, 1.0)
    monkeypatch.setattr(there, "_run", run)
    monkeypatch.setattr(kernels, "perf_counter", run.clock)
    kernel = FastestKernel(here, lambda: there, LARGE)
    if faster:
        monkeypatch.setattr(kernel, "_expected", lambda batch: 1e6)
    for count in (LARGE, LARGE + 1, 2 * LARGE - 1):
        Z = points(here, count)
        for name, found in kernel.forward(Z, [0.0]).items():
            np.testing.assert_allclose(found, here.forward(Z, [0.0])[name], rtol=1e-12, atol=1e-12)
    assert run.rows == ([LARGE, LARGE + 1, 2 * LARGE - 1] if faster else [LARGE])
    assert kernel.chosen.startswith("this processor against the processor: values of 8 to 15 rollouts ")
    kernel.gradient(points(here, 2 * LARGE), np.ones(kernel._seeds()), [0.0])
    assert run.rows[-1] == 2 * LARGE  # another kind and size is tried anew
    assert "gradients of 16 to 31 rollouts" in kernel.chosen
    assert kernel.chosen in evaluated_by(described(kernel, 0.0)).note


@pytest.mark.slow
def test_small_batches_ask_no_gpu(here: ProcessorKernel) -> None:
    def build() -> DeviceKernel:
        pytest.fail("a GPU was asked")

    kernel = FastestKernel(here, build, LARGE)
    kernel.forward(points(kernel, LARGE - 1), [0.0])
    assert kernel.chosen == ""


def test_without_a_gpu_it_is_looked_for_once(here: ProcessorKernel) -> None:
    asked = []

    def build() -> DeviceKernel:
        asked.append(1)
        raise KernelUnavailable("no GPU")

    kernel = FastestKernel(here, build, LARGE)
    Z = points(here, LARGE)
    for _ in range(2):
        found, wanted = kernel.forward(Z, [0.0]), here.forward(Z, [0.0])
        assert all(np.array_equal(found[name], wanted[name]) for name in wanted)
    assert (asked, kernel.chosen) == ([1], "")


@pytest.mark.slow
@needs_compiler
def test_a_gpu_that_fails_gives_way_to_the_processor_and_is_told(
    here: ProcessorKernel, there: DeviceKernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(batch: RolloutBatch) -> None:
        raise KernelUnavailable("no memory is left")

    monkeypatch.setattr(there, "_run", fail)
    kernel = FastestKernel(here, lambda: there, LARGE)
    Z = points(here, LARGE)
    for _ in range(2):
        found, wanted = kernel.forward(Z, [0.0]), here.forward(Z, [0.0])
        assert all(np.array_equal(found[name], wanted[name]) for name in wanted)
    assert kernel.chosen == "no memory is left"


@pytest.mark.slow
def test_auto_is_such_a_kernel(here: ProcessorKernel) -> None:
    assert isinstance(build_kernel(BEST, here.program, ["merit"], 1), FastestKernel)
    told = transcribe(load_problem(find("ball_throw"), {"simulation.duration": 0.2}), backend=BEST).backend
    assert (told.name, told.said()) == ("simd", told.note)
