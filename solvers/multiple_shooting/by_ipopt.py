"""IPOPT as solver of the multiple-shooting program; it reports iterates with their multipliers.

Where the solve is to end, everything is nan, and IPOPT stops.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca

from symphys.solvers.methods.ipopt import SILENT
from symphys.solvers.multiple_shooting.library import (
    SCALAR,
    IterateWatch,
    LibraryRequest,
    LibraryResult,
    NlpPart,
    called,
)
from symphys.solvers.multiple_shooting.nlp import MultipleShootingNlp


class IpoptIterates(ca.Callback):
    """Receives IPOPT's iterates, the start left out."""

    def __init__(self, nlp: MultipleShootingNlp, watch: IterateWatch) -> None:
        """Start without iterates."""
        ca.Callback.__init__(self)
        size, rows = nlp.layout.size, nlp.layout.rows
        self.sizes = {"x": size, "lam_x": size, "f": 1, "g": rows, "lam_g": rows, "lam_p": 1}
        self.watch, self.skip = watch, True
        self.construct("iterates", {})

    def get_n_in(self) -> int:
        """Return the number of inputs: all outputs of nlpsol."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return the number of outputs: the flag that stops IPOPT."""
        return 1

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        """Return the sparsity of an argument by its name."""
        return ca.Sparsity.dense(self.sizes[ca.nlpsol_out(index)], 1)

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        """Record an iterate."""
        if self.skip:
            self.skip = False
            return [0.0]
        given = {ca.nlpsol_out(k): each.full().ravel() for k, each in enumerate(arguments)}
        try:
            return [float(self.watch.ended or self.watch.iterate(given["x"], given["lam_x"], given["lam_g"]))]
        except (Exception, KeyboardInterrupt) as error:
            self.watch.error = error
            return [1.0]


def solve_by_ipopt(request: LibraryRequest, watch: IterateWatch) -> tuple[str, LibraryResult]:
    """Return IPOPT's return status and its results."""
    # The functions of the program as callbacks.
    nlp, size, rows = request.nlp, request.nlp.layout.size, request.nlp.layout.rows
    w, g = ca.Sparsity.dense(size, 1), ca.Sparsity.dense(rows, 1)
    value, constraints = values(nlp, watch)
    parts = {
        "grad_f": NlpPart(
            "nlp_grad_f", [w, SCALAR], [SCALAR, w], lambda x, p: [nlp.objective(x), nlp.gradient(x)], watch
        ),
        "jac_g": NlpPart(
            "nlp_jac_g",
            [w, SCALAR],
            [g, nlp.jacobian_pattern.sparsity],
            lambda x, p: [nlp.constraints(x), nlp.jacobian(x)],
            watch,
        ),
    }
    if not request.limited_memory:
        parts["hess_lag"] = NlpPart(
            "nlp_hess_l",
            [w, SCALAR, SCALAR, g],
            [nlp.upper_pattern.sparsity],
            lambda x, p, factor, duals: [nlp.hessian(x, float(factor[0]), duals, True)],
            watch,
        )
    # Options of a start with multipliers.
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
        result = called("ipopt", (value, constraints), settings, request)
        for line in text.read_text(errors="replace").splitlines():
            request.log(line)
    return str(result.statistics["return_status"]), result


def values(nlp: MultipleShootingNlp, watch: IterateWatch) -> tuple[NlpPart, NlpPart]:
    """Return objective and constraints as callbacks."""
    w, g = ca.Sparsity.dense(nlp.layout.size, 1), ca.Sparsity.dense(nlp.layout.rows, 1)
    value = NlpPart("objective", [w, SCALAR], [SCALAR], lambda x, p: [nlp.objective(x)], watch)
    return value, NlpPart("constraints", [w, SCALAR], [g], lambda x, p: [nlp.constraints(x)], watch)
