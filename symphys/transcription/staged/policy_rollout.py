"""Compiled rollouts under a policy: all steps of several step lengths in one call, lanes are step lengths.

The new knots of step k are v = clip(v_k + a ahead_k + b back_k d). There d is how far the state is from x_k in its
tangent, how far knots are that were decided before and still act, and how far static entries are; a is the step length,
and b the share of the feedback. This is the forward pass of differential dynamic programming (Tassa, Mansard and
Todorov, Control-Limited Differential Dynamic Programming, ICRA 2014, section III) without Python between the steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from symphys.codegen import (
    FunctionCall,
    KernelUnavailable,
    MemoryLayout,
    Place,
    ProcessorKernel,
    Program,
    ProgramError,
)
from symphys.codegen.backends import PRECISIONS
from symphys.codegen.toolchain.warm_start import ProgramSource, compile_source
from symphys.records import dataclass
from symphys.shooting import AffinePolicy
from symphys.transcription.identities import program_identity, terms_identity
from symphys.transcription.program import step_calls
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.linearized_step import LinearizedStep
from symphys.transcription.staged.stage_terms import StageSymbols, StageTerm
from symphys.types import Array, Expr


class RunningCosts(NamedTuple):
    """The cost of a motion as functions (state, state before, inputs, p, number of the state) -> (1,).

    Attributes:
        before, after: at the start and at the end of each step.
        end: at the end of the motion.
    """

    before: ca.Function
    after: ca.Function
    end: ca.Function


def running_costs(symbols: StageSymbols, terms: Sequence[StageTerm]) -> RunningCosts | None:
    """Return the merit with limits as squared violations; None where terms need more than one step.

    That is sums, entries of z, and instants other than the end.
    """
    if not symbols.plain:
        return None
    steps, limits = symbols.rollout.steps, iter(symbols.rollout.problem.constraints)
    totals: dict[str, Expr] = {"before": ca.SX(0), "after": ca.SX(0), "end": ca.SX(0)}
    for term in terms:
        running = len(term.steps) == steps
        if term.kind == "sum" or not (running or (term.after and term.steps[0] == steps - 1)):
            return None
        value = term.value
        if term.kind == "limit":
            limit = next(limits)
            lower, upper = (ca.DM(np.broadcast_to(end, (term.size,))) for end in (limit.lower, limit.upper))
            value = value - ca.fmin(ca.fmax(value, lower), upper)
        cost: Expr = ca.sum1(value) if term.kind == "cost" else ca.sumsqr(value)
        totals[("after" if term.after else "before") if running else "end"] += term.weight * cost
    return RunningCosts(
        *(ca.Function("costs", list(symbols.arguments), [ca.densify(ca.cse(each))]) for each in totals.values())
    )


class RunningSums(NamedTuple):
    """The sums beside a state, step by step.

    Attributes:
        function: (state with sums (nx + S,), state after (nx,), inputs, constants, number of the state before, weights
            (T,)) -> the sums (S,) after the step.
        weights: (N, T) of the values that are added, in each step.
        total: their number ``S``.
        identity: a key of the function; None: not known.
    """

    function: ca.Function
    weights: Array
    total: int
    identity: str | None


def running_sums(symbols: StageSymbols, terms: Sequence[StageTerm]) -> RunningSums | None:
    """Return the sums among the terms; None without any."""
    summed = [term for term in terms if term.kind == "sum"]
    if not summed:
        return None
    x, _, u, constants, tick = symbols.arguments
    nx, weights = symbols.state_size, np.zeros((symbols.rollout.steps, len(summed)))
    after, weight = ca.SX.sym("after", nx), ca.SX.sym("weight", len(summed))
    sums = x[nx:]
    for k, term in enumerate(summed):
        weights[term.steps, k] = term.weight
        value = ca.Function("value", [*symbols.arguments], [term.value])
        state, tick_of = (ca.vertcat(after, x[nx:]), tick + 1) if term.after else (x, tick)
        sums[term.number] += weight[k] * value(state, x[:nx], u, constants, tick_of)
    arguments = [x, after, u, constants, tick, weight]
    function = ca.Function("sums", arguments, [ca.densify(ca.cse(sums))])
    identity = terms_identity(symbols.rollout, "running sums", [term.key for term in summed])
    return RunningSums(function, weights, int(sums.shape[0]), identity)


class PolicySizes(NamedTuple):
    """Largest numbers of ``old`` and ``new`` knots in a step, of ``inputs``, of static entries and of constants."""

    old: int
    new: int
    inputs: int
    statics: int = 0
    constants: int = 0


class PolicyMotions(NamedTuple):
    """A batch: ``x`` (B, N + 1, nx), ``u`` (B, N, m), new knots (B, N, w), and ``cost`` (B,)."""

    x: Array
    u: Array
    new: Array
    cost: Array


@dataclass(frozen=True, eq=False)
class PolicyRollout:
    """Rollouts under policies of one size.

    Attributes:
        step: the step of the rollout.
        sizes: of the policies.
        costs: of the motion; without, it costs 0.
        threads: their number for the step lengths.
        sums: beside the state; states are then (nx + S,), and tangents (n + S,).
    """

    step: LinearizedStep
    sizes: PolicySizes
    costs: RunningCosts | None = None
    threads: int | None = 1
    sums: RunningSums | None = None

    @cached_property
    def kernel(self) -> ProcessorKernel | None:
        """Return the compiled kernel; None without a compiler."""
        if self.step.backend not in PRECISIONS:
            return None
        try:
            return compile_source(self.source, (), self.threads, wait=self.step.wait)
        except (KernelUnavailable, ProgramError):
            return None

    @property
    def source(self) -> ProgramSource:
        """Return the program; without costs only the number of steps of the problem's horizon is part of it."""
        make, rollout = partial(policy_program, self.step, self.sizes, self.costs, self.sums), self.step.rollout
        of_sums = "" if self.sums is None else self.sums.identity
        asked = "" if self.costs is None else program_identity(rollout.problem, self.step.exact)
        return self.step.source("policy", make, *self.sizes, rollout.steps, asked, of_sums)

    def __call__(
        self,
        start: ArrayLike,
        p: ArrayLike,
        policy: AffinePolicy,
        lengths: Array,
        smoothing: float,
        clock: float = 0.0,
        statics: ArrayLike = 0.0,
        shares: ArrayLike = 1.0,
    ) -> PolicyMotions:
        """Return the motions of step lengths (B,); one that is not finite stays so.

        Args:
            start: (nx,) or (B, nx) first states.
            p: (np,) or (B, np) parameters; where there are sums, with the other constants of terms behind them.
            policy: of the motions.
            lengths: (B,).
            smoothing: of the steps.
            clock: [s] the time at the start.
            statics: (B, s) how far static entries are from where the policy was made.
            shares: (B,) of the feedback.
        """
        count, steps, nx = len(lengths), len(policy.new), policy.x.shape[1]
        sizes = 1, 1, self.sizes.statics, self.step.arguments.sizes[3] + self.sizes.constants, nx
        row, parts, first = np.empty((count, sum(sizes))), list[Array](), 0
        for size, each in zip(sizes, (lengths[:, None], np.reshape(shares, (-1, 1)), statics, p, start), strict=True):
            parts.append(row[:, first : first + size])
            parts[-1][:] = each
            first += size
        assert self.kernel is not None, "there is a compiler"
        shared = [policy.old[0], *(getattr(policy, name).ravel() for name in POLICY_SERIES), self.step.tangent.nominal]
        if self.sums is not None:
            shared.append(self.sums.weights.ravel())
        found = self.kernel.forward(row, np.concatenate([*shared, (clock, smoothing)]))
        x, u, new = (
            found[name].reshape(count, more, -1) if name in found else np.zeros((count, more, 0))
            for name, more in (("x", steps + 1), ("u", steps), ("new", steps))
        )
        return PolicyMotions(x, u, new, found["cost"][:, 0])


