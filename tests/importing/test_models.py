"""Models of gymnasium after import: MuJoCo's masses, mass matrices and free motion."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from imported_models import Imported, Match, gymnasium_model, imported, matched  # noqa: E402
from imports import agreement_after  # noqa: E402
from tools.repeats import first  # noqa: E402

pytestmark = pytest.mark.skipif(not gymnasium_model("ant").path.is_file(), reason="gymnasium is not installed")
MODELS = ("half_cheetah", "ant", "hopper", "walker2d_v5", "humanoid", "reacher")
ROUNDING = 1e-10


@cache
def robot(name: str) -> tuple[Imported, Match]:
    found = imported(gymnasium_model(name), self_collision=False)
    return found, matched(found.problem.world(), found.placed, gymnasium_model(name).reference())


@pytest.mark.slow
@first("name", MODELS)
def test_masses_and_mass_matrix_at_random_poses(name: str) -> None:
    match, rng = robot(name)[1], np.random.default_rng(0)
    for _ in range(1 if match.model.nv > 20 else 3):
        qpos, _ = match.random(rng)
        mass, centre, mass_there, centre_there = match.centres(qpos)
        assert mass == pytest.approx(mass_there, rel=ROUNDING)
        assert np.abs(centre - centre_there).max() < ROUNDING
        matrix = match.mass_matrix_there(qpos)
        assert np.abs(match.mass_matrix(qpos) - matrix).max() < ROUNDING * np.abs(matrix).max()


@pytest.mark.slow
@first("name", ["half_cheetah", "ant", "inverted_double_pendulum"])
def test_free_motion_is_of_second_order(name: str) -> None:
    found = agreement_after(robot(name)[1], 0.2, batch=1)
    assert found.steps[-1] == 0.001
    assert found.errors[-1] < 1e-5
    assert found.order == pytest.approx(2, abs=0.1)
