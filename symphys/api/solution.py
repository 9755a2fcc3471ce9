"""What a solve found, by the names of the problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from symphys.api import figures, notebook, tables
from symphys.errors import SymphysError
from symphys.problem import Problem, load_problem
from symphys.results.archives import read_archive
from symphys.results.config import read_config
from symphys.results.discovery import is_run
from symphys.results.file_names import CONFIG, GAINS, PROBLEM, TRAJECTORY
from symphys.results.result import CheckRecord
from symphys.results.run import Run, read_run
from symphys.results.text_files import ReportError
from symphys.results.trace import Trace
from symphys.results.trajectories import read_trajectory
from symphys.suggest import hint, quote
from symphys.trajectory import Trajectory
from symphys.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from symphys.runs.replay import Replay


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """One solve: what was found, and how well it does in the exact rollout.

    In a notebook it shows its verdict, its checks and its motion.

    Attributes:
        folder: the run folder that it is read from.
        run: everything that result.json holds: ``counts``, ``seconds``, ``stages``, ``trust``, ``versions``, ...
        given: the problem that was solved, where it is at hand.
    """

    folder: Path
    run: Run
    given: Problem | None = None

    @property
    def solved(self) -> bool:
        """Whether every target, constraint and goal is met by a motion that can be relied on."""
        return self.run.solved

    @property
    def verdict(self) -> str:
        """A word: "solved", "doubted", "best", "not solved", ...; see the documents on verification."""
        return self.run.verdict

    @property
    def advice(self) -> str:
        """How the solver ended, and what to try where it did not come there."""
        return self.run.advice

    @property
    def objective(self) -> float:
        """Of the exact rollout."""
        return self.run.objective

    @property
    def costs(self) -> Mapping[str, float]:
        """Each cost's share of the objective, weighted, by name."""
        return self.run.costs

    @property
    def outputs(self) -> Mapping[str, float]:
        """The problem's reported numbers, by name and unit: ``{"speed [m/s]": 2.4}``."""
        return self.run.outputs

    @property
    def checks(self) -> tuple[CheckRecord, ...]:
        """Targets, constraints and goal, each with its error and tolerance, and whether it is met."""
        return self.run.checks

    @cached_property
    def value(self) -> dict[str, Array]:
        """The variables by name: (components,), or (knots, components) where there are several knots; SI units."""
        found = {name: each.value for name, each in self.run.z.items()}
        return {name: value[:, 0] if value.shape[1] == 1 else value.T for name, value in found.items()}

    @cached_property
    def trajectory(self) -> Trajectory:
        """The motion, exactly: arrays over time, such as ``trajectory["ball.position"]`` (N + 1, 3)."""
        return read_trajectory(self.folder / TRAJECTORY)

    @cached_property
    def gains(self) -> dict[str, Array]:
        """Feedback about the motion, of solvers that find it (``ilqr``): the arrays of gains.npz; of others none."""
        path = self.folder / GAINS
        return read_archive(path) if path.exists() else {}

    def rollout(self, start: ArrayLike | Mapping[str, ArrayLike] | None = None, feedback: bool = True) -> Trajectory:
        """The motion from another start, with controls that answer what the state is off by the gains.

        Args:
            start: what differs from the problem's first state, by name as ``Controller`` takes it: ``shoulder.angle``,
                ``rail.rate``, ``ball.position``; or the whole state (nx,). None: nothing does.
            feedback: whether the gains act; else the controls are as they were found.

        Raises:
            SymphysError: the solver found no gains, or there is no such name.
            NotFinite: as ``simulate``.
        """
        from symphys.api.simulation import follow  # late: most read, and roll nothing out

        if not self.gains:
            text = f"{self.folder}: there is no {GAINS}; ilqr finds gains, where its solve was not interrupted"
            raise SymphysError(text)
        return follow(self.problem, self.gains, start, feedback)

    @property
    def trace(self) -> Trace:
        """The iterations, column by column: ``trace["objective"]``, ``trace["seconds"]``, ..."""
        return self.run.trace

    @cached_property
    def problem(self) -> Problem:
        """What was solved; where it is read from the folder, ProblemError if it has controllers that Python gives."""
        if self.given is not None:
            return self.given
        read_in = load_problem(self.folder / PROBLEM, read_config(self.folder / CONFIG).settings)
        return replace(read_in, name=self.run.problem)

    def plot(self, *names: str) -> Figure:
        """A figure of the motion from the side and from above, or of quantities against time.

        Args:
            names: none for the motion; else quantities of the trajectory, ``"ball.position"``, ``"knee.angle"``,
                ``"ball-ground.force"``, or columns of the trace, ``"trace.objective"``: a panel each.
        """
        if not names:
            return figures.draw(self.folder, self.trajectory)
        return figures.plot(self.trajectory, self.trace, names)

    def report(self) -> Path:
        """Write the full page of the run into its folder, with its figures as SVG and CSV; the path of the page."""
        from symphys.report import write_run_report

        return write_run_report(self.folder)

    def replay(self) -> Replay:
        """Roll out what was found again, from the problem and the settings in its folder, and compare to the bit.

        Returns:
            ``same``, the ``differences`` of quantities, and which versions and processor are not those of the run.

        Raises:
            SymphysError: a file is missing or damaged, or the solver found nothing.
        """
        from symphys.runs.replay import replay  # late: most read, and roll nothing out

        return replay(self.folder)

    def save_figures(self, folder: str | Path) -> list[Path]:
        """Write every figure of the report into a folder: NAME.svg, and NAME.csv with the numbers that it shows.

        A column of a table belongs to the nearest column of time, work or knots to its left.

        Returns:
            Their paths. There are motion, states, contacts and convergence, and, where there is something to show,
            variables, controls, joints, motors, gait, strip, growth and energy.

        Example:
            >>> import symphys
            >>> solution = symphys.solve("ball_throw", "least_squares", backend="casadi")
            >>> sorted({path.stem for path in solution.save_figures("paper")})
            ['contacts', 'convergence', 'energy', 'motion', 'states']
        """
        from symphys.report import write_run_figures

        return write_run_figures(self.folder, Path(folder))

    def to_pandas(self, what: str = "trajectory") -> Any:
        """A pandas.DataFrame: "trajectory", a row for each time, or "trace", a row for each iteration."""
        if what not in ("trajectory", "trace"):
            raise SymphysError(f"there is no table {quote(what)}; {hint(what, ('trajectory', 'trace'))}")
        return tables.trace_frame(self.trace) if what == "trace" else tables.motion_frame(self.trajectory)

    def to_xarray(self) -> Any:
        """An xarray.Dataset of the trajectory, with units."""
        return tables.to_xarray(self.trajectory)

    def __repr__(self) -> str:
        """The verdict in a line."""
        return notebook.line(self.run)

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return notebook.html(self.run)


def read(folder: str | Path) -> Solution:
    """The solution in a run folder, which ``symphys solve`` or ``solve`` with a ``folder`` has written.

    Raises:
        SymphysError: it is no run folder, or has no result that can be read.

    Example:
        >>> import symphys
        >>> solution = symphys.solve("ball_throw", "least_squares", backend="casadi", folder="reports")
        >>> symphys.read("reports/ball_throw/least_squares-seed0").solved
        True
    """
    path = Path(folder)
    if not path.is_dir() or not is_run([each.name for each in path.iterdir()]):
        raise SymphysError(f"{path}: no run folder; one holds result.json, as reports/ball_throw/gradient-seed0 does")
    run = read_run(path, path)
    if not run.readable:
        raise ReportError("; ".join(run.faults))
    return Solution(path, run)
