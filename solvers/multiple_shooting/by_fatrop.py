"""FATROP as solver of the multiple-shooting program; it factorises stage by stage.

FATROP (Vanroye, Sathya, De Schutter and Decre 2023, arXiv 2303.16746) takes no derivatives as options: they go into the
cache of the solver's functions, where casadi looks before it derives them. An iterate is a point where it asks for the
slopes of the constraints. It takes no multipliers to start from, but finds those of the rows by least squares; where
multipliers are known it begins with a barrier that fits them.

It does not stop at nan. Where the solve is to end it gets a quadratic program that the present point solves, and has
converged a few iterations later. Values that are not finite reach it as large ones, so that it shortens its step.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.solvers.multiple_shooting.library import (
    ITERATIONS_USED,
    SCALAR,
    IterateWatch,
    LibraryRequest,
    LibraryResult,
    NlpPart,
    called,
)
from symphys.types import Array

SUCCEEDED, NO_STEP = "Solve_Succeeded", "Fatrop_No_Step"
"""FATROP's return status, besides a used budget."""
REFUSED_VALUE = 1e20
"""Value and violation of a point that is not finite, too large to be accepted."""
BOUND_PUSH = 1e-9
"""Distance by which a warm start is moved from its bounds, in FATROP's measure."""
RESERVED_OF_FATROP = {"tolerance": "use tolerance beside backend"}
"""Reserved options, added to those of IPOPT."""


def refused_by_fatrop(name: str, value: Any) -> str:
    """Return why FATROP refuses an option, tried on a tiny problem; empty if it does not."""
    x = ca.MX.sym("x")
    try:
        settings: dict[str, Any] = {"fatrop": {"print_level": 0, name: value}, "print_time": False}
        program: dict[str, Any] = {"x": x, "f": (x - 1) ** 2}
        ca.nlpsol("trial", "fatrop", program, settings)(x0=0)
    except (RuntimeError, NotImplementedError) as error:
        return "there is no such option" if "not supported" in str(error) else str(error).strip().splitlines()[-1]
    return ""


class SlopesNotFinite(Exception):
    """Raised for a derivative that is not finite, which FATROP would factorise forever."""


def finite(nonzeros: Array) -> Array:
    """Return nonzeros unchanged; SlopesNotFinite unless all are finite."""
    if not np.isfinite(nonzeros).all():
        raise SlopesNotFinite
    return nonzeros


def solve_by_fatrop(request: LibraryRequest, watch: IterateWatch) -> tuple[str, LibraryResult]:
    """Return FATROP's status in IPOPT's terms, and its results."""
    parts = FatropParts(request, watch)
    most = max(request.iterations - 1, 0)  # it makes one iteration more
    warm = (
        {"mu_init": request.barrier, "bound_push": BOUND_PUSH, "bound_frac": BOUND_PUSH}
        if request.row_duals.size
        else {}
    )
    own = {"print_level": 0, "max_iter": most, "tolerance": request.tolerance, **warm, **request.options}
    structure = {"structure_detection": "manual", **request.nlp.layout.structure}
    settings = {**structure, "cache": parts.cache, "fatrop": own}
    result = called("fatrop", (parts.value, parts.constraints), settings, request)
    iterations, status = int(result.statistics["iter_count"]), int(result.statistics["return_status"])
    request.log(f"FATROP: {iterations} iterations, ended with {status}")
    if status == 0:
        return SUCCEEDED, result
    return ITERATIONS_USED if iterations >= most else NO_STEP, result


class FatropParts:
    """The functions of the program in FATROP's form.

    Attributes:
        value, constraints: the program.
        cache: its derivatives, by the names under which casadi looks for them.
    """

    def __init__(self, request: LibraryRequest, watch: IterateWatch) -> None:
        """Make the callbacks, and their results once the solve is to end."""
        nlp, size, rows = request.nlp, request.nlp.layout.size, request.nlp.layout.rows
        self.nlp, self.watch, self.last = nlp, watch, request.w.tobytes()
        w, g = ca.Sparsity.dense(size, 1), ca.Sparsity.dense(rows, 1)
        jacobian, hessian = nlp.jacobian_pattern.sparsity, nlp.hessian_pattern.sparsity
        flat, inside, slopes = np.zeros(size), within(*nlp.row_bounds()), nlp.unit_slopes()
        columns = np.repeat(np.arange(size), np.diff(hessian.colind()))
        unit = (np.array(hessian.row()) == columns).astype(float)
        asked = [w, SCALAR, SCALAR, g]

        def made(name: str, given: list[Any], outputs: list[Any], compute: Any, rest: list[Any]) -> NlpPart:
            return NlpPart(name, given, outputs, compute, watch, rest)

        self.value = made("objective", [w, SCALAR], [SCALAR], lambda x, p: [self._objective(x)], [0.0])
        self.constraints = made("constraints", [w, SCALAR], [g], lambda x, p: [self._constraints(x)], [inside])
        self.cache = {
            "nlp_grad_f": made("nlp_grad_f", [w, SCALAR], [w], lambda x, p: [finite(nlp.gradient(x))], [flat]),
            "nlp_jac_g": made("nlp_jac_g", [w, SCALAR], [g, jacobian], self._jacobian, [inside, slopes]),
            "nlp_hess_l": made("nlp_hess_l", asked, [w, hessian], self._hessian, [flat, unit]),
            "nlp_grad": made("nlp_grad", asked, [SCALAR, g, w, SCALAR], self._lagrangian, [0.0, inside, flat, 0.0]),
        }

    def _objective(self, x: Array) -> float:
        value = self.nlp.objective(x)
        return value if np.isfinite(value) else REFUSED_VALUE

    def _constraints(self, x: Array) -> Array:
        """Return the constraints; at a point that is not finite, a violation too large to accept."""
        found = self.nlp.constraints(x)
        return np.where(np.isfinite(found), found, np.where(found < 0, -REFUSED_VALUE, REFUSED_VALUE))

    def _jacobian(self, x: Array, p: Array) -> list[Any]:
        """Return constraints and slopes; called once for each iterate, the start included."""
        if x.tobytes() != self.last:
            self.last = x.tobytes()
            self.watch.iterate(x, np.zeros(0), np.zeros(0))
        return [self._constraints(x), finite(self.nlp.jacobian(x))]

    def _hessian(self, x: Array, p: Array, factor: Array, duals: Array) -> list[Any]:
        return [self._slope(x, factor, duals), finite(self.nlp.hessian(x, float(factor[0]), duals, False))]

    def _lagrangian(self, x: Array, p: Array, factor: Array, duals: Array) -> list[Any]:
        return [self._objective(x), self._constraints(x), self._slope(x, factor, duals), 0.0]

    def _slope(self, x: Array, factor: Array, duals: Array) -> Array:
        """Return (size,) the gradient of factor * objective + duals . constraints."""
        sparsity = self.nlp.jacobian_pattern.sparsity
        columns = np.repeat(np.arange(len(x)), np.diff(sparsity.colind()))
        bent = np.bincount(columns, weights=self.nlp.jacobian(x) * duals[np.array(sparsity.row())], minlength=len(x))
        return float(factor[0]) * self.nlp.gradient(x) + bent


def within(lower: Array, upper: Array) -> Array:
    """Return numbers between bounds, of which either may be infinite."""
    least, most = np.isfinite(lower), np.isfinite(upper)
    low, high = np.where(least, lower, 0.0), np.where(most, upper, 0.0)
    return np.select([least & most, least, most], [(low + high) / 2, low + 1, high - 1], 0.0)
