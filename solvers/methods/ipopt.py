"""IPOPT (Waechter and Biegler 2006) through casadi's nlpsol, in x = z / scale, with exact bounds and constraints.

The objective and the constraints are those of ``ShootingProblem.nlp``; its penalty on violated constraints, the merit,
ranks iterates that violate no constraint, or one as much as the other. Each iterate costs one rollout more, which shows
whether the targets are met. IPOPT may leave its best iterate for ever, by a step of its watchdog or over a cliff of the
objective; the best iterate is the result all the same.

The default Hessian is limited-memory BFGS, where IPOPT's own default is the exact one: that pays for few variables, and
is dear for many controls.

IPOPT runs its own loop, so this is no ``interface.Method`` but a stage by itself: a callback records each iterate.
IPOPT's options pass through ``options`` unchanged, without a prefix. Its text goes to the log; it reads no option file.
A solve goes on from its last iterate with a fresh barrier, so its end may differ from that of one without a break.
"""

from __future__ import annotations

import contextlib
import io
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, Literal

import casadi as ca
import numpy as np

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.shooting import Nlp
from symphys.solvers.core.checkpoint import revive
from symphys.solvers.core.convergence import converged, not_finite
from symphys.solvers.core.driver import make_solver
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, IterationRecorder, StageContext
from symphys.solvers.core.options import SolverOptions, at_least, refuse, require
from symphys.solvers.core.outcome import Counts, Status, StopReason
from symphys.solvers.core.point import Point
from symphys.types import Array

LIBRARY = "a problem file loads no library: install it where IPOPT looks by itself"
RESERVED = {
    "max_iter": "use iterations",
    "tol": "use tolerance",
    "hessian_approximation": "use hessian",
    "print_level": "the text goes to the log: use file_print_level",
    "output_file": "the text goes to the log",
    "option_file_name": "no option file is read",
    "sb": "the text goes to the log",
    "hsllib": LIBRARY,
    "pardisolib": LIBRARY,
}
"""Options that are not passed on, each with the reason."""
SILENT: dict[str, Any] = {"print_level": 0, "sb": "yes", "option_file_name": ""}
"""Options with which IPOPT neither prints nor reads ipopt.opt from the current folder."""


def check(options: Mapping[str, Any]) -> None:
    """Raise SymphysError for the first option that IPOPT refuses, or that cannot be passed on."""
    for name, value in options.items():
        if name in RESERVED:
            raise refuse("ipopt", name, f"cannot be set: {RESERVED[name]}")
        reason = refusal(name, value)
        if reason:
            raise refuse("ipopt", name, f"IPOPT does not take {value!r}: {reason}")


def refusal(name: str, value: Any) -> str:
    """Return why IPOPT refuses an option; empty if it does not."""
    x = ca.MX.sym("x")
    problem: dict[str, Any] = {"x": x, "f": x**2}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        try:
            solver = ca.nlpsol("trial", "ipopt", problem, {"ipopt": {**SILENT, name: value}, "print_time": False})
            solver(x0=1)
        except (RuntimeError, NotImplementedError) as error:
            return explain(printed.getvalue(), str(error))
    return "it is not available here" if solver.stats()["return_status"] == "Invalid_Option" else ""


def explain(printed: str, error: str) -> str:
    """Return the relevant part of what IPOPT printed or casadi raised."""
    lines = [" ".join(line.split()) for line in printed.splitlines() if line.strip()]
    if lines:
        start = next((i for i, line in enumerate(lines) if line.startswith(("Valid", "Allowed"))), 0)
        return "; ".join(lines[start : start + 6])
    if "No such IPOPT option" in error:
        return "there is no such option"
    return "it is of the wrong type" if "type mismatch" in error else error.strip().splitlines()[-1]


