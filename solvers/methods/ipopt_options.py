"""Checks of IPOPT's options: each is tried on a tiny problem, so that the message names the invalid one."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from typing import Any

import casadi as ca

from symphys.solvers.core.options import refuse

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
