"""Exact derivatives of a step by state, inputs and parameters, in tangents, for all steps of a motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import field
from functools import cached_property, partial
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from symphys.codegen import FixedBatch, Kernel, KernelUnavailable, ProcessorKernel, Program, ProgramError, processors
from symphys.codegen.backends import BEST, INTERPRETED, PRECISIONS, Description, build_kernel, described
from symphys.codegen.backends.calls import mapped, row_by_row
from symphys.codegen.slopes import SlopeKernel, compile_slopes
from symphys.codegen.toolchain.identity import identity_of
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.records import dataclass
from symphys.transcription.identities import step_identity
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.step_program import (
    StepArguments,
    difference_program,
    step_functions,
    step_program,
)
from symphys.transcription.staged.tangent import Tangent
from symphys.types import Array

Slopes = tuple[Array, Array, Array]
"""(N, n, n), (N, n, m), (N, n, np): derivatives of the next tangent by the tangent, inputs and parameters."""
Pull = Callable[[Array], Array]
"""(n, k) derivatives by the next tangent -> (d + u + varied p + nx, k) those by the varying arguments of the step."""
ZERO = np.zeros(1)
ZERO.flags.writeable = False
"""The buffer of derivatives by parameters where no parameter varies."""
MAX_PULLED = 2**23
"""Numbers of Jacobians that are computed at once for adjoints."""
MAX_LENT_ROWS = 16
"""Rows up to which preparing a call takes longer than computing it."""


@dataclass(eq=False)
class LinearizedStep:
    """One step of a rollout with its controllers, for batches of states: values, and derivatives in tangents.

    What evaluates is built when it is first asked for.

    Attributes:
        rollout, tangent: of the step and of its derivatives.
        backend: the name of a backend that is a kernel; other names mean casadi's virtual machine.
        threads: their number for a batch; None: one for each processor.
        exact: whether it is for smoothing 0 only.
        parameters: whether there are slopes by p; without, those are 0.
        clock: [s] the time at which step 0 begins; of a rollout whose duration does not vary.
        wait: for the compiler; else an interpreter evaluates until it is done.
        values: an equal step with another tangent, which takes the steps; None: this one does.
    """

    rollout: Rollout
    tangent: Tangent
    backend: str = BEST
    threads: int | None = None
    exact: bool = False
    parameters: bool = True
    clock: float = 0.0
    wait: bool = False
    values: LinearizedStep | None = None
    _note: str = field(default="", init=False)
    _step_note: str = field(default="", init=False)
    _seconds: float = field(default=0.0, init=False)
    _before_slopes: Callable[[], None] | None = field(default=None, init=False)

    @cached_property
    def arguments(self) -> StepArguments:
        """Return the arguments of the step."""
        return StepArguments(self.rollout, self.tangent, self.parameters)

    def step(self, k: int | NDArray[np.int64], X: ArrayLike, U: ArrayLike, P: ArrayLike, smoothing: float) -> Array:
        """Return states (B, nx) after step ``k``, or steps k (B,), from X (B, nx), U (B, m), P (B, np) or (np,)."""
        if self.values is not None:
            return self.values.step(k, X, U, P, smoothing)
        states = np.asarray(X, float)
        if isinstance(self._step, _ByKernel) and self._step.lends(len(states)):
            return self._step.lend(len(states), lambda batch: self._few(batch, k, states, U, P, smoothing))
        varying, given = self.rows(k, states, states, U, P, smoothing)
        return self._step.values(varying, given)

    def roll(self, first: Array, U: Array, P: Array, smoothing: float) -> Array:
        """Return the states (B, N + 1, nx) of rollouts from first states (B, nx), U (B, N, m) and P (B, np)."""
        if self.values is not None:
            return self.values.roll(first, U, P, smoothing)
        count, steps = U.shape[:2]
        X = np.empty((count, steps + 1, first.shape[1]))
        X[:, 0] = first
        kernel = self._step
        if not (isinstance(kernel, _ByKernel) and kernel.lends(1)):
            for k in range(steps):
                X[:, k + 1] = self.step(k, X[:, k], U[:, k], P, smoothing)
            return X
        rows = range(0, count, MAX_LENT_ROWS)
        parts = [slice(a, min(a + MAX_LENT_ROWS, count)) for a in rows]  # each goes its whole way without the others

        def part(rows: slice) -> None:
            self._roll(kernel, X[rows], U[rows], P if P.ndim == 1 else P[rows], smoothing)

        if len(parts) == 1 or self._count == 1:
            for each in parts:
                part(each)
        else:
            with ThreadPoolExecutor(self._count, thread_name_prefix="symphys-roll") as pool:
                list(pool.map(part, parts))
        return X

    def _roll(self, kernel: _ByKernel, X: Array, U: Array, P: Array, smoothing: float) -> None:
        """Take all steps of a few rollouts; X (B, N + 1, nx) begins with their first states."""
        count, steps = U.shape[:2]

        def put(batch: FixedBatch) -> None:
            """Take all steps but the last, and prepare that."""
            self._few(batch, 0, X[:, 0], U[:, 0], P, smoothing)
            (nx, n, m, _), ticks = self.arguments.sizes, self._ticks(np.arange(steps))
            state, given, tick = batch.parameters[:, :nx], batch.z[:, n : n + m], batch.parameters[:, 2 * nx]
            for k in range(1, steps):
                batch.run()
                X[:, k] = batch.outputs
                state[:], given[:], tick[:] = batch.outputs, U[:, k], ticks[k]

        X[:, steps] = kernel.lend(count, put)

    def difference(self, X: ArrayLike, Y: ArrayLike) -> Array:
        """Return ``Tangent.difference`` of (B, nx), (B, nx) as (B, n), with the parameters of the guess."""
        first, second = np.asarray(X, float), np.asarray(Y, float)
        if self._apart is None or not self._apart.lends(len(first)):
            return self.tangent.difference(first, second)
        nx, nominal = self.arguments.sizes[0], self.tangent.nominal

        def put(batch: FixedBatch) -> None:
            batch.z[:, :nx], batch.z[:, nx:], batch.parameters[:] = first, second, nominal

        return self._apart.lend(len(first), put)

    def _few(self, batch: FixedBatch, k: Any, X: Array, U: ArrayLike, P: ArrayLike, smoothing: float) -> None:
        """Write the arguments of a small batch where the kernel reads them; see ``rows``."""
        nx, n, m, np_ = self.arguments.sizes
        self._check(smoothing)
        varying, given, p = batch.z, batch.parameters, np.asarray(P, float)
        varying[:, n : n + m] = U
        given[:, :nx], given[:, 2 * nx], given[:, -1] = X, self._ticks(k), smoothing
        if np_:
            given[:, 2 * nx + 1 : -1] = p
            varying[:, n + m : n + m + len(self.arguments.varied)] = p[..., self.arguments.varied]

    def slopes(
        self, X: ArrayLike, U: ArrayLike, P: ArrayLike, smoothing: float, after: ArrayLike | None = None
    ) -> Slopes:
        """Return derivatives of the steps 0, 1, .. at states X (N, nx), inputs U (N, m), parameters P (np,).

        ``after``: (N, nx) the states that they lead to, where these are known. Numbers that are not finite are
        returned as they are.
        """
        states = np.asarray(X, float)
        k = np.arange(len(states))
        if after is None:
            after = self.step(k, states, U, P, smoothing)
        varying, given = self.rows(k, states, after, U, P, smoothing)
        return self._cut(self._off.jacobians(varying, given, self._columns))

    def slopes_from_end(
        self, X: ArrayLike, U: ArrayLike, P: ArrayLike, smoothing: float, after: ArrayLike | None = None
    ) -> Iterator[Slopes]:
        """Yield ``slopes`` of runs of steps, the last run first; all runs start at once."""
        k = np.arange(len(np.asarray(X)))
        after = self.step(k, X, U, P, smoothing) if after is None else after
        varying, given = self.rows(k, X, after, U, P, smoothing)
        return map(self._cut, self._off.jacobians_from_end(varying, given, self._columns))

    def pulls(self, X: ArrayLike, after: ArrayLike, U: ArrayLike, P: ArrayLike, smoothing: float) -> Iterator[Pull]:
        """Yield the adjoints of steps from X (N, nx) to ``after`` (N, nx), the last step first."""
        states = np.asarray(X, float)
        varying, given = self.rows(np.arange(len(states)), states, after, U, P, smoothing)
        return self._off.pulls(varying, given)

    @property
    def _columns(self) -> int:
        """Return the number of columns of a Jacobian: d, u, and the entries of p that z sets."""
        return sum(self.arguments.varying[:3])

    def _cut(self, jacobians: Array) -> Slopes:
        """Split Jacobians into those by states, inputs and parameters."""
        _, n, m, np_ = self.arguments.sizes
        a, b, varied = jacobians[:, :, :n], jacobians[:, :, n : n + m], jacobians[:, :, n + m :]
        if not varied.shape[2]:
            return a, b, np.ndarray((len(jacobians), n, np_), buffer=ZERO, strides=(0, 0, 0))
        c = np.zeros((len(jacobians), n, np_))
        c[:, :, self.arguments.varied] = varied
        return a, b, c

    def full_state_slopes(self, x: Array, u: Array, p: Array, smoothing: float) -> Array:
        """Return (n, nx) derivatives of step 0 by each number of a state (nx,), also off its tangent."""
        after = self.step(0, x[None], u[None], p, smoothing)
        varying, given = self.rows(0, x[None], after, u[None], p, smoothing)
        return self._off.jacobians(varying, given, varying.shape[1])[0, :, -self.arguments.sizes[0] :]

    def rows(
        self, k: Any, X: ArrayLike, after: ArrayLike, U: ArrayLike, P: ArrayLike, smoothing: float
    ) -> tuple[Array, Array]:
        """Return the varying and the given arguments, one row a state; see ``StepArguments``."""
        x, aim, u, p = (np.atleast_2d(np.asarray(each, float)) for each in (X, after, U, P))
        count, (_, n, m, np_) = len(x), self.arguments.sizes
        p = np.broadcast_to(p, (count, np_))
        tick = np.broadcast_to(self._ticks(k), (count,))[:, None]
        self._check(smoothing)
        parts = [np.zeros((count, n)), u.reshape(count, m), p[:, self.arguments.varied], np.zeros_like(x)]
        varying = np.concatenate(parts, axis=1)
        return varying, np.concatenate([x, aim, tick, p, np.full((count, 1), smoothing)], axis=1)

    def _ticks(self, k: Any) -> Array:
        """Return the numbers of the steps, counted from clock 0."""
        return np.asarray(self.clock / self.rollout.dt + np.asarray(k, float))

    def _check(self, smoothing: float) -> None:
        if self.exact and smoothing:
            raise ValueError(f"this step is for smoothing 0 only, not for {smoothing:g}")

    @cached_property
    def description(self) -> str:
        """Describe the evaluator of the slopes."""
        if isinstance(self._off, _ByCasadi):
            return f"casadi's virtual machine{self._note}"
        report = self._off.kernel.report
        return f"{report.precision} precision, lanes {report.lanes}, threads {self._off.kernel.threads}"

    def prepare(self, slopes: bool) -> None:
        """Compile the step; with ``slopes`` begin to compile these, once the step no longer needs the processors."""
        began = perf_counter()
        step = (self.values or self)._step
        kernel = step.kernel if isinstance(step, _ByKernel) else None
        widths = kernel.widths if isinstance(kernel, ProcessorKernel) else None
        if widths is not None:
            widths.begin()
            self._before_slopes = widths.finish
        if slopes:
            _ = self._off  # planned while the step is being compiled
        if widths is not None:
            widths.finish()
        self._seconds += perf_counter() - began

    @property
    def evaluator(self) -> Description:
        """Describe the evaluator of next states, with the seconds that were spent on it so far."""
        if self.values is not None:
            return self.values.evaluator
        began, step = perf_counter(), self._step
        self._seconds += perf_counter() - began
        if isinstance(step, _ByKernel):
            return described(step.kernel, self._seconds)
        return Description("casadi", threads=self._count, note=self._step_note)

    @cached_property
    def _count(self) -> int:
        return processors() if self.threads is None else self.threads

    @cached_property
    def _step(self) -> _ByKernel | _ByCasadi:
        """Return the evaluator of next states."""
        try:
            return _ByKernel(self._kernel(self.source("step", lambda: step_program(self.arguments, self.exact, False))))
        except (KernelUnavailable, ProgramError) as error:
            self._step_note = f"{INTERPRETED}: {error}" if self.backend in PRECISIONS else ""
            return _ByCasadi(step_functions(self.arguments)[0], self._count)

    @cached_property
    def _off(self) -> _BySlopes | _ByCasadi:
        """Return the evaluator of slopes."""
        try:
            self._refuse()
            source = self.source("slopes", lambda: step_program(self.arguments, self.exact, True))
            return _BySlopes(
                compile_slopes(source, "off", threads=self._count, wait=self.wait, before=self._before_slopes)
            )
        except (KernelUnavailable, ProgramError) as error:
            self._note = f"; {error}" if self.backend in PRECISIONS else ""
            return _ByCasadi(step_functions(self.arguments)[1], self._count)

    @cached_property
    def _apart(self) -> _ByKernel | None:
        """Return the kernel for differences of states; None without one."""
        try:
            return _ByKernel(self._kernel(self.source("difference", lambda: difference_program(self.tangent))))
        except (KernelUnavailable, ProgramError):
            return None

    def source(self, what: str, make: Callable[[], Program], *how: object) -> ProgramSource:
        """Return a program of this step, which need not be made where what is built of it is kept.

        ``how``: all that the program depends on besides the step.
        """
        step, varied = step_identity(self.rollout, self.exact), self.arguments.varied.tolist()
        identity = None if step is None or None in how else identity_of(step, varied, self.tangent.kind, what, *how)
        return ProgramSource(make, identity)

    def _kernel(self, source: ProgramSource) -> Kernel:
        self._refuse()
        return build_kernel(self.backend, source, [], self._count, wait=self.wait)

    def _refuse(self) -> None:
        """Raise KernelUnavailable where the backend is no kernel."""
        if self.backend not in PRECISIONS:
            raise KernelUnavailable("the backend is no kernel")


class _ByKernel:
    """Evaluates by a kernel whose lanes are states."""

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self._free: dict[int, list[FixedBatch]] = {}

    def values(self, varying: Array, given: Array) -> Array:
        return np.array(self.kernel.forward(varying, given)["after"])

    def lends(self, rows: int) -> bool:
        """Whether a batch is so small that its buffers are kept."""
        return 0 < rows <= MAX_LENT_ROWS and isinstance(self.kernel, ProcessorKernel)

    def lend(self, rows: int, put: Callable[[FixedBatch], None]) -> Array:
        """Return the outputs of a small batch, after ``put`` has written its arguments."""
        assert isinstance(self.kernel, ProcessorKernel)
        free = self._free.setdefault(rows, [])
        try:
            batch = free.pop()
        except IndexError:
            batch = self.kernel.fixed_batch(rows)
        try:
            put(batch)
            batch.run()
            return batch.outputs.copy()
        finally:
            free.append(batch)


class _BySlopes:
    """Evaluates by a kernel whose lanes are states, then rows of one Jacobian."""

    def __init__(self, kernel: SlopeKernel) -> None:
        self.kernel = kernel

    def jacobians(self, varying: Array, given: Array, columns: int) -> Array:
        return self.kernel.jacobians(varying, given, columns)

    def jacobians_from_end(self, varying: Array, given: Array, columns: int) -> Iterator[Array]:
        return self.kernel.jacobians_from_end(varying, given, columns)

    def pulls(self, varying: Array, given: Array) -> Iterator[Pull]:
        width = varying.shape[1]
        some = max(1, MAX_PULLED // (self.kernel.library.data.height * width))
        for end in range(len(varying), 0, -some):
            part = slice(max(0, end - some), end)
            for jacobian in self.kernel.jacobians(varying[part], given[part], width)[::-1]:
                yield jacobian.T.__matmul__


class _ByCasadi:
    """Evaluates state by state on casadi's virtual machine, for machines without a compiler."""

    def __init__(self, function: ca.Function, threads: int) -> None:
        self.function, self.threads = function, threads
        self._mapped: dict[int, ca.Function] = {}
        self._jacobian: dict[int, ca.Function] = {}
        self._reversed: dict[int, ca.Function] = {}

    def values(self, varying: Array, given: Array) -> Array:
        count = len(varying)
        if count == 1 or self.threads == 1:
            return row_by_row(self.function, varying, given)[0]
        if count not in self._mapped:
            self._mapped[count] = mapped(self.function, count, self.threads)
        return np.array(self._mapped[count](varying.T, given.T)).T

    def jacobians(self, varying: Array, given: Array, columns: int) -> Array:
        if columns not in self._jacobian:
            first, rest = ca.MX.sym("first", columns), ca.MX.sym("rest", varying.shape[1] - columns)
            row = ca.MX.sym("given", given.shape[1])
            slope = ca.jacobian(self.function(ca.vertcat(first, rest), row), first)
            self._jacobian[columns] = ca.Function("slopes", [first, rest, row], [slope])
        cut = (np.split(row, [columns]) for row in varying)
        rows = [np.array(ca.DM(self._jacobian[columns](*row, more))) for row, more in zip(cut, given, strict=True)]
        return np.array(rows).reshape(len(varying), -1, columns)

    def pulls(self, varying: Array, given: Array) -> Iterator[Pull]:
        result = np.zeros(self.function.size1_out(0))
        for row, more in zip(varying[::-1], given[::-1], strict=True):
            yield partial(self._pull, row, more, result)

    def _pull(self, varying: Array, given: Array, result: Array, seeds: Array) -> Array:
        return np.array(self._reverse(seeds.shape[1])(varying, given, result, seeds)[0])

    def _reverse(self, count: int) -> ca.Function:
        if count not in self._reversed:
            self._reversed[count] = self.function.reverse(count)
        return self._reversed[count]

    def jacobians_from_end(self, varying: Array, given: Array, columns: int) -> Iterator[Array]:
        rows = zip(varying[::-1], given[::-1], strict=True)
        return (self.jacobians(row[None], more[None], columns) for row, more in rows)
