"""Direct multiple shooting (Bock and Plitt 1984): the states at nodes are variables too, and defects are constraints.

Every interval between two nodes is simulated by itself, so what is unstable over the whole horizon grows over one
interval only, and a guess of the states counts as much as one of the controls. The nodes are tangents at reference
states; where a tangent turns far, the solve goes on from the same point with references at its nodes.

Iterates have gaps: their motion is none. What is compared and kept is the exact rollout of their z, one for each, as
for IPOPT. The solution is z; its nodes are what its rollout passes through, up to the largest defect, which every row
of the trace has.
"""

from __future__ import annotations

import math
from dataclasses import field, replace
from typing import Any, Literal

import casadi as ca
import numpy as np

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.shooting import ShootingProblem, StagedProblem
from symphys.solvers.core.checkpoint import damaged, revive
from symphys.solvers.core.convergence import converged, not_finite
from symphys.solvers.core.driver import make_solver
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, IterationRecorder, StageContext
from symphys.solvers.core.options import SolverOptions, at_least, refuse, require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.methods.ipopt import ENDINGS, RESERVED, SUCCESS_STATUSES, worse
from symphys.solvers.methods.ipopt import refusal as refused_by_ipopt
from symphys.solvers.multiple_shooting.by_fatrop import (
    NO_STEP,
    RESERVED_OF_FATROP,
    SlopesNotFinite,
    refused_by_fatrop,
    solve_by_fatrop,
)
from symphys.solvers.multiple_shooting.by_ipopt import solve_by_ipopt
from symphys.solvers.multiple_shooting.grid import make_grid
from symphys.solvers.multiple_shooting.library import ITERATIONS_USED, LibraryRequest, LibraryResult
from symphys.solvers.multiple_shooting.nlp import (
    MultipleShootingNlp,
    NlpMultipliers,
    Programs,
    at_nodes,
    barrier_at,
    fitted,
)
from symphys.types import Array

DEFECT = "largest defect"
NO_STEPS = (
    "this problem cannot be taken step by step, which multiple shooting needs: take ipopt, gradient, or least_squares "
    "where costs are squares"
)
ROLLOUT_WORSE = (
    "the rollout of the solution is worse than that of an iterate before it, which is kept: the motion is so unstable "
    "that what is left of the defects grows along it (a lower `tolerance`, or a feedback controller)"
)
NO_FATROP_STEP = (
    "FATROP found no step that leads on: try backend = 'ipopt', another [guess] of the motion, or a larger `tolerance`"
)
MAX_CHART_DEVIATION = 0.5
"""Deviation of a node's chart slope from the unit matrix, about one radian, that needs a new reference."""


@dataclass(frozen=True)
class MultipleShootingOptions(SolverOptions):
    """Options of multiple shooting.

    Attributes:
        iterations: largest number in each smoothing stage.
        tolerance: on the scaled optimality error; also bounds the defects.
        steps_between_nodes: steps in each shooting interval; 0: at most 40 intervals.
        backend: NLP solver; FATROP factorises stage by stage.
        hessian: "gauss-newton" omits the curvature of steps and constraints, "exact" includes it, "limited-memory" is
            IPOPT's; "auto": gauss-newton if all costs are sums of squares, else exact.
        options: options of IPOPT, such as {mu_strategy = "adaptive"}, or of FATROP.
    """

    iterations: int = 200
    tolerance: float = 1e-6
    steps_between_nodes: int = 0
    backend: Literal["ipopt", "fatrop"] = "ipopt"
    hessian: Literal["auto", "gauss-newton", "exact", "limited-memory"] = "auto"
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        at_least(0, iterations=self.iterations, steps_between_nodes=self.steps_between_nodes)
        require(0 < self.tolerance < math.inf, "tolerance", "above 0")
        require(self.backend in ("ipopt", "fatrop"), "backend", "ipopt or fatrop")
        known = ("auto", "gauss-newton", "exact", "limited-memory")
        require(self.hessian in known, "hessian", "auto, gauss-newton, exact or limited-memory")
        taken = self.backend == "ipopt" or self.hessian != "limited-memory"
        require(taken, "hessian", "auto, gauss-newton or exact with backend = fatrop")

    def exact(self, squares: bool) -> bool:
        """Whether Hessians are exact; ``squares``: whether every cost is a sum of squares.

        Gauss-Newton has no curvature for a cost such as the duration: all of it is in steps and constraints.
        """
        return self.hessian == "exact" or (self.hessian == "auto" and not squares)


@dataclass(frozen=True)
class MultipleShootingState:
    """An iterate.

    Attributes:
        iteration: of this stage.
        z: (n,).
        nodes: (M, nx) states at nodes 1 to M.
        bound_duals, row_duals: multipliers where IPOPT reports them, for tangents at these nodes; else empty.
        barrier: mu there.
    """

    iteration: int
    z: Array
    nodes: Array
    bound_duals: Array
    row_duals: Array
    barrier: float


