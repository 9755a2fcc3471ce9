"""IPOPT (Waechter and Biegler 2006) through casadi's nlpsol, in x = z / scale, with exact bounds and constraints.

The objective and the constraints are those of ``ShootingProblem.nlp``; its penalty on violated constraints, the merit,
ranks iterates that violate no constraint, or one as much as the other. Each iterate costs one rollout more, which tells
whether the targets are met. IPOPT may leave its best iterate for ever, by a step of its watchdog or over a cliff of the
objective; the best iterate is the result all the same.

The default Hessian is limited-memory BFGS, where IPOPT's own default is the exact one: that pays for few variables, and
is dear for many controls.

IPOPT's options pass through ``options`` unchanged, without a prefix. Its text goes to the log; it reads no option file.
A solve goes on from its last iterate with a fresh barrier, so its end may differ from that of one without a break.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np

from symphys.errors import SymphysError
from symphys.shooting import ShootingProblem
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.continuation import Request
from symphys.solvers.core.driver import begin, converged, run, silent
from symphys.solvers.core.evaluator import Meter, Verdict
from symphys.solvers.core.interface import Log, Solver
from symphys.solvers.core.options import at_least, require
from symphys.solvers.core.outcome import Array, Counts, Monitor, Outcome, Status
from symphys.solvers.core.point import Point
from symphys.solvers.methods.ipopt_functions import functions
from symphys.solvers.methods.ipopt_options import SILENT, check

BUDGET = "the iterations are used up: raise `iterations`, or try the other `hessian`"
ENDS: dict[str, tuple[Status, str]] = {
    "Maximum_Iterations_Exceeded": (Status.BUDGET, BUDGET),
    "Maximum_CpuTime_Exceeded": (Status.BUDGET, "the time given to IPOPT is used up: raise max_cpu_time"),
    "Maximum_WallTime_Exceeded": (Status.BUDGET, "the time given to IPOPT is used up: raise max_wall_time"),
    "Infeasible_Problem_Detected": (
        Status.STALLED,
        "the constraints contradict each other near here: see which is violated, loosen it, or start elsewhere",
    ),
    "Restoration_Failed": (
        Status.STALLED,
        "no point that satisfies the constraints was found: start nearer to one, or use smoothing above 0",
    ),
    "Search_Direction_Becomes_Too_Small": (
        Status.STALLED,
        "the steps became too small: the point may be at a kink (smoothing above 0 rounds it) or `tolerance` too tight",
    ),
    "Diverging_Iterates": (Status.STALLED, "the variables run away: bound them"),
    "Error_In_Step_Computation": (
        Status.STALLED,
        "no step could be computed: try the other `hessian`, or smoothing above 0",
    ),
    "Invalid_Number_Detected": (
        Status.NOT_FINITE,
        "a value or derivative is not finite: bound the variables, look for roots or norms of something that is zero "
        "in the formulas, or solve with smoothing above 0",
    ),
    "Not_Enough_Degrees_Of_Freedom": (Status.FAILED, "there are more equality constraints than variables"),
}
"""By IPOPT's name for how it ended."""
PASSED = (
    "IPOPT ended at a point that is worse than one that it had passed, which is kept: the objective may have a cliff "
    "or a kink there (smoothing above 0 rounds it), or a watchdog step led away (watchdog_shortened_iter_trigger = 0 "
    "in `options` forbids these)"
)
LOSS = 1e-6
"""Of 1 + |merit|: a solution may be worse by so much than an iterate before it."""
GOOD = ("Solve_Succeeded", "Solved_To_Acceptable_Level", "Feasible_Point_Found")


@dataclass(frozen=True)
class IpoptOptions:
    """Options of IPOPT.

    Attributes:
        iterations: at most, in each stage of smoothing.
        tolerance: IPOPT's tol, on its scaled optimality error.
        hessian: "limited-memory" or "exact".
        options: IPOPT's own, such as {mu_strategy = "adaptive"}, passed on as they are.
    """

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid"}

    iterations: int = 300
    tolerance: float = 1e-8
    hessian: Literal["limited-memory", "exact"] = "limited-memory"
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """ValueError that names the option and says what would be valid."""
        at_least(0, iterations=self.iterations)
        require(0 < self.tolerance < math.inf, "tolerance", "above 0")
        require(self.hessian in ("limited-memory", "exact"), "hessian", "limited-memory or exact")


@dataclass(frozen=True)
class State:
    """The last iterate.

    Attributes:
        iteration: of this stage.
        z: (n,).
    """

    iteration: int
    z: Array


def solve(
    problem: ShootingProblem,
    start: Array,
    options: IpoptOptions,
    seed: int = 0,
    monitor: Monitor | None = None,
    checkpoint: dict[str, object] | None = None,
    log: Log | None = None,
) -> Outcome:
    """Solve; nothing is drawn, so the seed acts through ``start`` alone. See ``interface.Solve``."""
    check(options.options)

    def stage(meter: Meter, z: Array, saved: dict[str, object] | None) -> Verdict:
        state = revive(State, saved) if saved else State(0, z)
        if not saved:
            meter.commit(begin(meter.value(z)), state)
        return descend(meter, options, state, log or silent)

    return run(Request("ipopt", problem, start, monitor, checkpoint, log, constraints=True), stage)


