"""The motion by names and units, as tables, figures and in a notebook; the surface, and its examples."""

from __future__ import annotations

import doctest
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from worlds.toys import require

import symphys


def test_dir_lists_what_there_is() -> None:
    assert dir(symphys) == sorted(symphys.__all__)


def test_importing_is_cheap() -> None:
    """Nothing of weight is loaded before it is used."""
    heavy = "{'casadi', 'numpy', 'scipy', 'matplotlib', 'pydantic', 'click', 'rich'} & sys.modules.keys()"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys, symphys; dir(symphys); print(sorted({heavy}))"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_a_start_loads_no_scipy() -> None:
    """Loading and compiling a problem need none of it, and it takes a third of a second."""
    code = "import sys, symphys; symphys.compile(symphys.load('ball_throw')); print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.slow
def test_a_second_start_loads_nothing_that_makes_kernels(tmp_path: Path) -> None:
    """It has neither the step of the dynamics nor what writes C; the first start has both."""
    require("simd")
    makers = ("codegen.emit.plan", "codegen.slopes", "codegen.cuda", "dynamics.step", "transcription.staged.tangent")
    code = (
        "import sys, symphys; made = symphys.compile('ball_throw'); made.gradient(made.z()); made.finish(); "
        f"print(*(name for name in {makers} if 'symphys.' + name in sys.modules))"
    )
    told = [
        subprocess.run(
            [sys.executable, "-c", code], env={**os.environ, "SYMPHYS_CACHE": str(tmp_path)},
            capture_output=True, text=True, check=True,
        ).stdout.split()
        for _ in range(2)
    ]  # fmt: skip
    assert told == [["codegen.emit.plan", "dynamics.step"], []]


EXAMPLES = (
    "CompiledRollout", "Problem", "Solution", "Trajectory", "cache", "check", "compile", "compile_step", "doctor",
    "dynamics.functions.roll_out", "export_problem", "load", "model.Heightfield", "model.Slider", "model.initial_state",
    "new", "problem.load_problem", "read", "results.runs", "schema", "show", "simulate", "solve", "solve_all",
    "step_function", "transcription.transcribe", "write_report",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "CompiledRollout":  # its quantities need a kernel
        require("simd")
    monkeypatch.chdir(tmp_path)
    room, _, last = f"symphys.{name}".rpartition(".")
    found = doctest.DocTestFinder(recurse=True).find(getattr(import_module(room), last), name, globs={})
    examples = [each for each in found if each.examples]
    assert examples
    runner = doctest.DocTestRunner()
    for each in examples:
        runner.run(each)
    assert runner.summarize().failed == 0


def test_quantities_have_names_and_units(solution: symphys.Solution) -> None:
    motion = solution.trajectory
    assert motion["ball.velocity"].shape == (26, 3) and motion.units["ball.velocity"] == "m/s"
    assert motion["ball.force"].shape == (25, 3) and motion["ball-ground.gap"].shape == (26,)
    assert np.array_equal(motion["time"], motion.time)
    for name, unit in motion.units.items():
        assert motion[name].shape[0] in (25, 26) and isinstance(unit, str)
    with pytest.raises(KeyError, match=r"ball\.position"):
        motion["ball.positon"]


def test_joints_have_names_and_units(tmp_path: Path) -> None:
    """An angle in rad, a position in m; so they have when they are read from a file."""
    made = symphys.simulate("cart_pole")
    assert (made.units["rail.position"], made.units["rail.torque"], made.units["rail.rate"]) == ("m", "N", "m/s")
    assert (made.units["pivot.angle"], made.units["pivot.rate"]) == ("rad", "rad/s")
    assert made["pivot.angle"].shape == made.time.shape


def test_tables(solution: symphys.Solution) -> None:
    """Numbers over time by name; what acts during a step has none at the end."""
    pandas, xarray = (pytest.importorskip(name) for name in ("pandas", "xarray"))
    frame = solution.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert np.array_equal(frame["ball.position.z"], solution.trajectory.position[:, 0, 2])
    assert frame["ball.force.x"].isna().sum() == 1 and frame.index.name == "time"
    assert list(solution.to_pandas("trace")["objective"]) == list(solution.trace["objective"])
    data = solution.to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert data["ball.position"].attrs["units"] == "m"
    assert float(data["ball.position"].sel(axis="z")[0]) == 1.0
    with pytest.raises(symphys.SymphysError, match="trajectory"):
        solution.to_pandas("motion")


def test_figures(solution: symphys.Solution) -> None:
    """A panel for each name, a line for each component; the motion without any."""
    figure = solution.plot("ball.position", "ball-ground.gap", "trace.objective")
    assert [len(axes.lines) for axes in figure.axes] == [3, 1, 1]
    assert figure.axes[0].get_title(loc="left") == "ball.position [m]"
    assert len(solution.plot().axes) >= 1
    with pytest.raises(symphys.SymphysError, match=r"ball\.position"):
        solution.plot("ball.positon")
    with pytest.raises(symphys.SymphysError, match="objective"):
        solution.plot("trace.objectiv")


def test_a_notebook_shows_verdict_checks_and_motion(solution: symphys.Solution) -> None:
    shown = solution._repr_html_()
    assert "solved" in shown and "there" in shown and "<iframe" in shown
    assert "<b>throw.x</b>" in shown and "m/s</td>" in shown
    assert repr(solution).startswith("<Solution of problem by least_squares: solved")


def test_a_contact_goes_by_its_two_surfaces() -> None:
    """Who asks a motion for the force of contacts on a body is told the names that there are."""
    motion = symphys.simulate("ball_throw")
    with pytest.raises(KeyError, match=r"ball-ground.*force"):
        motion["ball.contact_force"]
    with pytest.raises(KeyError, match=r"ball.position, ball.orientation"):
        motion["ball.colour"]
    with pytest.raises(KeyError, match=r'"ball.velocity"'):
        motion["ball.velocty"]