def stage(
    context: StageContext,
    options: MultipleShootingOptions,
    saved: dict[str, object] | None,
    recorder: IterationRecorder,
) -> StopReason:
    """Call IPOPT or FATROP repeatedly, each time with references at the nodes of the previous call."""
    # Start: nodes and multipliers of the guess, or of the checkpoint.
    evaluator = context.evaluator
    assert evaluator.problem.staged is not None, "refused otherwise"
    problem = evaluator.problem.staged()
    state = revive(MultipleShootingState, saved) if saved else guess(problem, context, options)
    grid = make_grid(problem, options.steps_between_nodes)
    if state.nodes.shape != (grid.intervals, problem.state_size):
        raise damaged(ValueError("other nodes"))
    point = None if saved else evaluator.value(state.z)
    if point is not None and not point.finite and not evaluator.problem.guessed_states:
        return not_finite(point)
    layout_in_stages, exact = options.backend == "fatrop", options.exact(problem.squares)
    programs = Programs(problem, grid, evaluator, state.z, state.nodes, layout_in_stages, exact)
    if point is not None:
        state = warm_started(context, programs.at(state.nodes), state)
        recorder.commit(Iteration(state, point, outputs={DEFECT: programs.at(state.nodes).largest_defect(state.z)}))
    while True:
        # One call of the library with references at the present nodes.
        spent = recorder.spent()
        if spent is not None:
            return spent
        if state.iteration >= options.iterations:
            return StopReason(*ENDINGS[ITERATIONS_USED])
        nlp = programs.at(state.nodes)
        watch, first = ShootingWatch(evaluator, recorder, nlp, state), recorder.rows
        ending, result = run(nlp, evaluator, options, state, watch, context)
        recorder.distribute(nlp.work, first)
        if isinstance(watch.error, SlopesNotFinite):
            return StopReason(*ENDINGS["Invalid_Number_Detected"])
        if watch.error:
            raise watch.error
        if watch.spent is not None:
            return watch.spent
        # Again with new references after large rotations, or with exact Hessians where FATROP stalls.
        state = watch.state
        if watch.turned:
            context.log("nodes have turned far: new references")
        elif ending == NO_STEP and not programs.exact:
            programs.exact = True
            context.log("FATROP found no step that leads on: exact Hessians from here")
        else:
            if np.isfinite(result.w).all():
                known = multipliers_at(nlp, evaluator, result.w, result.bound_duals, result.row_duals)
                recorder.multipliers(known.by_name(nlp))
            return reason(context, nlp, ending, result.w)


def guess(problem: StagedProblem, context: StageContext, options: MultipleShootingOptions) -> MultipleShootingState:
    """Return the start: nodes from the rollout of z or, in the first stage of smoothing, from the guess."""
    evaluator, z = context.evaluator, context.start
    starts = make_grid(problem, options.steps_between_nodes).starts[1:]
    if evaluator.problem.guessed_states and evaluator.smoothing == evaluator.problem.smoothing[0]:
        nodes = evaluator.problem.guessed_states(z, starts, evaluator.smoothing)
    else:
        nodes = problem.roll_out(z, evaluator.smoothing).x[starts]
    return MultipleShootingState(0, z, nodes, np.zeros(0), np.zeros(0), math.nan)


def warm_started(
    context: StageContext, nlp: MultipleShootingNlp, state: MultipleShootingState
) -> MultipleShootingState:
    """Return the start with the multipliers of the guess, in the first stage if the seed keeps the guess."""
    problem, smoothing = context.evaluator.problem, context.evaluator.smoothing
    if not problem.multipliers or context.seed or smoothing != problem.smoothing[0]:
        return state
    known = fitted(nlp, problem.multipliers)
    context.log("multipliers of the guess: " + ("none fit, of other nodes or limits" if known is None else "taken"))
    if known is None:
        return state
    return replace(state, bound_duals=known.bounds, row_duals=known.rows, barrier=known.barrier)


def run(
    nlp: MultipleShootingNlp,
    evaluator: CountingEvaluator,
    options: MultipleShootingOptions,
    state: MultipleShootingState,
    watch: ShootingWatch,
    context: StageContext,
) -> tuple[str, LibraryResult]:
    """Call the library once; return how it ended, in IPOPT's terms, and its result."""
    acting = np.zeros(len(state.z), bool)
    for entries in (*nlp.plan.grid.knots, nlp.plan.grid.statics):
        acting[entries] = True
    lower, upper = (np.where(acting, bound, state.z) for bound in (evaluator.lower, evaluator.upper))
    request = LibraryRequest(
        nlp,
        nlp.pack(state.z, np.zeros((nlp.plan.grid.intervals, nlp.plan.grid.tangent_size))),
        *nlp.bounds(lower, upper),
        state.bound_duals,
        state.row_duals,
        state.barrier,
        options.iterations - state.iteration,
        options.tolerance,
        options.hessian == "limited-memory",
        options.options,
        context.log,
    )
    if options.backend == "fatrop":
        return solve_by_fatrop(request, watch)
    return solve_by_ipopt(request, watch)


