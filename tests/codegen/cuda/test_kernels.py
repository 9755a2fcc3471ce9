"""A device's kernels give the numbers of the processor's: the same source, its threads played by fibers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes.emulated import Emulated, needs_compiler
from tools.repeats import few
from worlds import programs

from symphys.codegen import AdjointDiscount, Cache, Kernel, KernelUnavailable, Place, Program, compile_program
from symphys.codegen.cuda import DeviceKernel, compile_on

pytestmark = needs_compiler
STEPS = programs.STEPS
TORQUE = Place(0, 1, 1)
"""Of each step; torques of 0 and 1 serve as what is kept, too."""


def pendulum() -> Program:
    """Whose adjoints are discounted."""
    return replace(programs.pendulum(), discounted=AdjointDiscount(programs.PENDULUM_STATE, TORQUE))


def rows(kernel: Kernel, count: int) -> Any:
    return np.random.default_rng(1).normal(size=(count, kernel.program.z.size))


def seeds(kernel: Kernel, count: int) -> Any:
    width = sum(kernel.program.outputs[name].size for name in kernel.seeded)
    return np.random.default_rng(2).normal(size=(count, width))


@pytest.fixture(scope="module", params=[(1, False), (4, False), (4, True)], ids=["1 warp", "4 warps", "backwards"])
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, cache: Cache) -> Any:
    """The pendulum on a device, whose threads run in either order, and on the processor."""
    warps, backwards = request.param
    device = Emulated(tmp_path_factory.mktemp("device"), backwards)
    return compile_on(device, pendulum(), warps=warps), compile_program(pendulum(), cache=cache, threads=1)


@few("count", [1, 4, 11], 1)
def test_outputs_and_gradients_are_the_processors(pair: tuple[DeviceKernel, Kernel], count: int) -> None:
    there, here = pair
    z, seed, parameters = rows(here, count), seeds(here, count), [9.81]
    outputs, gradient = there.gradient(z, seed, parameters)
    wanted, slopes = here.gradient(z, seed, parameters)
    for name, values in wanted.items():
        np.testing.assert_array_equal(outputs[name], values)
        np.testing.assert_array_equal(there.forward(z, parameters)[name], values)
    np.testing.assert_allclose(gradient, slopes, rtol=1e-12, atol=1e-13)


def test_jacobians_and_trajectories(pair: tuple[DeviceKernel, Kernel]) -> None:
    there, here = pair
    z, state = rows(here, 3), programs.PENDULUM_STATE
    np.testing.assert_allclose(there.jacobian(z[0], "merit", [9.81]), here.jacobian(z[0], "merit", [9.81]), rtol=1e-12)
    found = [kernel.trajectory(z, state, STEPS + 1, [9.81]) for kernel in pair]
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("discount, skipped", [(0.1, 0), (0.0, 7), (0.1, STEPS), (0.0, 1)])
def test_discounted_adjoints_and_skipped_steps(
    pair: tuple[DeviceKernel, Kernel], discount: float, skipped: int
) -> None:
    z = np.ones((9, STEPS))
    z[np.arange(9), 2 * np.arange(9)] = 0
    found = [kernel.gradient(z, [1, 0, 0], [9.81], discount, skipped) for kernel in pair]
    np.testing.assert_array_equal(found[0][0]["merit"], found[1][0]["merit"])
    np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-12, atol=1e-14)


@pytest.mark.slow
def test_what_does_not_fit_at_once_is_computed_in_waves(tmp_path: Path, cache: Cache) -> None:
    device = Emulated(tmp_path)
    there, here = compile_on(device, programs.chain()), compile_program(programs.chain(), cache=cache, threads=1)
    device.room = 4 * there.report.bytes_per_lane + 1
    z, seed = rows(here, 10), seeds(here, 10)
    np.testing.assert_allclose(there.gradient(z, seed)[1], here.gradient(z, seed)[1], rtol=1e-12, atol=1e-13)
    assert device.launched.count("begin") == 3


def test_no_rows_are_no_work(pair: tuple[DeviceKernel, Kernel]) -> None:
    there, here = pair
    assert there.forward(rows(here, 0), [9.81])["merit"].shape == (0, 1)


def test_a_device_without_room_says_what_is_wanted(device: Emulated) -> None:
    kernel = compile_on(device, programs.chain())
    device.room = 100
    with pytest.raises(KernelUnavailable, match=r"has 0\.0 GiB free, and 4 rollouts take"):
        kernel.forward(rows(kernel, 1))


@pytest.mark.slow
def test_single_precision_rounds_and_no_more(device: Emulated, cache: Cache) -> None:
    there, here = compile_on(device, pendulum(), "single"), compile_program(pendulum(), cache=cache, threads=1)
    z, seed = rows(here, 5), seeds(here, 5)
    found, wanted = (kernel.gradient(z, seed, [9.81])[1] for kernel in (there, here))
    error = np.abs(found - wanted).max() / np.abs(wanted).max()
    assert 1e-9 < error < 1e-5
