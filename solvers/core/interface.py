"""What every solver looks like from outside."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from symphys.shooting import ShootingProblem
from symphys.solvers.core.outcome import Array, Monitor, Outcome

Log = Callable[[str], None]
"""Takes one line of text."""

O_contra = TypeVar("O_contra", contravariant=True)
O_inv = TypeVar("O_inv")


class Solve(Protocol[O_contra]):
    """Minimise the merit from ``start``.

    Args of the call:
        problem: what to minimise, within which bounds.
        start: (n,) where to begin; a seed's perturbation of the guess is already in it.
        options: of the solver.
        seed: the random stream is ``numpy.random.default_rng([seed, 1])``, the same for every solver that draws.
        monitor: sees each row of the trace; it may raise KeyboardInterrupt, which ends the solve so that it can go on.
        checkpoint: ``Outcome.checkpoint`` of an interrupted solve; from it the solve goes on.
        log: takes the solver's own text.

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
    ) -> Outcome:
        """Solve."""
        ...


def nothing() -> None:
    """What most solvers need to load."""


@dataclass(frozen=True)
class Solver(Generic[O_inv]):
    """A solver: its name, its options and what it does.

    Attributes:
        name: as in ``--solver`` and ``[solver.NAME]``.
        summary: one line for people.
        Options: frozen dataclass of plain values, each with a default; ValueError where a value cannot be.
        solve: see ``Solve``.
        prepare: loads what ``solve`` needs, such as a library, so that who times solves can leave it out; ``solve``
            works without, and a second call costs nothing.
        threaded: whether several solves may run in threads side by side, see ``together``.
        situations: whether it is for problems whose situations differ, and for no others; None: for all.
    """

    name: str
    summary: str
    Options: type[O_inv]
    solve: Solve[O_inv]
    prepare: Callable[[], None] = nothing
    threaded: bool = False
    situations: bool | None = False
