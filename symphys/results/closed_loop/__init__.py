"""The run folder of a closed loop: what model predictive control did with a plant."""

from symphys.results.closed_loop.record import (
    MPC,
    PLANS,
    ClosedLoopRecord,
    TargetRecord,
    read_closed_loop,
)

__all__ = ["MPC", "PLANS", "ClosedLoopRecord", "TargetRecord", "read_closed_loop"]
