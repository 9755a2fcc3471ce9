"""The multiple-shooting program passed to a library through casadi's nlpsol, function by function.

No exception may leave a callback, since casadi would lose it. After the first, or where the solve is to end, a callback
returns what makes the library end. Ctrl-C may come between two callbacks, where an exception would be lost as well: its
handler is called as ever, and what it raises is kept until the library has ended.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any, Protocol

import casadi as ca
import numpy as np

from symphys.records import dataclass
from symphys.solvers.multiple_shooting.nlp import MultipleShootingNlp
from symphys.types import Array

SCALAR = ca.Sparsity.dense(1, 1)
ITERATIONS_USED = "Maximum_Iterations_Exceeded"
"""The return status of a used budget, in IPOPT's terms."""


class IterateWatch(Protocol):
    """Receives the iterates of a library."""

    error: BaseException | None

    def iterate(self, w: Array, bound_duals: Array, row_duals: Array) -> bool:
        """Record an iterate; return whether to end. Duals are empty where a library does not report them."""
        ...

    @property
    def ended(self) -> bool:
        """Whether the solve is to end, by an error or else."""
        ...


@dataclass(frozen=True)
class LibraryRequest:
    """The input of a library call.

    Attributes:
        nlp: the program.
        w: (size,) where to start.
        lower, upper: (size,) bounds of w.
        bound_duals, row_duals: multipliers of w's bounds and of the rows to start from; empty: there are none.
        barrier: IPOPT's mu to start from, where there are multipliers.
        iterations: at most.
        tolerance: of the optimality error.
        limited_memory: whether IPOPT approximates the Hessian.
        options: the library's own.
        log: takes its text.
    """

    nlp: MultipleShootingNlp
    w: Array
    lower: Array
    upper: Array
    bound_duals: Array
    row_duals: Array
    barrier: float
    iterations: int
    tolerance: float
    limited_memory: bool
    options: dict[str, Any]
    log: Callable[[str], None]


@dataclass(frozen=True)
class LibraryResult:
    """The result of a library call.

    Attributes:
        w: (size,) where it ended.
        bound_duals, row_duals: multipliers there.
        statistics: casadi's.
    """

    w: Array
    bound_duals: Array
    row_duals: Array
    statistics: dict[str, Any]


class NlpPart(ca.Callback):
    """One of the program's functions as a casadi callback."""

    def __init__(
        self,
        name: str,
        inputs: Sequence[ca.Sparsity],
        outputs: Sequence[ca.Sparsity],
        compute: Callable[..., list[Any]],
        watch: IterateWatch,
        rest: Sequence[Any] = (),
    ) -> None:
        """Take ``compute``, arrays -> nonzeros of each output, which ``rest`` replaces at the end."""
        ca.Callback.__init__(self)
        self.inputs, self.outputs, self.compute, self.watch = inputs, outputs, compute, watch
        self.rest = rest or [np.full(sparsity.nnz(), np.nan) for sparsity in outputs]
        self.construct(name, {})

    def get_n_in(self) -> int:
        """Return the number of inputs."""
        return len(self.inputs)

    def get_n_out(self) -> int:
        """Return the number of outputs."""
        return len(self.outputs)

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        """Return the sparsity of an input."""
        return self.inputs[index]

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        """Return the sparsity of an output."""
        return self.outputs[index]

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        """Compute the outputs."""
        if not self.watch.ended:
            try:
                with np.errstate(all="ignore"):
                    found = self.compute(*(each.full().ravel() for each in arguments))
                return [ca.DM(sparsity, each) for sparsity, each in zip(self.outputs, found, strict=True)]
            except (Exception, KeyboardInterrupt) as error:
                self.watch.error = error
        return [ca.DM(sparsity, each) for sparsity, each in zip(self.outputs, self.rest, strict=True)]


@contextmanager
def kept_interruptions(watch: IterateWatch) -> Iterator[None]:
    """Let ``watch`` keep what the handler of Ctrl-C raises within the block."""
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return

    def keep(number: int, frame: FrameType | None) -> None:
        try:
            handler(number, frame)
        except KeyboardInterrupt as stopped:
            watch.error = stopped

    signal.signal(signal.SIGINT, keep)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def called(
    library: str, parts: tuple[NlpPart, NlpPart], settings: dict[str, Any], request: LibraryRequest
) -> LibraryResult:
    """Call nlpsol; ``parts`` and ``settings`` keep the callbacks alive."""
    x, p = ca.MX.sym("x", request.nlp.layout.size), ca.MX.sym("p")
    program = {"x": x, "p": p, "f": parts[0](x, p), "g": parts[1](x, p)}
    quiet = {"print_time": False, "show_eval_warnings": False}
    solver = ca.nlpsol("solve", library, program, {**settings, **quiet})
    low, high = request.nlp.row_bounds()
    given: dict[str, Any] = {
        "x0": request.w,
        "p": 0,
        "lbx": request.lower,
        "ubx": request.upper,
        "lbg": low,
        "ubg": high,
    }
    if request.row_duals.size:
        given |= {"lam_x0": request.bound_duals, "lam_g0": request.row_duals}
    with kept_interruptions(parts[0].watch):
        result = solver(**given)
    w, bound_duals, row_duals = (result[name].full().ravel() for name in ("x", "lam_x", "lam_g"))
    return LibraryResult(w, bound_duals, row_duals, solver.stats())