POLICY_SERIES = ("x", "old", "new", "ahead", "back", "weights", "keep", "lower", "upper")
"""Of ``AffinePolicy``, in the order in which the program has them."""


class PolicyPlaces:
    """The places of a rollout under a policy in a program; see ``Places``.

    What differs from lane to lane is (step length, share of the feedback, change of static entries, p with other
    constants, first state). What all share is the policy, step after step, then the nominal p, weights of sums, the
    clock and the smoothing; the body reads it where it lies.
    """

    def __init__(self, step: LinearizedStep, sizes: PolicySizes, sums: RunningSums | None) -> None:
        """Reserve policies of these sizes."""
        self.rollout: Rollout = step.rollout
        self.layout = layout = MemoryLayout()
        nx, n, m, np_ = step.arguments.sizes
        old, new, inputs, s, more = sizes
        steps, acting = self.rollout.steps, old + new
        summed, added = (0, 0) if sums is None else (sums.total, sums.weights.shape[1])
        whole, n = nx + summed, n + summed
        self.row = layout.take(2 + s + np_ + more + whole)
        begun = layout.size
        self.first_held = layout.take(old)
        counts = (whole, old, new, new, new * (n + old + s), inputs * acting, old * acting, new, new)
        self.policy = {name: layout.series(size, steps) for name, size in zip(POLICY_SERIES, counts, strict=True)}
        self.nominal, self.weights = layout.take(np_), layout.series(added, steps)
        self.clock, self.smoothing = layout.take(1), layout.take(1)
        self.shared = Place(begun, layout.size - begun)
        self.length, self.share, self.statics, self.constants = (layout.take(size) for size in (1, 1, s, np_ + more))
        self.p = Place(self.constants.offset, np_)
        self.off, self.cost = layout.take(n), layout.take(1)
        self.whole, self.held, self.v = (
            layout.series(whole, steps + 1),
            layout.series(old, steps + 1),
            layout.series(new, steps),
        )
        self.x = Place(self.whole.offset, nx, self.whole.stride)
        self.sums = Place(self.whole.offset + nx, summed, self.whole.stride)
        self.inputs = layout.series(inputs, steps)
        self.given = Place(self.inputs.offset, m, self.inputs.stride)
        self.u = self.given if self.rollout.feedback is None else layout.take(m)
        self.time, self.tick = layout.series(1, steps + 1), layout.series(1, steps + 1)

    def outputs(self) -> dict[str, Place]:
        """Return all steps of each series in order; empty series are left out."""
        steps = self.rollout.steps
        series = {"x": (self.whole, steps + 1), "u": (self.inputs, steps), "new": (self.v, steps)}
        whole = {name: Place(place.offset, place.size * count) for name, (place, count) in series.items()}
        return {name: place for name, place in (whole | {"cost": self.cost}).items() if place.size}


