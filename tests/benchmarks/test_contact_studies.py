"""The studies of contact on a tiny size: what they measure is finite, and falls with the step."""

from __future__ import annotations

import consistency
import engines
import gradients
import numpy as np
import pytest
from scenes import Solid, tumbling_box
from tools.repeats import first

from symphys.codegen import KernelUnavailable
from symphys.codegen.toolchain.compiler import find_compiler


@pytest.fixture(autouse=True)
def compiler() -> None:
    try:
        find_compiler()
    except KernelUnavailable as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def cases() -> list[gradients.Case]:
    return gradients.cases(batch=2)


@pytest.mark.slow
@first("which", [0, 1, 2])
def test_gradients_are_exact_with_the_time_of_impact_only(cases: list[gradients.Case], which: int) -> None:
    case = cases[which]
    exact = case.exact(case.scene.start[:, 0])
    assert gradients.here(case, case.largest) == pytest.approx(exact, abs=1e-9)
    assert np.abs(gradients.here(case, case.largest, time_of_impact=False) - exact).max() > 0.1


@pytest.mark.thorough
def test_gradient_of_a_tumbling_box_falls_with_the_step(cases: list[gradients.Case]) -> None:
    box = cases[3]
    exact = gradients.here(box, 5e-4)
    coarse, fine = (gradients.errors_of(gradients.here(box, dt), exact) for dt in (0.016, 0.002))
    assert np.isfinite(coarse).all()
    assert (fine < coarse).all()


@pytest.mark.thorough
@pytest.mark.slow
def test_motion_of_a_tumbling_box_falls_with_the_step() -> None:
    engine = consistency.Here("symphys, e = 0.5", tumbling_box(2), 0.5)
    errors = consistency.errors_of(engine, 0.48, (0.016, 0.002), 5e-4)
    assert np.isfinite(errors).all()
    assert np.median(errors[1]) < np.median(errors[0]) < 0.01


def test_mujoco_on_the_same_scene() -> None:
    if engines.mujoco is None:
        pytest.skip("mujoco is not installed")
    engine = consistency.solids_there(tumbling_box(2), consistency.SOFT)
    errors = consistency.errors_of(engine, 0.48, (0.016, 0.002), 2.5e-4)
    assert np.median(errors[1]) < np.median(errors[0])


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [((0.5,), (0.1, 0.1, 0.1)), ((0.1, 0.2, 0.3), (0.13 / 3, 0.1 / 3, 0.05 / 3)), ((0.5, 0.0), (0.1, 0.1, 0.1))],
)
def test_inertia_of_solids(sizes: tuple[float, ...], expected: tuple[float, ...]) -> None:
    """A ball, a box, and a capsule without length, which is a ball; 1 kg."""
    assert Solid("s", 1.0, sizes).inertia == pytest.approx(expected)
