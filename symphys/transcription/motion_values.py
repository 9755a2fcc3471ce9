"""What a problem asks of a motion whose states are known: merit, costs, errors and outputs, and a probe's slopes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca

from symphys.codegen.toolchain.warm_start import from_cache
from symphys.transcription.gradient_probe import combined
from symphys.transcription.identities import motion_identity
from symphys.transcription.objective import Terms, rollout_terms
from symphys.transcription.rollout import Rollout
from symphys.types import Expr

Parts = Callable[[Terms, Expr, Expr], list[Expr]]
"""(terms, states (nx, N + 1), p (np,)) -> expressions."""


def motion_values(rollout: Rollout) -> ca.Function:
    """Return (z, states (nx, N + 1), p (np,)) -> merit, objective, costs, errors, outputs and probe; see ``Terms``.

    Formulas of a robot take a second to build, so the function is kept with the kernels.
    """

    def parts(asked: Terms, x: Expr, p: Expr) -> list[Expr]:
        merit = asked.objective + asked.penalties
        return [merit, asked.objective, asked.costs, asked.errors, asked.outputs, combined(asked.means)]

    return _of_motion(rollout, "motion_values", parts)


def probe_slopes(rollout: Rollout) -> ca.Function:
    """Return (z, states (nx, N + 1), p (np,)) -> derivatives of the probe by each of them."""

    def parts(asked: Terms, x: Expr, p: Expr) -> list[Expr]:
        probe = combined(asked.means)
        return [ca.gradient(probe, each) for each in (rollout.z, x, p)]

    return _of_motion(rollout, "probe_slopes", parts)


def _of_motion(rollout: Rollout, name: str, parts: Parts) -> ca.Function:
    def make() -> ca.Function:
        x, p = ca.MX.sym("x", rollout.x0.shape[0], rollout.steps + 1), ca.MX.sym("p", rollout.p.shape[0])
        given = replace(rollout, p=p)
        found = parts(rollout_terms(given, (x, given.applied(x))), x, p)
        return ca.Function(name, [rollout.z, x, p], [ca.densify(part) for part in found])

    return from_cache(make, motion_identity(rollout, name))