def policy_program(
    step: LinearizedStep, sizes: PolicySizes, costs: RunningCosts | None, sums: RunningSums | None = None
) -> Program:
    """Return the program of a rollout under a policy, with the outputs ``x``, ``u``, ``new`` and ``cost``."""
    places = PolicyPlaces(step, sizes, sums)
    steps, tangent, policy = step.rollout.steps, step.tangent, places.policy
    about = Place(policy["x"].offset, places.x.size, policy["x"].stride)
    off = Place(places.off.offset, tangent.size)
    decided = (places.length, places.share, places.statics, places.off, places.held)
    physics = step_calls(places, step.exact)
    # Each step: deviation from the plan, decision of the policy, controllers and physics.
    body = [
        FunctionCall(tangent.distance, (about, places.x, places.nominal), (off,)),
        *_sums_apart(places, about, off),
        FunctionCall(
            decide(sizes, places.off.size),
            (*decided, *(policy[name] for name in POLICY_SERIES[1:])),
            (places.v, places.inputs, places.held.later()),
        ),
        *physics.body,
    ]
    if sums is not None:
        seen = (places.whole, places.x.later(), places.given, places.constants, places.tick, places.weights)
        body.append(FunctionCall(sums.function, seen, (places.sums.later(),)))
    epilogue: tuple[FunctionCall, ...] = ()
    # Costs of the states before and after each step, and of the last state.
    if costs is not None:
        here = (places.x, places.x, places.given, places.p, places.tick)
        there = (places.x.later(), places.x, places.given, places.p, places.tick.later())
        last = (
            places.x.later(steps),
            places.x.later(steps - 1),
            places.given.later(steps - 1),
            places.p,
            places.tick.later(steps),
        )
        body.append(FunctionCall(costs.before, here, (places.cost,), accumulate=True))
        body.append(FunctionCall(costs.after, there, (places.cost,), accumulate=True))
        still = tuple(each.still() for each in last)
        epilogue = (FunctionCall(costs.end, still, (places.cost,), accumulate=True),)
    return Program(
        size=places.layout.size,
        z=places.row,
        parameters=places.shared,
        steps=steps,
        outputs=places.outputs(),
        prologue=(*_prologue(step, places), *physics.numbers),
        body=tuple(body),
        epilogue=epilogue,
        zeroed=(places.cost,),
    )


