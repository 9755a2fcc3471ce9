"""Solutions: the results of solves, by the names that the problem uses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from symphys.api import views
from symphys.errors import SymphysError
from symphys.problem import Problem, load_problem
from symphys.records import dataclass
from symphys.results.config import read_config
from symphys.results.discovery import is_run_folder
from symphys.results.file_names import CONFIG, GAINS, PROBLEM, TRAJECTORY
from symphys.results.result import CheckRecord
from symphys.results.run import Run, read_run
from symphys.results.text_files import ReportError, read_archive
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
    """The result of one solve, judged by the exact rollout.

    In a notebook it shows its verdict, its checks and its motion.

    Attributes:
        folder: the run folder that it is read from.
        run: everything that result.json holds: ``counts``, ``seconds`` [s], ``stages``, ``trust``, ``versions``, ...
        given: the problem that was solved; None if it is read from the folder when it is needed.
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
        """The verdict in a word: "solved", "doubted", "best", "not solved", ...; the documents define them."""
        return self.run.verdict

    @property
    def advice(self) -> str:
        """The reason why the solver ended, and what to try if it did not reach a solution."""
        return self.run.advice

    @property
    def objective(self) -> float:
        """The objective of the exact rollout."""
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
        """The variables by name, SI units: (components,), or (knots, components) of variables with several knots."""
        found = {name: each.value for name, each in self.run.z.items()}
        return {name: value[:, 0] if value.shape[1] == 1 else value.T for name, value in found.items()}

    @cached_property
    def trajectory(self) -> Trajectory:
        """The motion of the exact rollout, world frame, SI units: ``trajectory["ball.position"]`` (N + 1, 3)."""
        return read_trajectory(self.folder / TRAJECTORY)

    @cached_property
    def gains(self) -> dict[str, Array]:
        """The feedback gains about the motion, arrays of gains.npz; empty unless the solver finds them (``ilqr``)."""
        path = self.folder / GAINS
        return read_archive(path) if path.exists() else {}

    def rollout(self, start: ArrayLike | Mapping[str, ArrayLike] | None = None, feedback: bool = True) -> Trajectory:
        """Simulate from another start; the gains correct the controls by the deviation of the state.

        Args:
            start: quantities of the first state that differ from the problem's, by name as ``Controller`` takes them:
                ``shoulder.angle``, ``rail.rate``, ``ball.position``; or the whole state (nx,). None: the problem's.
            feedback: whether the gains act; otherwise the controls are those of the solution.

        Raises:
            SymphysError: the solver found no gains, or there is no such name.
            NotFinite: a number of the motion is not finite; names the time step and the body.
        """
        from symphys.api.simulation import follow  # late: it needs the dynamics, which reading a solution does not

        if not self.gains:
            text = f"{self.folder}: there is no {GAINS}; ilqr finds gains, where its solve was not interrupted"
            raise SymphysError(text)
        return follow(self.problem, self.gains, start, feedback)

    @property
    def trace(self) -> Trace:
        """The iterations, an array for each column: ``trace["objective"]``, ``trace["seconds"]`` [s], ..."""
        return self.run.trace

    @cached_property
    def problem(self) -> Problem:
        """The problem that was solved; ProblemError if the folder's has controllers with functions given in Python."""
        if self.given is not None:
            return self.given
        read_in = load_problem(self.folder / PROBLEM, read_config(self.folder / CONFIG).settings)
        return replace(read_in, name=self.run.problem)

    def plot(self, *names: str) -> Figure:
        """Draw the motion from the side and from above, or plot quantities against time.

        Args:
            names: none for the motion; else quantities of the trajectory, ``"ball.position"``, ``"knee.angle"``,
                ``"ball-ground.force"``, or columns of the trace, ``"trace.objective"``: a panel each.
        """
        if not names:
            return views.draw_run(self.folder, self.trajectory)
        return views.plot(self.trajectory, self.trace, names)

    def report(self) -> Path:
        """Write the page of the run into its folder; return the page's path."""
        from symphys.report import write_run_report

        return write_run_report(self.folder)

    def replay(self) -> Replay:
        """Simulate the solution again from the files of its folder, and compare bit for bit.

        Returns:
            ``same``, the ``differences`` of quantities, and which versions and processor are not those of the run.

        Raises:
            SymphysError: a file is missing or damaged, or the solver found nothing.
        """
        from symphys.runs.replay import replay  # late: it needs the dynamics, which reading a solution does not

        return replay(self.folder)

    def save_figures(self, folder: str | Path) -> list[Path]:
        """Write every figure of the report into a folder: NAME.svg, and NAME.csv with the numbers that it shows.

        The abscissa of a column of a CSV file is the nearest column of time, work or knots to its left.

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
        """Return a pandas.DataFrame: "trajectory", a row for each time, or "trace", a row for each iteration."""
        if what not in ("trajectory", "trace"):
            raise SymphysError(f"there is no table {quote(what)}; {hint(what, ('trajectory', 'trace'))}")
        return views.trace_frame(self.trace) if what == "trace" else views.motion_frame(self.trajectory)

    def to_xarray(self) -> Any:
        """Return an xarray.Dataset of the trajectory, with units; what acts during a step ends with nan."""
        return views.motion_dataset(self.trajectory)

    def __repr__(self) -> str:
        """Return the verdict in a line."""
        return views.line(self.run)

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        return views.html(self.run)


def read(folder: str | Path) -> Solution:
    """Read the solution in a run folder, which ``symphys solve`` or ``solve`` with a ``folder`` has written.

    Args:
        folder: the run folder, such as ``reports/ball_throw/gradient-seed0``.

    Raises:
        SymphysError: it is no run folder, or has no result that can be read.

    Example:
        >>> import symphys
        >>> solution = symphys.solve("ball_throw", "least_squares", backend="casadi", folder="reports")
        >>> symphys.read("reports/ball_throw/least_squares-seed0").solved
        True
    """
    path = Path(folder)
    if not is_run_folder(path):
        raise SymphysError(f"{path}: no run folder; one holds result.json, as reports/ball_throw/gradient-seed0 does")
    run = read_run(path, path)
    if not run.readable:
        raise ReportError("; ".join(run.faults))
    return Solution(path, run)
