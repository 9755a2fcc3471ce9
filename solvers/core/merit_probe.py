"""A last look before a gradient is believed that vanishes: two rollouts tell whether the merit levels out there."""

from __future__ import annotations

from symphys.solvers.core.driver import converged
from symphys.solvers.core.evaluator import Meter, Verdict
from symphys.solvers.core.outcome import Array, Status
from symphys.solvers.core.vanishing_gradient import STEP, direction

SLACK = 1e-3
"""A slope below it, relative to 1 + |merit|, is none: differences of kinked merits are no better."""
TILTED = (
    "the gradient vanishes, but the merit does not level out: the gradient is wrong there (`symphys check` compares it "
    "with differences), or the point is at a kink (smoothing above 0 rounds it)"
)


def believed(meter: Meter, z: Array, merit: float) -> Verdict:
    """CONVERGED at the stationary point z, or STALLED where the merit still has a slope along a fixed direction."""
    step = STEP * meter.scale * direction(z.size)
    step[(meter.clip(z + step) != z + step) | (meter.clip(z - step) != z - step)] = 0
    ahead, behind = meter.value(z + step), meter.value(z - step)
    slope = abs(ahead.merit - behind.merit) / (2 * STEP)
    return Verdict(Status.STALLED, TILTED) if slope > SLACK * (1 + abs(merit)) else converged(meter)
