"""What a problem asks of a motion whose states are known: merit, costs, errors and outputs, and a probe's slopes."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from symphys.codegen.toolchain.warm_start import kept
from symphys.transcription.gradient_probe import combined
from symphys.transcription.objective import Terms, rollout_terms
from symphys.transcription.program import motion_identity
from symphys.transcription.rollout import Rollout
from symphys.types import Expr


def motion_values(rollout: Rollout) -> ca.Function:
    """Return (z, states (nx, N + 1)) -> merit, objective, costs, errors, outputs and probe; see ``Terms``.

    Formulas of a robot take a second to build, so the function is kept with the kernels.
    """

    def parts(asked: Terms, x: Expr) -> list[Expr]:
        merit = asked.objective + asked.penalties
        return [merit, asked.objective, asked.costs, asked.errors, asked.outputs, combined(asked.means)]

    return _of_motion(rollout, "motion_values", parts)


def probe_slopes(rollout: Rollout) -> ca.Function:
    """Return (z, states (nx, N + 1)) -> derivatives of the probe by z (n,) and by the states (nx, N + 1)."""

    def parts(asked: Terms, x: Expr) -> list[Expr]:
        probe = combined(asked.means)
        return [ca.gradient(probe, each) for each in (rollout.z, x)]

    return _of_motion(rollout, "probe_slopes", parts)


def _of_motion(rollout: Rollout, name: str, parts: Callable[[Terms, Expr], list[Expr]]) -> ca.Function:
    def make() -> ca.Function:
        x = ca.MX.sym("x", rollout.x0.shape[0], rollout.steps + 1)
        found = parts(rollout_terms(rollout, (x, rollout.applied(x))), x)
        return ca.Function(name, [rollout.z, x], [ca.densify(part) for part in found])

    return kept(make, motion_identity(rollout, name))
