"""The outcome that every solver returns: status, advice, work, trace and stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import astuple, field
from enum import Enum

from symphys.records import dataclass
from symphys.solvers.core.film import FilmPoint
from symphys.types import Array


class Status(Enum):
    """Termination status by the solver's own tests; the verdict on the problem is a separate judgement."""

    MET = "met"
    CONVERGED = "converged"
    BUDGET = "budget"
    STALLED = "stalled"
    NOT_FINITE = "not_finite"
    NOT_APPLICABLE = "not_applicable"
    FAILED = "failed"
    INTERRUPTED = "interrupted"

    @property
    def fatal(self) -> bool:
        """Whether the status ends the solve in whatever stage; values may be not finite at one smoothing only."""
        return self in (Status.NOT_APPLICABLE, Status.FAILED)


@dataclass(frozen=True)
class StopReason:
    """Why a stage of a solve ended.

    Attributes:
        status, advice: see ``Outcome``.
        whole: whether the solve ends with the stage, whatever stages are left, as it does with a fatal status.
    """

    status: Status
    advice: str = ""
    whole: bool = False

    def __str__(self) -> str:
        """Return the line of the log."""
        return ": ".join(filter(None, (self.status.value, self.advice)))


@dataclass(frozen=True)
class Counts:
    """Counts of evaluated rollouts, gradients, residual Jacobians and Hessians, line searches included."""

    rollouts: int = 0
    gradients: int = 0
    jacobians: int = 0
    hessians: int = 0

    @classmethod
    def of_slopes(cls, rows: int) -> Counts:
        """Return the work of the slopes of all steps: an adjoint for each of the ``rows`` numbers of a tangent."""
        return cls(gradients=rows)

    def __add__(self, other: Counts) -> Counts:
        """Return the sum of both counts."""
        return Counts(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def __sub__(self, other: Counts) -> Counts:
        """Return the work without that of ``other``."""
        return Counts(*(a - b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def share(self, fraction: float) -> Counts:
        """Return a fraction of the work, in whole evaluations."""
        return Counts(*(round(number * fraction) for number in astuple(self)))


@dataclass(frozen=True)
class TraceRow:
    """A row of the trace: one iteration.

    Attributes:
        iteration: from 0, the guess.
        rollouts, gradients, jacobians, hessians: cumulative counts.
        seconds: since the solve began (all earlier sessions of a continued solve included).
        objective: at this iterate (for a population: its best).
        best: lowest so far.
        max_violation: largest of the normalised errors of targets and constraints; met at 1 or below; nan without any.
        gradient_norm: nan where the solver has none.
        step: length of the step in z (CMA-ES: sigma); nan for none.
        smoothing: in force.
        outputs: by name, the problem's outputs at the best point so far, of descents over samples at the present one,
            and the solver's own of the iteration.
    """

    iteration: int
    rollouts: int
    gradients: int
    jacobians: int
    hessians: int
    seconds: float
    objective: float
    best: float
    max_violation: float
    gradient_norm: float
    step: float
    smoothing: float
    outputs: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class StageResult:
    """The result of one stage of smoothing.

    Attributes:
        smoothing: of the stage.
        status: how it ended; INTERRUPTED for one that is to go on.
        z: (n,) its best point.
        objective, max_violation: of that point at this smoothing; see ``TraceRow``. nan where nothing was evaluated.
        counts, seconds: of this stage alone.
    """

    smoothing: float
    status: Status
    z: Array
    objective: float
    max_violation: float
    counts: Counts
    seconds: float


Monitor = Callable[[TraceRow], None]
Keep = Callable[[Callable[[], dict[str, object]]], None]
"""Receives after each iteration a function that makes the checkpoint, and calls it to keep one."""


@dataclass(frozen=True)
class Outcome:
    """The result of a solve.

    Attributes:
        status: how it ended.
        advice: one sentence: what that means and what to try; empty when all is well.
        z: (n,) the best point.
        trace: one row per iteration.
        counts: total work.
        checkpoint: the data from which the solver resumes exactly; JSON-able numbers, strings and lists of numbers.
        stages: those of smoothing that were begun, in their order; of an interrupted solve the last one is halfway.
        gains: feedback about the best point, as named arrays; empty of solvers without, and of interrupted solves.
        multipliers: those of a solve that ended well, by names of the solver's own, from which another may start; empty
            where the solver has none.
        film: points along the solve of which motions are shown; of a solve that went on, those since then.
    """

    status: Status
    advice: str
    z: Array
    trace: tuple[TraceRow, ...]
    counts: Counts
    checkpoint: dict[str, object] = field(default_factory=dict)
    stages: tuple[StageResult, ...] = ()
    gains: Mapping[str, Array] = field(default_factory=dict)
    multipliers: Mapping[str, Array] = field(default_factory=dict)
    film: tuple[FilmPoint, ...] = ()
