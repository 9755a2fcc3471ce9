"""The program of multiple shooting solved by IPOPT or FATROP, both through casadi's nlpsol and callbacks.

IPOPT takes derivatives as options. FATROP (Vanroye et al. 2023, arXiv 2303.16746), which factorises stage after stage,
has no such options: there they are put into the cache of the solver's functions, from which casadi takes those that it
would derive. IPOPT reports iterates, multipliers included; of FATROP an iterate is a point where it asks for the slopes
of the constraints. FATROP takes no multipliers to start from.

No exception may leave a callback, since casadi would lose it. After the first, or where the solve is to end, IPOPT gets
nan everywhere and stops. FATROP does not stop at nan: it gets a quadratic program that the present point solves, and
has converged a few iterations later. Numbers that are not finite reach it as large ones, so that it shortens its step.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.solvers.methods.ipopt_options import SILENT
from symphys.solvers.multiple_shooting.nlp import MultipleShootingNlp

Array = NDArray[np.float64]
POINT = ca.Sparsity.dense(1, 1)
ITERATIONS_USED = "Maximum_Iterations_Exceeded"
SUCCEEDED, NO_STEP = "Solve_Succeeded", "Fatrop_No_Step"
"""How FATROP ends, beside a budget that is used up."""
LARGE = 1e20


class IterateWatch(Protocol):
    """Takes the iterates of a library."""

    error: BaseException | None

    def iterate(self, w: Array, bound_duals: Array, row_duals: Array) -> bool:
        """Record an iterate; whether to end. Duals are empty where a library does not report them."""
        ...

    @property
    def ended(self) -> bool:
        """Whether the solve is to end, by an error or else."""
        ...


@dataclass(frozen=True)
class LibraryRequest:
    """What a library is asked.

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


class NlpPart(ca.Callback):
    """One of the program's functions for casadi."""

    def __init__(
        self,
        name: str,
        inputs: Sequence[ca.Sparsity],
        outputs: Sequence[ca.Sparsity],
        compute: Callable[..., list[Any]],
        watch: IterateWatch,
        rest: Sequence[Any] = (),
    ) -> None:
        """``compute`` takes arrays and returns the nonzeros of each output, which ``rest`` replaces at the end."""
        ca.Callback.__init__(self)
        self.inputs, self.outputs, self.compute, self.watch = inputs, outputs, compute, watch
        self.rest = rest or [np.full(sparsity.nnz(), np.nan) for sparsity in outputs]
        self.construct(name, {})

    def get_n_in(self) -> int:
        """The number of inputs."""
        return len(self.inputs)

    def get_n_out(self) -> int:
        """The number of outputs."""
        return len(self.outputs)

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        """Of an input."""
        return self.inputs[index]

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        """Of an output."""
        return self.outputs[index]

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        """Compute."""
        if not self.watch.ended:
            try:
                with np.errstate(all="ignore"):
                    found = self.compute(*(each.full().ravel() for each in arguments))
                return [ca.DM(sparsity, each) for sparsity, each in zip(self.outputs, found, strict=True)]
            except (Exception, KeyboardInterrupt) as error:
                self.watch.error = error
        return [ca.DM(sparsity, each) for sparsity, each in zip(self.outputs, self.rest, strict=True)]


class IpoptIterates(ca.Callback):
    """IPOPT's iterates, the start left out."""

    def __init__(self, nlp: MultipleShootingNlp, watch: IterateWatch) -> None:
        """Nothing is recorded yet."""
        ca.Callback.__init__(self)
        size, rows = nlp.layout.size, nlp.layout.rows
        self.sizes = {"x": size, "lam_x": size, "f": 1, "g": rows, "lam_g": rows, "lam_p": 1}
        self.watch, self.skip = watch, True
        self.construct("iterates", {})

    def get_n_in(self) -> int:
        """All outputs of nlpsol."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Whether to stop."""
        return 1

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        """By the name of the argument."""
        return ca.Sparsity.dense(self.sizes[ca.nlpsol_out(index)], 1)

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        """Record."""
        if self.skip:
            self.skip = False
            return [0.0]
        given = {ca.nlpsol_out(k): each.full().ravel() for k, each in enumerate(arguments)}
        try:
            return [float(self.watch.ended or self.watch.iterate(given["x"], given["lam_x"], given["lam_g"]))]
        except (Exception, KeyboardInterrupt) as error:
            self.watch.error = error
            return [1.0]


