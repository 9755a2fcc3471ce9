"""What a run folder holds, as frozen records; ``nan`` is a number that is not known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.findings.examination import Trust
from symphys.findings.levels import Judged
from symphys.results.stage_record import Stage

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class ReportError(SymphysError):
    """A folder or file from which no report can be made."""


@dataclass(frozen=True)
class Check:
    """A target, constraint or goal.

    Attributes:
        kind: "target", "constraint" or "goal".
        name: as in the problem file.
        error: in its own unit.
        tolerance: in its own unit.
        ratio: error against tolerance: met where <= 1.
        met: as the run judged it.
    """

    kind: str
    name: str
    error: float
    tolerance: float
    ratio: float
    met: bool


@dataclass(frozen=True)
class Variable:
    """One named block of z.

    Attributes:
        name: in the problem file.
        sets: the quantities that it sets, as the problem file writes them where that can be read.
        value, guess, lower, upper: (components, knots).
    """

    name: str
    sets: tuple[str, ...]
    value: Array
    guess: Array
    lower: Array
    upper: Array


TOLD = "told: "


@dataclass(frozen=True)
class Trace:
    """The iterations of a solve, column by column; a column that the file lacks is all nan.

    Columns whose names begin with ``TOLD`` are what problems and solvers tell.

    Attributes:
        columns: name -> (rows,).
        rows: how many.
    """

    columns: Mapping[str, Array]
    rows: int

    def __getitem__(self, name: str) -> Array:
        """(rows,): the column called ``name``."""
        return self.columns.get(name, np.full(self.rows, np.nan))

    @property
    def told(self) -> list[str]:
        """The names of what is told."""
        return [name.removeprefix(TOLD) for name in self.columns if name.startswith(TOLD)]


@dataclass(frozen=True)
class Effort:
    """What a solve took.

    Attributes:
        iterations: of the solver.
        counts: evaluations by kind.
        price: of one evaluation by kind, in rollouts.
        equivalents: the whole work in rollouts.
        seconds: wall time by phase.
    """

    iterations: float
    counts: Mapping[str, float]
    price: Mapping[str, float]
    equivalents: float
    seconds: Mapping[str, float]


@dataclass(frozen=True)
class Origin:
    """Where a result comes from: versions and platform by name, time, command, what evaluated the functions."""

    versions: Mapping[str, str]
    when: str
    command: str
    backend: str


@dataclass(frozen=True)
class Run:
    """One run folder.

    Attributes:
        folder: where it is.
        place: the folder's path below the report's folder, with forward slashes.
        readable: whether there is a result; if not, only names and ``faults`` mean anything.
        faults: what could not be read, one sentence each.
        solved: the same as a verdict of "solved".
        met: whether nothing is missed.
        verdict: a word of ``symphys.findings.verdict``; of an older run made from what it measured.
        doubts: why its motion is not to be relied on.
        outputs: what the problem tells of the result, by names with units.
        guess: "objective", "worst" and what is told of what it started from, exactly.
    """

    folder: Path
    place: str
    readable: bool
    problem: str
    title: str
    description: str
    solver: str
    seed: int
    solved: bool
    met: bool
    verdict: str
    doubts: tuple[str, ...]
    status: str
    advice: str
    objective: float
    costs: Mapping[str, float]
    outputs: Mapping[str, float]
    checks: tuple[Check, ...]
    variables: tuple[Variable, ...]
    effort: Effort
    trust: Trust
    origin: Origin
    trace: Trace
    guess: Mapping[str, float]
    stages: tuple[Stage, ...]
    faults: tuple[str, ...]

    @property
    def judged(self) -> Judged:
        """How it was judged."""
        goal = any(check.kind == "goal" for check in self.checks)
        costs = np.nan if goal else sum(self.costs.values())
        return Judged(self.objective, self.worst, self.met, bool(self.checks), costs)

    @property
    def worst(self) -> float:
        """Largest error / tolerance; inf where one is nan; nan without checks."""
        ratios = [np.inf if np.isnan(check.ratio) else check.ratio for check in self.checks]
        return max(ratios, default=np.nan)


@dataclass(frozen=True)
class Trajectory:
    """The recorded motion, as in trajectory.npz: N steps, B bodies, C contacts; world frame, SI units.

    J joints of K coordinates at most, none in older records; see ``symphys.trajectory``.
    """

    time: Array
    body_names: tuple[str, ...]
    position: Array
    orientation: Array
    velocity: Array
    angular_velocity: Array
    force: Array
    torque: Array
    contact_names: tuple[str, ...]
    contact_force: Array
    contact_gap: Array
    joint_names: tuple[str, ...]
    joint_value: Array
    joint_rate: Array
    joint_torque: Array
    joint_command: Array
    joint_separation: Array