def _sums_apart(places: PolicyPlaces, about: Place, off: Place) -> list[FunctionCall]:
    """Return the call for the last entries of the deviation from the plan: how far sums are from those of the plan."""
    if not (count := places.sums.size):
        return []
    plan, found = ca.SX.sym("plan", count), ca.SX.sym("found", count)
    apart = ca.Function("sums_apart", [plan, found], [found - plan])
    planned = Place(about.offset + about.size, count, about.stride)
    return [FunctionCall(apart, (planned, places.sums), (Place(off.offset + off.size, count),))]


def _prologue(step: LinearizedStep, places: PolicyPlaces) -> tuple[FunctionCall, ...]:
    """Return the calls for the start of a lane and the times and numbers of all states."""
    row, clock, steps = ca.SX.sym("row", places.row.size), ca.SX.sym("clock"), step.rollout.steps
    held, p = ca.SX.sym("held", places.first_held.size), ca.SX.sym("p", places.p.size)
    taken = (places.length, places.share, places.statics, places.constants, places.whole.still())
    ends = np.cumsum([0, *(each.size for each in taken)]).tolist()
    cut = [row[a:b] for a, b in pairwise(ends)]
    first = ca.Function("first", [row, held], [*cut, held])
    ticks: Any = clock / step.rollout.dt + ca.DM(np.arange(steps + 1))
    times = ca.Function("times", [clock, p], [ca.densify(each) for each in (step.arguments.time(ticks, p), ticks)])
    return (
        FunctionCall(first, (places.row, places.first_held), (*taken, places.held.still())),
        FunctionCall(
            times,
            (places.clock, places.p),
            (Place(places.time.offset, steps + 1), Place(places.tick.offset, steps + 1)),
        ),
    )


def decide(sizes: PolicySizes, n: int) -> ca.Function:
    """Return (length, share, statics, off, held, ``POLICY_SERIES`` without x) -> new knots, inputs, held knots.

    Matrices are row by row.
    """
    # Symbols; matrices are given row by row.
    old, new, inputs, s, _ = sizes
    acting, beside = old + new, n + old + s
    length, share = ca.SX.sym("length"), ca.SX.sym("share")
    statics, off, held = ca.SX.sym("statics", s), ca.SX.sym("off", n), ca.SX.sym("held", old)
    about, v, ahead, lower, upper = (ca.SX.sym("a", size) for size in (old, new, new, new, new))
    back, weights, keep = (ca.SX.sym("m", size) for size in (new * beside, inputs * acting, old * acting))
    # New knots = clip(v + length ahead + share back (deviation)); inputs are weighted knots.
    answer = _product(back, new, ca.vertcat(off, held - about, statics))
    chosen = ca.fmin(ca.fmax(v + length * ahead + share * answer, lower), upper)
    both = ca.vertcat(held, chosen)
    results = [chosen, _product(weights, inputs, both), _product(keep, old, both)]
    arguments = [length, share, statics, off, held, about, v, ahead, back, weights, keep, lower, upper]
    return ca.Function("decide", arguments, [ca.densify(each) for each in results])


def _product(matrix: Any, rows: int, column: Any) -> Any:
    """Return a matrix, given row by row, times a column."""
    return ca.mtimes(ca.reshape(matrix, column.shape[0], rows).T, column) if rows else ca.SX(0, 1)
