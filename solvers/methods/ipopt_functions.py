"""The functions that IPOPT calls, in x = z / scale: compiled ones where the problem has them, without Python."""

from __future__ import annotations

from typing import Any

import casadi as ca

from symphys.shooting import Nlp
from symphys.solvers.core.outcome import Array


def functions(nlp: Nlp, scale: Array, exact: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    """(the problem for ``casadi.nlpsol``, settings with its derivatives).

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
    """The upper half of the Lagrangian's second derivative."""
    objective, constraints = nlp.expression(x * scale, smoothing)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", constraints.sparsity())
    lagrangian = lam_f * objective + ca.dot(lam_g, constraints)
    second = ca.triu(ca.hessian(lagrangian, x)[0])
    return ca.Function("nlp_hess_l", [x, smoothing, lam_f, lam_g], [second])