def descend(meter: Meter, options: IpoptOptions, state: State, log: Log) -> Verdict:
    """One call of IPOPT, then its counts, its log and its verdict."""
    watch, first = Watch(meter, state.iteration), len(meter.rows)
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "ipopt.txt"
        solver = build(meter, options, options.iterations - state.iteration, watch, text)
        result = solver(**arguments(meter, state.z))
        stats = solver.stats()
        for line in text.read_text(errors="replace").splitlines():
            log(line)
    meter.settle(first, work(stats, len(meter.problem.constraint_lower) > 0))
    if watch.ended:
        raise watch.ended
    return judged(meter, str(stats["return_status"]), np.array(result["x"]).ravel() * meter.scale)


def build(meter: Meter, options: IpoptOptions, iterations: int, watch: Watch, text: Path) -> Any:
    """The nlpsol over x = z / scale, the knob as its parameter."""
    if meter.problem.nlp.expression is None:
        raise SymphysError("IPOPT needs expressions, and nets this large have none; take gradient or cma")
    nlp, derivatives = functions(meter.problem.nlp, meter.scale, options.hessian == "exact")
    own = {
        **SILENT,
        "file_print_level": 5,
        "output_file": str(text),
        "max_iter": iterations,
        "tol": options.tolerance,
        "hessian_approximation": options.hessian,
        **options.options,
    }
    settings: dict[str, Any] = {
        **derivatives,
        "ipopt": own,
        "print_time": False,
        "iteration_callback": watch,
        "show_eval_warnings": False,
    }
    return ca.nlpsol("solve", "ipopt", nlp, settings)


def arguments(meter: Meter, z: Array) -> dict[str, Any]:
    """Start, knob and bounds."""
    problem, scale = meter.problem, meter.scale
    bounds = {"lbx": meter.lower / scale, "ubx": meter.upper / scale}
    limits = {"lbg": problem.constraint_lower, "ubg": problem.constraint_upper}
    return {"x0": z / scale, "p": meter.smoothing, **bounds, **limits}


def work(stats: dict[str, Any], constrained: bool) -> Counts:
    """What IPOPT evaluated; objective and constraints are separate rollouts."""
    called = {name: int(stats.get(f"n_call_nlp_{name}", 0)) for name in ("f", "g", "grad_f", "jac_g", "hess_l")}
    rollouts = called["f"] + (called["g"] if constrained else 0)
    return Counts(rollouts, called["grad_f"], called["jac_g"] if constrained else 0, called["hess_l"])


def judged(meter: Meter, ending: str, z: Array) -> Verdict:
    """The verdict; a solution that is worse than an iterate before it is none."""
    if ending in GOOD:
        solution = meter.value(meter.clip(z))
        return Verdict(Status.STALLED, PASSED) if worse(solution, meter.best or solution) else converged(meter)
    unknown = (Status.FAILED, f"IPOPT ended with {ending.replace('_', ' ').lower()}")
    return Verdict(*ENDS.get(ending, unknown))


def worse(solution: Point, best: Point) -> bool:
    """Whether the best iterate was better by more than what an end within a tolerance may lose."""
    return solution.rank[:-1] != best.rank[:-1] or solution.merit - best.merit > LOSS * (1 + abs(best.merit))


class Watch(ca.Callback):
    """Sees every iterate: one rollout, a row of the trace; ends the solve when a target is met or on interruption."""

    def __init__(self, meter: Meter, iteration: int) -> None:
        """``iteration``: of the start, which has its row already."""
        ca.Callback.__init__(self)
        self.meter, self.iteration, self.skip = meter, iteration, True
        self.ended: BaseException | None = None
        self.construct("watch", {})

    def get_n_in(self) -> int:
        """All that nlpsol gives out."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Whether to stop."""
        return 1

    def get_sparsity_in(self, index: int) -> Any:
        """By the name of the argument."""
        n, m = self.meter.problem.n, len(self.meter.problem.constraint_lower)
        sizes = {"x": n, "lam_x": n, "f": 1, "g": m, "lam_g": m, "lam_p": 1}
        return ca.Sparsity.dense(sizes[ca.nlpsol_out(index)], 1)

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        """No exception may leave it: casadi would lose it."""
        if self.skip:
            self.skip = False
            return [0.0]
        try:
            self.see(self.meter.clip(np.array(arguments[0]).ravel() * self.meter.scale))
        except (Exception, KeyboardInterrupt) as error:
            self.ended = error
        return [float(self.ended is not None)]

    def see(self, z: Array) -> None:
        """A row of the trace."""
        before = self.meter.last
        point = self.meter.value(z)
        self.iteration += 1
        length = math.nan if before is None else float(np.linalg.norm(z - before))
        self.meter.commit(point, State(self.iteration, z), step=length)


IPOPT = Solver("ipopt", "interior point with exact bounds and constraints, by casadi and IPOPT", IpoptOptions, solve)