def solve_by_ipopt(request: LibraryRequest, watch: IterateWatch) -> tuple[str, Array]:
    """IPOPT's name for how it ended, and the last w (size,)."""
    nlp, size, rows = request.nlp, request.nlp.layout.size, request.nlp.layout.rows
    w, g = ca.Sparsity.dense(size, 1), ca.Sparsity.dense(rows, 1)
    value, constraints = values(nlp, watch)
    parts = {
        "grad_f": NlpPart(
            "nlp_grad_f", [w, POINT], [POINT, w], lambda x, p: [nlp.objective(x), nlp.gradient(x)], watch
        ),
        "jac_g": NlpPart(
            "nlp_jac_g",
            [w, POINT],
            [g, nlp.jacobian_pattern.sparsity],
            lambda x, p: [nlp.constraints(x), nlp.jacobian(x)],
            watch,
        ),
    }
    if not request.limited_memory:
        parts["hess_lag"] = NlpPart(
            "nlp_hess_l",
            [w, POINT, POINT, g],
            [nlp.upper_pattern.sparsity],
            lambda x, p, factor, duals: [nlp.hessian(x, float(factor[0]), duals, True)],
            watch,
        )
    warm = {
        "warm_start_init_point": "yes",
        "warm_start_bound_push": 1e-9,
        "warm_start_slack_bound_push": 1e-9,
        "warm_start_mult_bound_push": 1e-9,
        "mu_init": request.barrier,
    }
    iterates = IpoptIterates(nlp, watch)
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "ipopt.txt"
        own = {
            **SILENT,
            "file_print_level": 5,
            "output_file": str(text),
            "max_iter": request.iterations,
            "tol": request.tolerance,
            "hessian_approximation": "limited-memory" if request.limited_memory else "exact",
            **(warm if request.row_duals.size else {}),
            **request.options,
        }
        settings = {**parts, "ipopt": own, "iteration_callback": iterates, "no_nlp_grad": True, "calc_lam_p": False}
        result, stats = called("ipopt", (value, constraints), settings, request)
        for line in text.read_text(errors="replace").splitlines():
            request.log(line)
    return str(stats["return_status"]), result


def solve_by_fatrop(request: LibraryRequest, watch: IterateWatch) -> tuple[str, Array]:
    """How FATROP ended in IPOPT's words, and the last w (size,)."""
    parts = FatropParts(request, watch)
    most = max(request.iterations - 1, 0)  # it makes one more than it is told
    own = {"print_level": 0, "max_iter": most, "tolerance": request.tolerance, **request.options}
    structure = {"structure_detection": "manual", **request.nlp.layout.structure}
    settings = {**structure, "cache": parts.cache, "fatrop": own}
    result, stats = called("fatrop", (parts.value, parts.constraints), settings, request)
    iterations, status = int(stats["iter_count"]), int(stats["return_status"])
    request.log(f"FATROP: {iterations} iterations, ended with {status}")
    if status == 0:
        return SUCCEEDED, result
    return ITERATIONS_USED if iterations >= most else NO_STEP, result


