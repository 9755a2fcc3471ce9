"""Several solves of one problem side by side, their single evaluations gathered into batches.

Each solve runs in a thread of its own and evaluates through a seat at one table. When every solve that is still going
has asked for something, the last one to ask evaluates for all: one call for each kind of evaluation and smoothing. A
row's numbers do not depend on its batch, so each outcome is that of the solve alone, to the last bit.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from symphys.errors import SymphysError
from symphys.shooting import Evaluator, ShootingProblem, Values
from symphys.solvers.core.interface import Solver
from symphys.solvers.core.outcome import Array, Monitor, Outcome

Own = TypeVar("Own")


def solve_together(
    solver: Solver[Own],
    problem: ShootingProblem,
    starts: Sequence[Array],
    options: Own,
    seeds: Sequence[int] | None = None,
    monitors: Sequence[Monitor | None] | None = None,
) -> list[Outcome]:
    """Solve from every start; the outcomes in the order of the starts.

    Args:
        solver: one that may run in threads, see ``Solver.threaded``; SymphysError for another.
        problem: of all.
        starts: (n,) each.
        options: of all.
        seeds: one for each start; None: 0 for all.
        monitors: one for each start, called in the thread of its solve; one that raises KeyboardInterrupt ends its
            solve alone, which can go on. Ctrl-C itself ends all of them and is raised.
    """
    if not solver.threaded:
        raise SymphysError(f"the solver {solver.name!r} cannot run several solves side by side")
    table = Table(problem.evaluator, len(starts))
    seeds, monitors = seeds or [0] * len(starts), monitors or [None] * len(starts)

    def one(start: Array, seed: int, monitor: Monitor | None) -> Outcome:
        try:
            seated = replace(problem, evaluator=Seat(table))
            return solver.solve(seated, start, options, seed, monitor=monitor)
        finally:
            table.leave()

    solver.prepare()
    with ThreadPoolExecutor(max(len(starts), 1), thread_name_prefix="symphys-solve") as pool:
        try:
            return list(pool.map(one, starts, seeds, monitors))
        except BaseException:  # Ctrl-C in this thread: the solves cannot hear it
            table.close()
            raise


@dataclass
class Order:
    """What a solve has asked for, and what came of it."""

    kind: str
    Z: Array
    smoothing: float
    values: Values | None = None
    error: BaseException | None = None


class Table:
    """Where the orders of all solves meet."""

    def __init__(self, evaluator: Evaluator, seats: int) -> None:
        """As many solves as seats."""
        self.evaluator, self.seats = evaluator, seats
        self.changed = threading.Condition()
        self.waiting: list[Order] = []
        self.closed = False

    def ask(self, order: Order) -> Values:
        """Wait until all have asked; what the evaluator raised is raised in every solve whose order it spoiled."""
        with self.changed:
            self.waiting.append(order)
            self.serve()
            self.changed.wait_for(lambda: self.closed or order.values is not None or order.error is not None)
        if order.error is not None:
            raise order.error
        if order.values is None:
            raise KeyboardInterrupt
        return order.values

    def leave(self) -> None:
        """A solve is over: the others need not wait for it."""
        with self.changed:
            self.seats -= 1
            self.serve()

    def close(self) -> None:
        """Interrupt all solves that evaluate."""
        with self.changed:
            self.closed = True
            self.changed.notify_all()

    def serve(self) -> None:
        """Evaluate once everybody has asked."""
        if not self.waiting or len(self.waiting) < self.seats or self.closed:
            return
        orders, self.waiting = self.waiting, []
        for kind, smoothing in dict.fromkeys((order.kind, order.smoothing) for order in orders):
            fill(self.evaluator, [each for each in orders if (each.kind, each.smoothing) == (kind, smoothing)])
        self.changed.notify_all()


def fill(evaluator: Evaluator, orders: Sequence[Order]) -> None:
    """Evaluate orders of one kind as one batch."""
    call: Callable[[Array, float], Values] = getattr(evaluator, orders[0].kind)
    try:
        values = call(np.concatenate([order.Z for order in orders]), orders[0].smoothing)
    except BaseException as error:  # who waits must hear of it
        for order in orders:
            order.error = error
        return
    start = 0
    for order in orders:
        stop = start + len(order.Z)
        order.values, start = rows(values, start, stop), stop


def rows(values: Values, start: int, stop: int) -> Values:
    """A part of a batch."""
    parts: dict[str, Any] = {field.name: getattr(values, field.name) for field in fields(values)}
    return replace(values, **{name: part[start:stop] for name, part in parts.items() if part is not None})


@dataclass(frozen=True)
class Seat:
    """An evaluator that asks at the table; see ``Evaluator``."""

    table: Table

    def value(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.table.ask(Order("value", Z, smoothing))

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.table.ask(Order("gradient", Z, smoothing))

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.table.ask(Order("residuals", Z, smoothing))

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.table.ask(Order("jacobian", Z, smoothing))
