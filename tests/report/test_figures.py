"""Figures show the recorded numbers: medians, thinning, views, contact forces and ratios are what they are called."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest

from symphys.report.charts import palette
from symphys.report.charts.contacts import pair_normals, shown_pairs
from symphys.report.charts.convergence import Curve, best_so_far, median_curve, violation_so_far
from symphys.report.charts.tables import thin
from symphys.report.figures import style
from symphys.report.pages.check_figure import limits, ratios
from symphys.report.scene.motion import draw_motion
from symphys.report.scene.views import SIDE_XZ, SIDE_YZ, TOP, TOP_TURNED, choose_views, turn
from symphys.results.discovery import read_all, studies
from symphys.results.run import read_run
from symphys.results.scene import Scene, ScenePlane, read_scene
from symphys.results.trace import Trace
from symphys.results.trajectories import read_trajectory
from symphys.trajectory import Trajectory

GROUND = Scene(planes=(ScenePlane("ground", np.array([0.0, 0.0, 1.0]), 0.0),))


@pytest.fixture
def motion(made: Path) -> Trajectory:
    return read_trajectory(made / "ball_throw" / "gradient-seed0" / "trajectory.npz")


def test_median_of_step_functions() -> None:
    curves = [Curve(np.array([1.0, 2, 3]), np.array([9.0, 5, 1])), Curve(np.array([1.0]), np.array([4.0]))]
    curves.append(Curve(np.array([2.0, 4]), np.array([6.0, 0])))
    middle = median_curve(curves)
    assert middle.x.tolist() == [2, 3, 4]
    assert middle.y.tolist() == [5, 4, 1]


def test_best_and_miss_only_fall(made: Path) -> None:
    trace = Trace({"objective": np.array([3.0, np.nan, 4, 1]), "max_violation": np.array([9.0, 2, 5, np.nan])}, 4)
    run = replace(read_run(made / "ball_throw" / "gradient-seed0", made), trace=trace)
    assert best_so_far(run).tolist() == [3, 3, 3, 1]
    assert violation_so_far(run).tolist() == [9, 2, 2, 2]


def test_thinning_keeps_spikes() -> None:
    values = np.zeros((20_000, 2))
    values[777, 0], values[15_001, 1] = 5.0, -3.0
    time, thinned = thin(np.arange(20_000.0), values)
    assert len(time) < 1500
    assert (thinned[:, 0].max(), thinned[:, 1].min()) == (5, -3)
    assert (time[0], time[-1]) == (0, 19_999)


def test_views_are_chosen_by_the_motion(motion: Trajectory) -> None:
    assert choose_views(motion, GROUND) == [SIDE_XZ, TOP]
    turned = replace(motion, position=motion.position[..., [1, 0, 2]])
    assert choose_views(turned, GROUND) == [SIDE_YZ, TOP_TURNED]
    flat = replace(motion, position=motion.position * [1, 1, 0])
    assert choose_views(flat, Scene()) == [TOP]
    assert choose_views(flat, GROUND) == [SIDE_XZ, TOP]
    dropped = replace(motion, position=motion.position * [0, 0, 1])
    assert choose_views(dropped, GROUND) == [SIDE_XZ]


def test_turned_direction() -> None:
    quarter = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    assert np.allclose(turn(quarter, np.array([1.0, 0, 0])), [0, 1, 0])


def test_normals_of_pairs(made: Path, motion: Trajectory) -> None:
    scene = read_scene(made / "ball_throw" / "gradient-seed0" / "scene.json")
    assert dict(pair_normals(motion, scene))["ball-ground"].tolist() == [0, 0, 1]
    run = made / "two_balls" / "gradient-seed0"
    pushed = read_trajectory(run / "trajectory.npz")
    normal = dict(pair_normals(pushed, read_scene(run / "scene.json")))["cue-eight"]
    assert normal.shape == (480, 3)
    assert np.allclose(normal[0], -np.array([1, 1, 0]) / np.sqrt(2))


def test_busiest_pairs_come_first(motion: Trajectory) -> None:
    force = np.zeros((500, 9, 3))
    force[3, [2, 7], 2] = [1.0, 5.0]
    several = replace(motion, contact_names=tuple("abcdefghi"), contact_force=force, contact_gap=np.ones((501, 9)))
    assert shown_pairs(several) == [7, 2]
    assert len(shown_pairs(replace(several, contact_force=0 * force))) == 6


def test_ratios_by_check_and_solver(made: Path) -> None:
    runs, broken = read_all(made)
    assert [run.place for run in broken] == ["elsewhere", "two_balls/cma-seed0"]
    thrown = studies(runs)[0]
    found = ratios(thrown)
    assert found["comes to rest at 10 m"]["gradient"].shape == (5,)
    assert found["comes to rest at 10 m"]["ipopt"].tolist() == [np.inf]
    low, high = limits(found)
    assert low <= 0.1 < 10 <= high


def test_best_run_is_solved_with_the_lowest_objective(made: Path) -> None:
    runs, _ = read_all(made)
    thrown = studies(runs)[0]
    assert thrown.best.objective == min(run.objective for run in thrown.runs if run.solved)


def test_colours_of_known_solvers_do_not_depend_on_the_others() -> None:
    marks = palette.solver_marks(["zeta", "cma", "alpha", "gradient"])
    assert marks["cma"] == palette.solver_marks(["cma"])["cma"]
    assert len(set(marks.values())) == 4


def test_settings_do_not_leak(motion: Trajectory) -> None:
    before = dict(matplotlib.rcParams)
    with style.paper():
        first, second = (style.picture("motion", "", draw_motion(motion, GROUND))[0].svg for _ in range(2))
    assert dict(matplotlib.rcParams) == before
    assert first == second
    assert "DOCTYPE" not in first
