"""Every figure that is asked for is an SVG file with a CSV file, which holds the numbers that were recorded."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from data.walker import motion as walk
from data.walker import write_walker

from symphys.report import write_run_figures
from symphys.report.figures.data import DataFigure, keep, table
from symphys.report.figures.drawing import draw_chart
from symphys.report.pages.batch import write_batch_figures
from symphys.report.robots.gait import gait_chart
from symphys.results.run import read_run
from symphys.results.scene import Scene
from symphys.results.trajectories import read_trajectory
from symphys.trajectory import Trajectory

pytestmark = pytest.mark.slow

TRUST = {
    "energy": {key: [0.0, 1.0, 2.0] for key in ("time", "kinetic", "potential", "applied", "contact")},
    "growth": {"time": [0.0, 1.0, 2.0], "factor": [4.0, 2.0, 1.0]},
}


@pytest.fixture(scope="module")
def pages(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The figures of runs of a batch, of the batch, and of a robot, to be looked at only."""
    root = Path(shutil.copytree(made, tmp_path_factory.mktemp("pages") / "batch"))
    result = root / "ball_throw" / "gradient-seed0" / "result.json"
    result.write_text(json.dumps(json.loads(result.read_text()) | {"trust": TRUST}))
    for name in ("ball_throw/gradient-seed0", "ball_throw/ipopt-seed0", "two_balls/gradient-seed0"):
        write_run_figures(root / name, root / name / "figures")
    write_batch_figures(root, root / "figures")
    (root / "robot").mkdir()
    robot = write_walker(root / "robot", walk(0.5))
    shutil.copy(root / "two_balls" / "gradient-seed0" / "result.json", robot)
    write_run_figures(robot, robot / "figures")
    return root


def columns(path: Path) -> dict[str, list[str]]:
    """The columns of a CSV file by name, without the empty cells at their ends."""
    header, *rows = csv.reader(io.StringIO(path.read_text(encoding="utf-8")))
    assert len(set(header)) == len(header) and all(len(row) == len(header) for row in rows)
    return {name: [row[k] for row in rows if row[k]] for k, name in enumerate(header)}


def numbers(path: Path) -> dict[str, list[float]]:
    """The same, of a file without words."""
    return {name: list(map(float, column)) for name, column in columns(path).items()}


@pytest.mark.slow
def test_every_figure_has_both_files(pages: Path) -> None:
    """No SVG without its CSV, which has numbers."""
    found = {path.relative_to(pages) for path in pages.rglob("figures/*")}
    assert {path.suffix for path in found} == {".svg", ".csv"}
    stems = {path.with_suffix("") for path in found}
    assert found == {stem.with_suffix(kind) for stem in stems for kind in (".svg", ".csv")}
    names = {stem.name for stem in stems}
    assert {"convergence", "contacts", "states", "motion", "growth", "energy", "variables", "controls"} <= names
    assert {"strip", "joints", "ball_throw-convergence", "ball_throw-motion"} <= names
    for path in pages.rglob("figures/*.csv"):
        assert all(columns(path).values()), path


@pytest.mark.slow
def test_states_are_those_of_the_trajectory(pages: Path) -> None:
    """To the last digit."""
    run = pages / "ball_throw" / "gradient-seed0"
    motion, found = read_trajectory(run / "trajectory.npz"), numbers(run / "figures" / "states.csv")
    wanted = {"time [s]": motion.time}
    for name, unit in (("position", "m"), ("velocity", "m/s"), ("angular_velocity", "rad/s")):
        values = motion[f"ball.{name}"]
        wanted |= {f"ball.{name}.{axis} [{unit}]": values[:, k] for k, axis in enumerate("xyz")}
    assert list(found) == list(wanted)
    assert all(np.array_equal(found[name], values) for name, values in wanted.items())


