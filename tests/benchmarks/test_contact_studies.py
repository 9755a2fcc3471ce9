"""The studies of contact on a tiny size: what they measure is finite, and falls with the step."""

from __future__ import annotations

from pathlib import Path

import ablation
import consistency
import gradients
import mujoco_runs
import numpy as np
import pytest
from contact_figures import Curve, consistency_figure, gradient_figure
from scenes import Solid, tumbling_box
from tools.repeats import first

from symphys.codegen import KernelUnavailable
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.model.world import Scheme


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
    curve = gradients.study(
        box, "symphys", lambda dt: gradients.here(box, dt), (0.016, 0.002), gradients.here(box, 5e-4)
    )
    assert np.isfinite(curve.errors).all()
    assert (curve.errors[1] < curve.errors[0]).all()


@pytest.mark.thorough
@pytest.mark.slow
def test_motion_of_a_tumbling_box_falls_with_the_step() -> None:
    engine = consistency.Here("symphys, e = 0.5", tumbling_box(2), 0.5)
    errors = consistency.errors_of(engine, 0.48, (0.016, 0.002), 5e-4)
    assert np.isfinite(errors).all()
    assert np.median(errors[1]) < np.median(errors[0]) < 0.01


def test_mujoco_on_the_same_scene() -> None:
    if mujoco_runs.mujoco is None:
        pytest.skip("mujoco is not installed")
    engine = consistency.There("MuJoCo, default contact", tumbling_box(2), consistency.SOFT)
    errors = consistency.errors_of(engine, 0.48, (0.016, 0.002), 2.5e-4)
    assert np.median(errors[1]) < np.median(errors[0])


@pytest.mark.thorough
def test_ablation_tells_the_tricks_apart() -> None:
    whole, without = (ablation.dropped_ball(Scheme(time_of_impact=t)) for t in (True, False))
    assert max(whole) < 1e-9 < 1e-2 < min(without)
    cut, uncut = (ablation.cushion(Scheme(cuts=cuts)) for cuts in (None, 0))
    assert cut[1] < 0.02 < 0.3 < uncut[1]


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [((0.5,), (0.1, 0.1, 0.1)), ((0.1, 0.2, 0.3), (0.13 / 3, 0.1 / 3, 0.05 / 3)), ((0.5, 0.0), (0.1, 0.1, 0.1))],
)
def test_inertia_of_solids(sizes: tuple[float, ...], expected: tuple[float, ...]) -> None:
    """A ball, a box, and a capsule without length, which is a ball; 1 kg."""
    assert Solid("s", 1.0, sizes).inertia == pytest.approx(expected)


def test_figures_are_drawn(tmp_path: Path) -> None:
    errors = np.geomspace(1e-2, 1e-6, 8).reshape(4, 2)
    curve = Curve("symphys", (0.016, 0.008, 0.004, 0.002), errors, errors[:, 0], errors[:, 1])
    consistency_figure({"a scene": [curve]}, tmp_path / "one.svg")
    gradient_figure({str(k): [curve] for k in range(4)}, tmp_path / "two.svg")
    assert "a scene" in (tmp_path / "one.svg").read_text(encoding="utf-8")
    assert (tmp_path / "two.svg").stat().st_size > 1000
