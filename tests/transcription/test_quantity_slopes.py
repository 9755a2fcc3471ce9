"""Quantities along rollouts of different lengths, and their derivatives along directions."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.codegen import compile_program
from symphys.expression import parse
from symphys.problem import problem_of_tables
from symphys.transcription.program import rollout_program
from symphys.transcription.quantity_slopes import QuantitySlopes
from symphys.transcription.rollout import Rollout, symbolic_rollout

STEPS = 40
FORMULAS = {"height": parse("crate.position[2]"), "pose": parse("crate.orientation")}
BASE = np.array([0.2, 0.0, 0.0, 0.3, 0.8, 0.1, -1.0, 4.0, 3.0, 2.0, 0.3])


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    """A round crate falls onto one of its ends and tumbles."""
    crate = {"name": "crate", "mass": 1, "shape": {"capsule": {"radius": 0.1, "length": 0.2}}, "friction": 0.5}
    sets = ["position", "velocity", "angular_velocity", "mass", "friction"]
    return symbolic_rollout(
        problem_of_tables(
            {
                "simulation": {"duration": STEPS * 0.01, "dt": 0.01},
                "body": [{**crate, "position": [0, 0, 0.3]}],
                "ground": {"friction": 1},
                "variable": [{"name": f"by_{each}", "sets": f"crate.{each}"} for each in sets],
            }
        )
    )


def decision(rollout: Rollout, rows: int) -> np.ndarray:
    spread = 0.05 * np.random.default_rng(0).normal(size=(rows, len(BASE)))
    return BASE + spread


@pytest.mark.slow
def test_rollouts_have_their_own_lengths(rollout: Rollout) -> None:
    made, z, lasts = QuantitySlopes(rollout, FORMULAS, threads=1), decision(rollout, 3), [30, 7, 18]
    whole = list(made.values(z, [STEPS - 1] * 3))
    for row, (found, last) in enumerate(zip(made.values(z, lasts), lasts, strict=True)):
        np.testing.assert_array_equal(found, whole[row][: last + 1])
    assert whole[0].shape == (STEPS, 5)
    assert whole[1][0, 0] == pytest.approx(z[1, 2], abs=1e-15), "the first sample is the start"


@pytest.mark.thorough
def test_what_is_watched_has_values_beside_the_others(rollout: Rollout) -> None:
    z, lasts = decision(rollout, 2), [30, 7]
    made = QuantitySlopes(rollout, {"height": FORMULAS["height"]}, threads=1, watched={"pose": FORMULAS["pose"]})
    both = list(QuantitySlopes(rollout, FORMULAS, threads=1).values(z, lasts))
    for row, (height, pose) in enumerate(zip(made.values(z, lasts), made.values(z, lasts, ["pose"]), strict=True)):
        np.testing.assert_array_equal(np.hstack([height, pose]), both[row])
    (_, slopes), _ = made.slopes(z, np.ones((2, z.shape[1], 1)), lasts)
    assert slopes.shape == (31, 1, 1)


@pytest.mark.slow
def test_derivatives_are_those_of_adjoints(rollout: Rollout) -> None:
    made, z = QuantitySlopes(rollout, FORMULAS, threads=1), decision(rollout, 2)
    along = np.random.default_rng(1).normal(size=(2, z.shape[1], 6))
    program = rollout_program(rollout, exact=True, recorded=FORMULAS, shift=0)
    adjoint = compile_program(program, seeded=("height",), threads=1)
    values = list(made.values(z, [STEPS - 1, 20]))
    for row, (value, slopes) in enumerate(made.slopes(z, along, [STEPS - 1, 20])):
        np.testing.assert_array_equal(value, values[row])
        expected = adjoint.jacobian(z[row], "height", (0.0,))[: len(value)] @ along[row]
        assert slopes[:, 0] == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())