class FatropParts:
    """The program's functions in the form that FATROP asks for.

    Attributes:
        value, constraints: the program.
        cache: its derivatives, by the names under which casadi looks for them.
    """

    def __init__(self, request: LibraryRequest, watch: IterateWatch) -> None:
        """Make the callbacks, and what they return once the solve is to end."""
        nlp, size, rows = request.nlp, request.nlp.layout.size, request.nlp.layout.rows
        self.nlp, self.watch, self.last = nlp, watch, request.w.tobytes()
        w, g = ca.Sparsity.dense(size, 1), ca.Sparsity.dense(rows, 1)
        jacobian, hessian = nlp.jacobian_pattern.sparsity, nlp.hessian_pattern.sparsity
        flat, inside, slopes = np.zeros(size), within(*nlp.row_bounds()), nlp.jacobian(request.w)
        columns = np.repeat(np.arange(size), np.diff(hessian.colind()))
        unit = (np.array(hessian.row()) == columns).astype(float)
        asked = [w, POINT, POINT, g]

        def made(name: str, given: list[Any], outputs: list[Any], compute: Any, rest: list[Any]) -> NlpPart:
            return NlpPart(name, given, outputs, compute, watch, rest)

        self.value = made("objective", [w, POINT], [POINT], lambda x, p: [self._objective(x)], [0.0])
        self.constraints = made("constraints", [w, POINT], [g], lambda x, p: [self._constraints(x)], [inside])
        self.cache = {
            "nlp_grad_f": made("nlp_grad_f", [w, POINT], [w], lambda x, p: [nlp.gradient(x)], [flat]),
            "nlp_jac_g": made("nlp_jac_g", [w, POINT], [g, jacobian], self._jacobian, [inside, slopes]),
            "nlp_hess_l": made("nlp_hess_l", asked, [w, hessian], self._hessian, [flat, unit]),
            "nlp_grad": made("nlp_grad", asked, [POINT, g, w, POINT], self._lagrangian, [0.0, inside, flat, 0.0]),
        }

    def _objective(self, x: Array) -> float:
        value = self.nlp.objective(x)
        return value if np.isfinite(value) else LARGE

    def _constraints(self, x: Array) -> Array:
        return np.nan_to_num(self.nlp.constraints(x), nan=LARGE, posinf=LARGE, neginf=-LARGE)

    def _jacobian(self, x: Array, p: Array) -> list[Any]:
        """The slopes are asked for once an iterate, the start included."""
        if x.tobytes() != self.last:
            self.last = x.tobytes()
            self.watch.iterate(x, np.zeros(0), np.zeros(0))
        return [self._constraints(x), self.nlp.jacobian(x)]

    def _hessian(self, x: Array, p: Array, factor: Array, duals: Array) -> list[Any]:
        return [self._slope(x, factor, duals), self.nlp.hessian(x, float(factor[0]), duals, False)]

    def _lagrangian(self, x: Array, p: Array, factor: Array, duals: Array) -> list[Any]:
        return [self._objective(x), self._constraints(x), self._slope(x, factor, duals), 0.0]

    def _slope(self, x: Array, factor: Array, duals: Array) -> Array:
        """(size,) of factor * objective + duals . constraints."""
        sparsity = self.nlp.jacobian_pattern.sparsity
        columns = np.repeat(np.arange(len(x)), np.diff(sparsity.colind()))
        bent = np.bincount(columns, weights=self.nlp.jacobian(x) * duals[np.array(sparsity.row())], minlength=len(x))
        return float(factor[0]) * self.nlp.gradient(x) + bent


def within(lower: Array, upper: Array) -> Array:
    """Numbers between bounds, of which either may be infinite."""
    low, high = np.where(np.isfinite(lower), lower, upper - 2), np.where(np.isfinite(upper), upper, lower + 2)
    return np.nan_to_num((low + high) / 2, nan=0.0, posinf=0.0, neginf=0.0)


def values(nlp: MultipleShootingNlp, watch: IterateWatch) -> tuple[NlpPart, NlpPart]:
    """Objective and constraints."""
    w, g = ca.Sparsity.dense(nlp.layout.size, 1), ca.Sparsity.dense(nlp.layout.rows, 1)
    value = NlpPart("objective", [w, POINT], [POINT], lambda x, p: [nlp.objective(x)], watch)
    return value, NlpPart("constraints", [w, POINT], [g], lambda x, p: [nlp.constraints(x)], watch)


def called(
    library: str, parts: tuple[NlpPart, NlpPart], settings: dict[str, Any], request: LibraryRequest
) -> tuple[Array, dict[str, Any]]:
    """Call nlpsol: the last w, and its statistics. ``parts`` and ``settings`` keep the callbacks alive."""
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
    result = solver(**given)
    return result["x"].full().ravel(), solver.stats()
