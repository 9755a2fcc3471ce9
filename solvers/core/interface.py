"""The interface of solvers, and that of methods: ``init``, ``step``, ``terminate``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, Generic, Protocol, TypeVar

from symphys.records import dataclass
from symphys.shooting import ShootingProblem
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.outcome import Counts, Keep, Monitor, Outcome, StopReason
from symphys.solvers.core.point import Point
from symphys.types import Array

Log = Callable[[str], None]
"""Takes one line of text."""

O_contra = TypeVar("O_contra", contravariant=True)
O_inv = TypeVar("O_inv")
StateT = TypeVar("StateT")


@dataclass(frozen=True)
class StageContext:
    """The inputs of a method in one stage of smoothing.

    Attributes:
        evaluator: of the problem at the smoothing of the stage; its incumbent is the best point of the stage.
        start: (n,) where the stage begins, within the bounds.
        seed: of the solve.
        log: takes the method's own text.
    """

    evaluator: CountingEvaluator
    start: Array
    seed: int
    log: Log


@dataclass(frozen=True)
class Iteration(Generic[StateT]):
    """The result of one iteration: the state after it, and the values for the trace.

    Attributes:
        state: all that the next step depends on; a dataclass of numbers, arrays and dataclasses of these.
        point: of the row of the trace; None: the iteration gets no row, and a solve does not go on from it.
        gradient_norm, step, outputs: see ``TraceRow``.
    """

    state: StateT
    point: Point | None
    gradient_norm: float = math.nan
    step: float = math.nan
    outputs: Mapping[str, float] = field(default_factory=dict)


class Method(Protocol[StateT]):
    """A method of optimisation in one stage. The driver runs the loop: ``init``, then ``step`` until ``terminate``.

    As in optimistix a method has no loop and stores no progress: all of it is in the state. An evaluation ends the
    stage by itself once a point meets everything, see ``Stop``. The budget of a method is an option of it, so
    ``terminate`` compares the state with it, and its advice names the option. Limits of the whole solve are in
    ``SolverOptions``, and the driver compares with them.
    """

    def init(self) -> Iteration[StateT] | StopReason:
        """Evaluate the start; return the reason where no step can be made from there."""
        ...

    def step(self, state: StateT) -> Iteration[StateT] | StopReason:
        """Make one iteration; return the reason where no step is possible."""
        ...

    def terminate(self, state: StateT) -> StopReason | None:
        """Return why to end: a stationary point, a used budget, no progress; None to make another step."""
        ...

    def conclude(self, state: StateT, reason: StopReason) -> StopReason:
        """Finish where a limit of the solve ends it; return the reason, perhaps with other advice."""
        return reason

    def resume(self, saved: dict[str, Any]) -> StateT:
        """Make the state from the plain values of a checkpoint; SymphysError if they do not fit."""
        ...


class IterationRecorder(Protocol):
    """Records iterations: the driver, as seen by a library with a loop of its own."""

    def commit(self, iteration: Iteration[Any]) -> None:
        """End an iteration: a row of the trace, a checkpoint, then the monitor, which may raise KeyboardInterrupt."""
        ...

    def spent(self) -> StopReason | None:
        """Return why a limit of the solve ends it after the last row, see ``SolverOptions``; None to go on."""
        ...

    def distribute(self, work: Counts, first: int) -> None:
        """Add work that a library reports only at its end, evenly over the rows from ``first`` on."""
        ...

    def multipliers(self, found: Mapping[str, Array]) -> None:
        """Set the multipliers of the present iterate, part of the outcome if the solve ends well there."""
        ...

    @property
    def rows(self) -> int:
        """The number of rows so far."""
        ...


class Solve(Protocol[O_contra]):
    """Minimise the merit from ``start``.

    Args of the call:
        problem: objective, constraints and bounds.
        start: (n,) where to begin; a seed's perturbation of the guess is already in it.
        options: of the solver.
        seed: the random stream is ``numpy.random.default_rng([seed, 1])``, the same for every solver that draws.
        monitor: takes each row of the trace; it may raise KeyboardInterrupt, which ends the solve so that it can go on.
        checkpoint: ``Outcome.checkpoint`` of an interrupted solve; from it the solve goes on.
        log: takes the solver's own text.
        keep: is offered a checkpoint after each iteration, for what may end without an interruption.

    Raises SymphysError for options that cannot be, and for a checkpoint of another solver or problem;
    every other failure is a status.
    """

    def __call__(
        self,
        problem: ShootingProblem,
        start: Array,
        options: O_contra,
        seed: int = 0,
        monitor: Monitor | None = None,
        checkpoint: dict[str, object] | None = None,
        log: Log | None = None,
        keep: Keep | None = None,
    ) -> Outcome:
        """Solve."""
        ...


def never(problem: ShootingProblem) -> bool:
    """Return False: most solvers evaluate rollouts."""
    return False


def nothing() -> None:
    """Load nothing: most solvers need no library."""


@dataclass(frozen=True)
class Solver(Generic[O_inv]):
    """A solver: name, options and the function that solves.

    Attributes:
        name: as in ``--solver`` and ``[solver.NAME]``.
        summary: one line for people.
        Options: frozen dataclass of plain values, each with a default; ValueError where a value cannot be. Those of
            a solver that the driver runs are ``SolverOptions``.
        solve: see ``Solve``.
        prepare: loads what ``solve`` needs, such as a library, so that who times solves can leave it out; ``solve``
            works without, and a second call costs nothing.
        threaded: whether several solves may run in threads side by side, see ``multi_start``.
        scenarios: whether it is for problems with scenarios, and for no others; None: for all.
        by_steps: of which problems it evaluates by ``ShootingProblem.by_steps`` where there is that.
        confirms: whether it ends only where what it meets is confirmed, see ``ShootingProblem.confirms``.
    """

    name: str
    summary: str
    Options: type[O_inv]
    solve: Solve[O_inv]
    prepare: Callable[[], object] = nothing
    threaded: bool = False
    scenarios: bool | None = False
    by_steps: Callable[[ShootingProblem], bool] = never
    confirms: bool = False