def test_contacts_are_those_of_the_trajectory(pages: Path) -> None:
    """Forces in the middle of steps, gaps at their ends; the number of points of the motion."""
    run = pages / "ball_throw" / "gradient-seed0"
    motion, found = read_trajectory(run / "trajectory.npz"), numbers(run / "figures" / "contacts.csv")
    names = ["time [s]", "ball-ground.normal force [N]", "ball-ground.tangential force [N]"]
    assert list(found) == [*names, "time [s] (2)", "ball-ground.gap [m]"]
    assert found["ball-ground.normal force [N]"] == motion.contact_force[:, 0, 2].tolist()
    assert found["time [s]"] == ((motion.time[1:] + motion.time[:-1]) / 2).tolist()
    assert found["ball-ground.gap [m]"] == motion.contact_gap[:, 0].tolist()


def test_axes_do_not_change_the_numbers(pages: Path) -> None:
    """Errors below the lowest that is drawn are as they were recorded."""
    run = read_run(pages / "ball_throw" / "gradient-seed0", pages)
    found = numbers(run.folder / "figures" / "convergence.csv")
    assert found["work [rollouts]"] == run.trace["equivalents"].tolist()
    assert found["Largest error / tolerance"] == run.trace["max_violation"].tolist()
    assert found["Objective"] == run.trace["objective"].tolist()


def test_a_batch_has_every_run_and_the_medians(pages: Path) -> None:
    found = columns(pages / "figures" / "ball_throw-convergence.csv")
    assert set(zip(found["solver"], found["seed"], strict=True)) >= {("cma", str(seed)) for seed in range(5)}
    assert "Lowest objective so far median of cma" in found
    assert "Lowest objective so far median of least_squares" not in found
    rows = [k for k, solver in enumerate(found["solver"]) if solver == "least_squares"]
    lowest = [float(found["Lowest objective so far"][k]) for k in rows]
    assert len(rows) == 10 and lowest == sorted(lowest, reverse=True)


def test_knots_and_joints_have_their_columns(pages: Path) -> None:
    push = numbers(pages / "two_balls" / "gradient-seed0" / "figures" / "variables.csv")
    assert list(push) == ["knot", "push.0", "push.0 at the guess", "push.1", "push.1 at the guess", "bounds of push"]
    assert push["knot"] == list(range(1, 481)) and push["bounds of push"] == [12]
    joints = numbers(pages / "robot" / "figures" / "joints.csv")
    assert "fl_hip.angle [rad]" in joints and len(joints["fl_hip.angle [rad]"]) == len(joints["time [s]"])
    moved = numbers(pages / "robot" / "figures" / "motion.csv")
    motion = read_trajectory(pages / "robot" / "trajectory.npz")
    assert moved["torso.position.x [m]"][-1] == motion["torso.position"][-1, 0]


def test_a_gait_has_the_times_of_each_stance(load: Callable[..., tuple[Trajectory, Scene]]) -> None:
    arrays = walk()
    arrays["contact_force"][10:20, 1, 2] = arrays["contact_force"][30:, 1, 2] = 50.0
    trajectory, scene = load(arrays)
    chart = gait_chart(trajectory, scene)
    assert chart is not None
    figure = draw_chart(chart)
    time = trajectory.time
    starts, ends = figure.blocks[0].items()
    assert starts == ("fl_shin.stands from [s]", [time[10], time[30]])
    assert ends == ("fl_shin.stands until [s]", [time[20], time[-1]])


def test_tables() -> None:
    """Columns over the same numbers share them; others follow their own; names are unique, and every cell is one."""
    figure = DataFigure()
    axes = figure.subplots()
    time = np.array([0.0, 0.1])
    keep(axes, {"time [s]": time, "a": [1.0, 2.0]})
    keep(axes, {"time [s]": time, "b": [True, False], "a": [1.0, 2.0]})
    keep(axes, {"time [s]": time, "b": [1 / 3, np.nan]})
    keep(axes, {"time [s]": [0.5], "c": ['x, "y"\n\x00']})
    assert list(csv.reader(io.StringIO(table(figure)))) == [
        ["time [s]", "a", "b", "b (2)", "time [s] (2)", "c"],
        ["0.0", "1.0", "1", "0.3333333333333333", "0.5", 'x, "y"\N{REPLACEMENT CHARACTER}\N{REPLACEMENT CHARACTER}'],
        ["0.1", "2.0", "0", "nan", "", ""],
    ]