class ShootingWatch:
    """Records every iterate with one rollout; ends the call at limits, on Ctrl-C, at large rotations."""

    def __init__(
        self,
        evaluator: CountingEvaluator,
        recorder: IterationRecorder,
        nlp: MultipleShootingNlp,
        state: MultipleShootingState,
    ) -> None:
        """Start from ``state``, whose row is recorded already."""
        self.evaluator, self.recorder, self.nlp, self.state = evaluator, recorder, nlp, state
        self.error: BaseException | None = None
        self.spent: StopReason | None = None
        self.turned = False

    @property
    def ended(self) -> bool:
        """Implement ``IterateWatch.ended``."""
        return self.error is not None or self.spent is not None or self.turned

    def iterate(self, w: Array, bound_duals: Array, row_duals: Array) -> bool:
        """Implement ``IterateWatch.iterate``."""
        nlp, before = self.nlp, self.state
        z, shots = self.evaluator.clip(nlp.unpack(w)[0]), nlp.shots(w)
        turns = shots.turns
        known = multipliers_at(nlp, self.evaluator, w, bound_duals, row_duals)
        duals = known.bounds, known.rows, known.barrier
        self.state = MultipleShootingState(before.iteration + 1, z, shots.nodes, *duals)
        self.recorder.multipliers(known.by_name(nlp))
        defect = float(np.abs(shots.defects).max())
        step = float(np.linalg.norm(z - before.z))
        self.recorder.commit(Iteration(self.state, self.evaluator.value(z), step=step, outputs={DEFECT: defect}))
        self.spent = self.recorder.spent()
        self.turned = bool(np.abs(turns - np.eye(turns.shape[1])).max() > MAX_CHART_DEVIATION)
        return self.ended


def multipliers_at(
    nlp: MultipleShootingNlp, evaluator: CountingEvaluator, w: Array, bound_duals: Array, row_duals: Array
) -> NlpMultipliers:
    """Return the multipliers of w, with which another call may start from references at w's nodes."""
    mu = barrier_at(nlp, evaluator.lower, evaluator.upper, w, bound_duals, row_duals)
    return NlpMultipliers(bound_duals, at_nodes(nlp, w, row_duals), mu)


def reason(context: StageContext, nlp: MultipleShootingNlp, ending: str, w: Array) -> StopReason:
    """Return why a library ended; a solution whose rollout is worse than an earlier iterate's counts as stalled."""
    evaluator, grid = context.evaluator, nlp.plan.grid
    if np.isfinite(w).all():
        defect = np.abs(nlp.shots(w).defects).max()
        context.log(
            f"{grid.intervals} intervals of {int(np.diff(grid.starts).max())} steps, defects up to {defect:.2e}"
        )
    if ending in SUCCESS_STATUSES:
        solution = evaluator.value(evaluator.clip(nlp.unpack(w)[0]))
        best = evaluator.incumbent.best or solution
        return StopReason(Status.STALLED, ROLLOUT_WORSE) if worse(solution, best) else converged(evaluator)
    if ending == NO_STEP:
        return StopReason(Status.STALLED, NO_FATROP_STEP)
    return StopReason(*ENDINGS.get(ending, (Status.FAILED, f"IPOPT ended with {ending.replace('_', ' ').lower()}")))


def refusal(problem: ShootingProblem) -> str:
    """Return why the solver is not for a problem; empty if it is."""
    return NO_STEPS if problem.staged is None else ""


def check(options: MultipleShootingOptions) -> None:
    """Raise SymphysError for an option that the library refuses, or for a missing library."""
    if not ca.has_nlpsol(options.backend):
        raise SymphysError(f"solver.multiple_shooting.backend: this casadi has no {options.backend}")
    library, refused = ("IPOPT", refused_by_ipopt) if options.backend == "ipopt" else ("FATROP", refused_by_fatrop)
    for name, value in options.options.items():
        why = (RESERVED | RESERVED_OF_FATROP).get(name) or refused(name, value)
        if why:
            raise refuse("multiple_shooting", name, f"{library} does not take {value!r}: {why}")


MULTIPLE_SHOOTING = make_solver(
    "multiple_shooting",
    "states at nodes as variables, defects as constraints, by IPOPT or FATROP",
    MultipleShootingOptions,
    stage,
    check=check,
    refusal=refusal,
    constraints=True,
    by_steps=True,
)
