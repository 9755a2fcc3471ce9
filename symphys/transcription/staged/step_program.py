"""One step as programs: the next state, and its distance from another in the tangent."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from symphys.codegen import FunctionCall, MemoryLayout, Place, Program
from symphys.records import dataclass
from symphys.transcription.decision_variables import start_of
from symphys.transcription.program import step_calls
from symphys.transcription.rollout import Rollout, call
from symphys.transcription.staged.tangent import Tangent
from symphys.types import Expr, Ints


@dataclass(frozen=True, eq=False)
class StepArguments:
    """The arguments of one step, divided into varying ones, by which it is differentiated, and given ones.

    What varies is (d, u, p as far as z sets it, e), what is given (x, the state after, the number of the step, p).
    e (nx,) is what the state may have beside its tangent, as initial states do.

    Attributes:
        rollout, tangent: of the step.
        parameters: whether it is differentiated by p.
    """

    rollout: Rollout
    tangent: Tangent
    parameters: bool = True

    @cached_property
    def sizes(self) -> tuple[int, int, int, int]:
        """Return the sizes of x, d, u without shares of phases, and p."""
        rollout = self.rollout
        return rollout.memory.size, self.tangent.size, rollout.controls, int(rollout.p.shape[0])

    @cached_property
    def varied(self) -> Ints:
        """Return the entries of p by which the step is differentiated: those that z sets."""
        if not self.parameters:
            return np.zeros(0, np.int64)
        rollout = self.rollout
        p = start_of(rollout.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.z).p
        rows = ca.Function("p", [rollout.z], [p]).jac_sparsity(0, 0).row()
        return np.unique(np.array(rows, np.int64))

    @property
    def varying(self) -> list[int]:
        """Return the sizes of the varying arguments."""
        nx, n, m, _ = self.sizes
        return [n, m, len(self.varied), nx]

    @property
    def given(self) -> list[int]:
        """Return the sizes of the given arguments."""
        nx, _, _, np_ = self.sizes
        return [nx, nx, 1, np_]

    def time(self, tick: Expr, p: Expr) -> Expr:
        """Return the time [s] of a step by its number; a free duration is among the parameters."""
        return tick * self.rollout.parameters.step_length(self.rollout.problem.simulation, p)

    def shift(self, x: Expr, p: Expr, varied: Expr) -> Expr:
        """Return (nx,) the change of a state with its joints, when p takes the varied values."""
        slope = self.tangent.shift(x, p)
        return ca.mtimes(slope[:, self.varied.tolist()], varied - p[self.varied.tolist()]) if len(self.varied) else 0

    def with_varied(self, p: Expr, varied: Expr) -> Expr:
        """Return p with its varying entries replaced."""
        if not len(self.varied):
            return p
        fixed = np.setdiff1d(np.arange(self.sizes[3]), self.varied)
        order = np.argsort(np.concatenate([self.varied, fixed]))
        kept = ca.reshape(p[fixed.tolist()], len(fixed), 1)  # of no index casadi makes a row
        return ca.vertcat(varied, kept)[order.tolist()]


class TangentStepPlaces:
    """The places of one step in a program; see ``Places``."""

    def __init__(self, arguments: StepArguments) -> None:
        """Reserve the varying and given arguments, the smoothing, and the results."""
        self.rollout, self.layout = arguments.rollout, MemoryLayout()
        nx, np_, m = arguments.sizes[0], arguments.sizes[3], int(arguments.rollout.given.shape[0])
        self.varying = self.layout.take(sum(arguments.varying))
        self.given_row = self.layout.take(sum(arguments.given) + 1)
        self.x, self.given = self.layout.series(nx, 2), self.layout.take(m)
        self.u = self.given if self.rollout.feedback is None else self.layout.series(m, 1)
        self.p, self.time, self.smoothing = self.layout.take(np_), self.layout.series(1, 1), self.layout.take(1)


def step_program(arguments: StepArguments, exact: bool, tangent: bool) -> Program:
    """Return the program of one step with the output ``after``, and with ``tangent`` also ``off``.

    Its vector is what varies and its parameters what is given, and the smoothing. d and e are 0 there, and the step
    begins at x to the last bit: only the slopes by d are those of retract. ``off`` (n,) has the slopes of how far the
    state after the step is from the one that is given. Without ``tangent`` d and e are left out of the step.
    """
    places = TangentStepPlaces(arguments)
    step = step_calls(places, exact)
    after, outputs, epilogue = places.x.later().still(), dict[str, Place](), tuple[FunctionCall, ...]()
    if tangent:
        outputs["off"] = places.layout.take(arguments.tangent.size)
        epilogue = (FunctionCall(_off(arguments), (places.varying, places.given_row, after), (outputs["off"],)),)
    written = (places.x.still(), places.given, places.p, places.time.still(), places.smoothing)
    return Program(
        size=places.layout.size,
        z=places.varying,
        parameters=places.given_row,
        steps=1,
        outputs={**outputs, "after": after},
        prologue=(FunctionCall(_begun(arguments, tangent), (places.varying, places.given_row), written), *step.numbers),
        body=tuple(step.body),
        epilogue=epilogue,
    )


def _begun(arguments: StepArguments, tangent: bool) -> ca.Function:
    """Return (varying, given) -> state, inputs, parameters, time and smoothing of the step."""
    varying, given = ca.SX.sym("varying", sum(arguments.varying)), ca.SX.sym("given", sum(arguments.given) + 1)
    d, u, varied, e = parts(varying, arguments.varying)
    x, _, tick, p, smoothing = parts(given, [*arguments.given, 1])
    moved = ca.mtimes(arguments.tangent.basis(x, p), d) + e + arguments.shift(x, p, varied)
    start = x + moved if tangent else x
    taken = arguments.with_varied(p, varied)
    put = arguments.rollout.with_shares(u, tick)
    results = (start, put, taken, arguments.time(tick, taken), smoothing)
    return ca.Function("begun", [varying, given], [ca.densify(each) for each in results])


def _off(arguments: StepArguments) -> ca.Function:
    """Return (varying, given, after) -> the difference of ``after`` from the given state."""
    varying, given = ca.SX.sym("varying", sum(arguments.varying)), ca.SX.sym("given", sum(arguments.given) + 1)
    after = ca.SX.sym("after", arguments.sizes[0])
    varied, (_, aim, _, p, _) = parts(varying, arguments.varying)[2], parts(given, [*arguments.given, 1])
    difference = after - aim - arguments.shift(aim, p, varied)
    return ca.Function("off", [varying, given, after], [ca.mtimes(arguments.tangent.projection(aim, p), difference)])


def difference_program(tangent: Tangent) -> Program:
    """Return the program of ``tangent.distance``: vector: two states, parameters: p, output: ``off`` (n,)."""
    layout, (nx, _, np_) = MemoryLayout(), (tangent.distance.size1_in(i) for i in range(3))
    states, p, off = layout.series(nx, 2), layout.take(np_), layout.take(tangent.size)
    call_of = FunctionCall(tangent.distance, (states.still(), states.later().still(), p), (off,))
    both = Place(states.offset, 2 * nx)
    return Program(layout.size, z=both, parameters=p, steps=1, outputs={"off": off}, prologue=(call_of,))


def step_functions(arguments: StepArguments) -> tuple[ca.Function, ca.Function]:
    """Return (varying, given with smoothing) -> after, and off, on casadi's virtual machine."""
    varying, given = ca.MX.sym("varying", sum(arguments.varying)), ca.MX.sym("given", sum(arguments.given) + 1)
    d, u, varied, e = parts(varying, arguments.varying)
    x, aim, tick, p, smoothing = parts(given, [*arguments.given, 1])
    closed, tangent = arguments.rollout.closed, arguments.tangent
    time = arguments.time(tick, arguments.with_varied(p, varied))
    u = arguments.rollout.with_shares(u, tick)
    put = u if arguments.rollout.feedback is None else ca.vertcat(u, time)
    starts = x, x + ca.mtimes(tangent.basis(x, p), d) + e + arguments.shift(x, p, varied)
    first, moved = (call(closed, start, put, arguments.with_varied(p, varied), smoothing)[0] for start in starts)
    off = ca.mtimes(tangent.projection(aim, p), moved - aim - arguments.shift(aim, p, varied))
    return ca.Function("step", [varying, given], [first]), ca.Function("off", [varying, given], [off])


def parts(column: Expr, sizes: list[int]) -> list[Expr]:
    """Split a column into parts of these sizes."""
    ends = np.cumsum([0, *sizes]).tolist()
    return [column[a:b] for a, b in pairwise(ends)]
