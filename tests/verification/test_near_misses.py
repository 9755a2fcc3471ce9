"""Near misses and glancing touches: by how much, and what change of which variable would make or lose the touch."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.findings.physics import RESIDUAL_LIMITS
from symphys.transcription import Transcription
from symphys.verification import survey
from symphys.verification.examination import compare_gradient
from symphys.verification.near_misses import near_misses
from symphys.verification.refinement import UNSETTLED, settling

THROW = """
[simulation]
duration = 1.0
dt = 0.01
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1
position = [0, 0, 0.1]
velocity = [7, 0, 7]
[ground]
[[block]]
name = "wall"
shape = { box = { size = [0.2, 4, 2.4] } }
position = [5, 0, 1.2]
[[variable]]
name = "vz"
sets = "ball.velocity[2]"
guess = 6.8705
spread = 0.5
[[variable]]
name = "place"
sets = "wall.position[2]"
guess = 1.2
scale = 0.1
[[variable]]
name = "push"
sets = "ball.force[2]"
[variable.control]
[[cost]]
name = "distance"
value = "-ball.position[0]"
"""


def wall(of: Transcription, z: np.ndarray) -> dict:
    (found,) = [row for row in near_misses(of, of.record(z)) if row["contact"] == "ball-wall"]
    return found


@pytest.fixture(scope="module")
def throw(tmp_path_factory):
    from symphys.problem import load_problem
    from symphys.transcription import transcribe

    path = tmp_path_factory.mktemp("throw") / "throw.toml"
    path.write_text(THROW.replace("[variable.control]\n", ""), encoding="utf-8")
    return transcribe(load_problem(path), backend="casadi")


def touches(of: Transcription, z: np.ndarray) -> bool:
    motion = of.record(z).motion
    columns = [c for c, name in enumerate(motion.contact_names) if name.startswith("ball-wall")]
    return bool(np.abs(motion.contact_force[:, columns]).sum() > 0)


@pytest.mark.slow
@pytest.mark.parametrize("vz", [6.88, 6.8705, 6.866, 6.86])
def test_the_change_that_makes_or_loses_a_touch(throw, vz):
    """A little more than what is told makes the touch, or loses it; a little less does not."""
    z = throw.shooting.start(0)
    z[0] = vz
    row = wall(throw, z)
    assert row["touches"] == touches(throw, z)
    assert row["variable"] == "vz"
    sign = 1 if row["touches"] else -1
    assert 1e-3 < row["change"] < 0.02
    for share, changed in ((0.9, False), (1.1, True)):
        near = z.copy()
        near[0] += sign * share * row["change"]
        assert (touches(throw, near) != row["touches"]) == changed


@pytest.mark.slow
def test_the_slope_of_a_gap_is_that_of_differences(throw):
    """By a velocity, a place of the wall and a force together, in scales and in spreads."""
    z = throw.shooting.start(0)
    row, slopes = wall(throw, z), []
    for i in range(z.size):
        ends = []
        for step in (1e-5, -1e-5):
            near = z.copy()
            near[i] += step
            ends.append(wall(throw, near)["gap"])
        slopes.append((ends[0] - ends[1]) / 2e-5)
    scales = np.concatenate([block.scale for block in throw.shooting.blocks])
    assert slopes[1] == pytest.approx(-1, abs=0.05)
    assert row["gap"] / row["steps"] == pytest.approx(np.linalg.norm(slopes * scales), rel=2e-2)
    assert row["gap"] / row["spreads"] == pytest.approx(0.5 * abs(slopes[0]), rel=2e-2)


@pytest.mark.slow
def test_what_bounces_or_flies_far_away_is_no_near_miss(throw):
    z = throw.shooting.start(0)
    z[0] = 9.0
    assert wall(throw, z)["spreads"] > 1
    assert not [row for row in near_misses(throw, throw.record(z)) if row["touches"]]


HELD = """
[simulation]
duration = 0.2
dt = 0.01
[[body]]
name = "box"
shape = { box = { size = [0.2, 0.2, 0.2] } }
mass = 1
position = [0, 0, 0.1]
[ground]
friction = 0.9
[[variable]]
name = "push"
sets = "box.force[0]"
guess = 1
[[cost]]
name = "far"
value = "-box.position[0]"
"""


@pytest.mark.slow
def test_a_variable_that_changes_nothing_is_not_felt(make):
    """Friction holds the box; with ten times the push it slides."""
    held = make(HELD)
    assert compare_gradient(held, np.array([1.0]))[0]["felt"] < 1e-8
    assert compare_gradient(held, np.array([30.0]))[0]["felt"] > 1e-3


@pytest.mark.slow
def test_more_sweeps_are_looked_at_where_contacts_have_not_settled(make):
    """A heavy ball on a light one: two sweeps are too few, and four leave less."""
    pile = make(PILE, simulation__sweeps=2)
    z = pile.shooting.start(0)
    residual = float(pile.record(z).motion.residual.max())
    assert settling(pile, z, residual, 1e9 * residual) == {}
    told = settling(pile, z, residual, residual)
    more = make(PILE, simulation__sweeps=4).record(z).motion.residual.max()
    assert told == {"residual_finer": more}


@pytest.mark.slow
def test_where_impulses_have_not_settled_other_numbers_of_sweeps_are_tried(make):
    """A ball on one a hundredth as heavy: the rows are what the problem gives with 3 and 4 sweeps in place of 2."""
    pile = make(HEAVIER, simulation__sweeps=2)
    z = pile.shooting.start(0)
    found = survey(pile, pile.record(z))
    assert found["residual"] > UNSETTLED * found["impulse"] and found["unsettled"] > 0
    judged = [make(HEAVIER, simulation__sweeps=sweeps).judge(z) for sweeps in (3, 4)]
    assert [row["what"] for row in found["resettled"]] == ["sweeps + 1", "sweeps x 2"]
    assert [row["objective"] for row in found["resettled"]] == [verdict.objective for verdict in judged]
    assert [row["worst"] for row in found["resettled"]] == [verdict.worst for verdict in judged]
    settled = make(HEAVIER, simulation__sweeps=30)
    again = survey(settled, settled.record(z))
    assert again["unsettled"] == 0 and "resettled" not in again


def test_examinations_and_findings_agree_on_what_has_not_settled():
    assert RESIDUAL_LIMITS[1] == UNSETTLED


HEAVY = """
[[body]]
name = "heavy"
shape = { sphere = { radius = 0.1 } }
mass = 20
position = [0, 0, 0.3]
[[variable]]
"""
PILE = HELD.replace("[[variable]]", HEAVY, 1).replace("box = { size = [0.2, 0.2, 0.2] }", "sphere = { radius = 0.1 }")
"""A heavy ball on a light one."""
HEAVIER = PILE.replace("mass = 20", "mass = 100")
