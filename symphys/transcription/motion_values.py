"""What a problem asks of a motion whose states are known: merit, costs, errors and outputs."""

from __future__ import annotations

import casadi as ca

from symphys.codegen.toolchain.identity import identity_of
from symphys.codegen.toolchain.warm_start import kept_function
from symphys.transcription.gradient_probe import combined
from symphys.transcription.objective import rollout_terms
from symphys.transcription.program import program_identity
from symphys.transcription.rollout import Rollout


def motion_values(rollout: Rollout) -> ca.Function:
    """Return (z, states (nx, N + 1)) -> merit, objective, costs, errors, outputs and probe; see ``Terms``.

    Formulas of a robot take a second to build, so the function is kept with the kernels.
    """

    def make() -> ca.Function:
        x = ca.MX.sym("x", rollout.x0.shape[0], rollout.steps + 1)
        asked = rollout_terms(rollout, (x, rollout.applied(x)))
        merit, probe = asked.objective + asked.penalties, combined(asked.means)
        parts = [merit, asked.objective, asked.costs, asked.errors, asked.outputs, probe]
        return ca.Function("motion_values", [rollout.z, x], [ca.densify(part) for part in parts])

    problem = program_identity(rollout.problem, True)
    identity = (
        None if problem is None else identity_of("values", problem, rollout.inputs, tuple(rollout.memory.columns))
    )
    return kept_function(make, identity, least=0)