BUDGET = "the iterations are used up: raise `iterations`, or try the other `hessian`"
ENDINGS: dict[str, tuple[Status, str]] = {
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
"""Status and advice by IPOPT's return status."""
WORSE_THAN_ITERATE = (
    "IPOPT ended at a point that is worse than one that it had passed, which is kept: the objective may have a cliff "
    "or a kink there (smoothing above 0 rounds it), or a watchdog step led away (watchdog_shortened_iter_trigger = 0 "
    "in `options` forbids these)"
)
MERIT_TOLERANCE = 1e-6
"""Share of 1 + |merit| by which a solution may be worse than an earlier iterate."""
SUCCESS_STATUSES = ("Solve_Succeeded", "Solved_To_Acceptable_Level", "Feasible_Point_Found")


@dataclass(frozen=True)
class IpoptOptions(SolverOptions):
    """Options of IPOPT.

    Attributes:
        iterations: largest number in each smoothing stage.
        tolerance: IPOPT's tol, on its scaled optimality error.
        hessian: BFGS approximation or exact second derivatives.
        options: IPOPT's own options, such as {mu_strategy = "adaptive"}.
    """

    iterations: int = 300
    tolerance: float = 1e-8
    hessian: Literal["limited-memory", "exact"] = "limited-memory"
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        at_least(0, iterations=self.iterations)
        require(0 < self.tolerance < math.inf, "tolerance", "above 0")
        require(self.hessian in ("limited-memory", "exact"), "hessian", "limited-memory or exact")


@dataclass(frozen=True)
class IpoptState:
    """The last iterate.

    Attributes:
        iteration: of this stage.
        z: (n,).
    """

    iteration: int
    z: Array


def stage(
    context: StageContext, options: IpoptOptions, saved: dict[str, object] | None, recorder: IterationRecorder
) -> StopReason:
    """Run IPOPT once, then add its counts and its log. Nothing is drawn: the seed acts only through the start."""
    evaluator = context.evaluator
    state = revive(IpoptState, saved) if saved else IpoptState(0, context.start)
    if not saved:
        point = evaluator.value(state.z)
        if not point.finite:
            return not_finite(point)
        recorder.commit(Iteration(state, point))
    spent = recorder.spent()
    if spent is not None:
        return spent
    watch, first = IterateCallback(evaluator, recorder, state), recorder.rows
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "ipopt.txt"
        solver = build(evaluator, options, options.iterations - state.iteration, watch, text)
        result = solver(**arguments(evaluator, state.z))
        stats = solver.stats()
        for line in text.read_text(errors="replace").splitlines():
            context.log(line)
    recorder.distribute(work(stats, len(evaluator.problem.constraint_lower) > 0), first)
    if watch.ended:
        raise watch.ended
    if watch.spent is not None:
        return watch.spent
    return reason(evaluator, str(stats["return_status"]), np.array(result["x"]).ravel() * evaluator.scale)


def build(
    evaluator: CountingEvaluator, options: IpoptOptions, iterations: int, watch: IterateCallback, text: Path
) -> Any:
    """Make the nlpsol over x = z / scale, with the smoothing as its parameter."""
    if evaluator.problem.nlp.expression is None:
        raise SymphysError("IPOPT needs expressions, which nets this large do not have; take gradient or cma")
    nlp, derivatives = functions(evaluator.problem.nlp, evaluator.scale, options.hessian == "exact")
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


def arguments(evaluator: CountingEvaluator, z: Array) -> dict[str, Any]:
    """Return start, smoothing and bounds."""
    problem, scale = evaluator.problem, evaluator.scale
    bounds = {"lbx": evaluator.lower / scale, "ubx": evaluator.upper / scale}
    limits = {"lbg": problem.constraint_lower, "ubg": problem.constraint_upper}
    return {"x0": z / scale, "p": evaluator.smoothing, **bounds, **limits}


def work(stats: dict[str, Any], constrained: bool) -> Counts:
    """Return the work of IPOPT; objective and constraints are separate rollouts."""
    called = {name: int(stats.get(f"n_call_nlp_{name}", 0)) for name in ("f", "g", "grad_f", "jac_g", "hess_l")}
    rollouts = called["f"] + (called["g"] if constrained else 0)
    return Counts(rollouts, called["grad_f"], called["jac_g"] if constrained else 0, called["hess_l"])


def reason(evaluator: CountingEvaluator, ending: str, z: Array) -> StopReason:
    """Return why IPOPT ended; a solution that is worse than an earlier iterate counts as stalled."""
    if ending in SUCCESS_STATUSES:
        solution = evaluator.value(evaluator.clip(z))
        return (
            StopReason(Status.STALLED, WORSE_THAN_ITERATE)
            if worse(solution, evaluator.incumbent.best or solution)
            else converged(evaluator)
        )
    unknown = (Status.FAILED, f"IPOPT ended with {ending.replace('_', ' ').lower()}")
    return StopReason(*ENDINGS.get(ending, unknown))


def worse(solution: Point, best: Point) -> bool:
    """Whether the best iterate was better by more than the tolerance of a converged solve."""
    return solution.rank[:-1] != best.rank[:-1] or solution.merit - best.merit > MERIT_TOLERANCE * (1 + abs(best.merit))


class IterateCallback(ca.Callback):
    """Records every iterate with one rollout; ends the solve when all is met, at limits, on Ctrl-C."""

    def __init__(self, evaluator: CountingEvaluator, recorder: IterationRecorder, state: IpoptState) -> None:
        """Start from ``state``, whose row is recorded already."""
        ca.Callback.__init__(self)
        self.evaluator, self.recorder, self.state, self.skip = evaluator, recorder, state, True
        self.ended: BaseException | None = None
        self.spent: StopReason | None = None
        self.construct("watch", {})

    def get_n_in(self) -> int:
        """Return the number of inputs: all outputs of nlpsol."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return the number of outputs: the flag that stops IPOPT."""
        return 1

    def get_sparsity_in(self, index: int) -> Any:
        """Return the sparsity of an argument by its name."""
        n, m = self.evaluator.problem.n, len(self.evaluator.problem.constraint_lower)
        sizes = {"x": n, "lam_x": n, "f": 1, "g": m, "lam_g": m, "lam_p": 1}
        return ca.Sparsity.dense(sizes[ca.nlpsol_out(index)], 1)

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        """Record; exceptions are stored, since casadi would lose them."""
        if self.skip:
            self.skip = False
            return [0.0]
        try:
            self.record(self.evaluator.clip(np.array(arguments[0]).ravel() * self.evaluator.scale))
        except (Exception, KeyboardInterrupt) as error:
            self.ended = error
        return [float(self.ended is not None or self.spent is not None)]

    def record(self, z: Array) -> None:
        """Record a row of the trace, after which a limit of the solve may end it."""
        point, before = self.evaluator.value(z), self.state
        self.state = IpoptState(before.iteration + 1, z)
        self.recorder.commit(Iteration(self.state, point, step=float(np.linalg.norm(z - before.z))))
        self.spent = self.recorder.spent()


def functions(nlp: Nlp, scale: Array, exact: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the problem for ``casadi.nlpsol``, and settings with its derivatives.

    Casadi differentiates the expression itself; compiled functions are handed over, an exact Hessian aside, which
    is that of the expression always.
    """
    x, smoothing = ca.MX.sym("x", len(scale)), ca.MX.sym("smoothing")
    objective, constraints = (nlp.value or nlp.expression)(x * scale, smoothing)
    problem = {"x": x, "p": smoothing, "f": objective, "g": constraints}
    settings: dict[str, Any] = {"no_nlp_grad": True, "calc_lam_p": False} if nlp.value else {}
    if nlp.gradient:
        f, slope = nlp.gradient(x * scale, smoothing)
        settings["grad_f"] = ca.Function("nlp_grad_f", [x, smoothing], [f, slope * scale])
    if nlp.jacobian:
        g, slopes = nlp.jacobian(x * scale, smoothing)
        scaled = ca.mtimes(slopes, ca.diag(ca.DM(scale)))
        settings["jac_g"] = ca.Function("nlp_jac_g", [x, smoothing], [g, scaled])
    if nlp.value and exact:
        settings["hess_lag"] = hessian(nlp, scale, x, smoothing)
    return problem, settings


def hessian(nlp: Nlp, scale: Array, x: Any, smoothing: Any) -> ca.Function:
    """Return the upper half of the Lagrangian's second derivative."""
    objective, constraints = nlp.expression(x * scale, smoothing)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", constraints.sparsity())
    lagrangian = lam_f * objective + ca.dot(lam_g, constraints)
    second = ca.triu(ca.hessian(lagrangian, x)[0])
    return ca.Function("nlp_hess_l", [x, smoothing, lam_f, lam_g], [second])


IPOPT = make_solver(
    "ipopt",
    "interior point with exact bounds and constraints, by casadi and IPOPT",
    IpoptOptions,
    stage,
    check=lambda options: check(options.options),
    constraints=True,
)
