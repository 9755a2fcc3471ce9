"""Batched multi-start: several solves of one problem at once, their evaluations gathered into batches.

Each solve runs in a thread of its own and evaluates through one batcher. When every solve that is still going has
requested an evaluation, the last one to do so evaluates for all: one call for each kind of evaluation and smoothing. A
row's numbers do not depend on its batch, so each outcome is that of the solve alone, to the last bit.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.shooting import Evaluator, ShootingProblem, Values
from symphys.solvers.core.interface import Solver
from symphys.solvers.core.outcome import Monitor, Outcome
from symphys.types import Array

Own = TypeVar("Own")


def solve_multi_start(
    solver: Solver[Own],
    problem: ShootingProblem,
    starts: Sequence[Array],
    options: Own,
    seeds: Sequence[int] | None = None,
    monitors: Sequence[Monitor | None] | None = None,
) -> list[Outcome]:
    """Solve from every start; return the outcomes in the order of the starts.

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
    batcher = EvaluationBatcher(problem.evaluator, len(starts))
    seeds, monitors = seeds or [0] * len(starts), monitors or [None] * len(starts)

    def one(start: Array, seed: int, monitor: Monitor | None) -> Outcome:
        try:
            batched = replace(problem, evaluator=BatchedEvaluator(batcher))
            return solver.solve(batched, start, options, seed, monitor=monitor)
        finally:
            batcher.leave()

    solver.prepare()
    with ThreadPoolExecutor(max(len(starts), 1), thread_name_prefix="symphys-solve") as pool:
        try:
            return list(pool.map(one, starts, seeds, monitors))
        except BaseException:  # Ctrl-C in this thread: the other threads do not get it
            batcher.close()
            raise


@dataclass
class PendingEvaluation:
    """A requested evaluation, and its values or error."""

    kind: str
    Z: Array
    smoothing: float
    values: Values | None = None
    error: BaseException | None = None


class EvaluationBatcher:
    """Collects the pending evaluations of all solves and evaluates them in one call."""

    def __init__(self, evaluator: Evaluator, solves: int) -> None:
        """Serve ``solves`` solves, which run in threads."""
        self.evaluator, self.solves = evaluator, solves
        self.changed = threading.Condition()
        self.waiting: list[PendingEvaluation] = []
        self.closed = False

    def ask(self, request: PendingEvaluation) -> Values:
        """Block until all solves have requested; raise an error of the evaluator in every solve concerned."""
        with self.changed:
            self.waiting.append(request)
            self.serve()
            self.changed.wait_for(lambda: self.closed or request.values is not None or request.error is not None)
        if request.error is not None:
            raise request.error
        if request.values is None:
            raise KeyboardInterrupt
        return request.values

    def leave(self) -> None:
        """Remove a finished solve."""
        with self.changed:
            self.solves -= 1
            self.serve()

    def close(self) -> None:
        """Interrupt all evaluating solves."""
        with self.changed:
            self.closed = True
            self.changed.notify_all()

    def serve(self) -> None:
        """Evaluate once every solve has a request."""
        if not self.waiting or len(self.waiting) < self.solves or self.closed:
            return
        pending, self.waiting = self.waiting, []
        for kind in dict.fromkeys((request.kind, request.smoothing) for request in pending):
            evaluate_batch(self.evaluator, [each for each in pending if (each.kind, each.smoothing) == kind])
        self.changed.notify_all()


def evaluate_batch(evaluator: Evaluator, pending: Sequence[PendingEvaluation]) -> None:
    """Evaluate requests of one kind as one batch."""
    call: Callable[[Array, float], Values] = getattr(evaluator, pending[0].kind)
    try:
        values = call(np.concatenate([request.Z for request in pending]), pending[0].smoothing)
    except BaseException as error:  # raised in the solves that wait
        for request in pending:
            request.error = error
        return
    start = 0
    for request in pending:
        stop = start + len(request.Z)
        request.values, start = rows(values, start, stop), stop


def rows(values: Values, start: int, stop: int) -> Values:
    """Return a part of a batch."""
    parts: dict[str, Any] = {field.name: getattr(values, field.name) for field in fields(values)}
    return replace(values, **{name: part[start:stop] for name, part in parts.items() if part is not None})


@dataclass(frozen=True)
class BatchedEvaluator:
    """An evaluator that passes its requests to the batcher; see ``Evaluator``."""

    batcher: EvaluationBatcher

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        return self.batcher.ask(PendingEvaluation("value", Z, smoothing))

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        return self.batcher.ask(PendingEvaluation("gradient", Z, smoothing))

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.residuals``."""
        return self.batcher.ask(PendingEvaluation("residuals", Z, smoothing))

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.jacobian``."""
        return self.batcher.ask(PendingEvaluation("jacobian", Z, smoothing))
