"""Does model predictive control keep its rate and do its task on a plant that differs from its model?

The plant has half the time step and masses and inertias that are 10 % off. The loop runs in simulated time. With the
latency ``measured`` a plan acts when as much wall time has passed as the solver took; ``cpu`` counts its processor time
instead, for machines that do other work.
"""

from __future__ import annotations

from collections.abc import Iterator

from bench import Row

import symphys
from symphys import problems
from symphys.cli.arguments import read_settings
from symphys.mpc import Controller, Plant, close_loop, record_of

OFF = 1.1
"""Factor of the plant's masses and inertias."""
COLUMNS = {
    "problem": "a shipped problem with a table [mpc], or a file",
    "rate_hz": "ticks of the controller a second",
    "in_time": "share of plans that were ready before the next tick",
    "median_ms": "of a plan",
    "p99_ms": "99 % of plans take less",
    "worst_ms": "of a plan",
    "horizon_s": "of a plan",
    "plan_dt_ms": "time step of a plan",
    "plant_dt_ms": "time step of the plant",
    "task": "done, missed, or why the loop was stopped",
    "held_s": "how long the task was held",
}


def rows(
    quick: bool = False,
    files: tuple[str, ...] = (),
    latency: str = "measured",
    faster: tuple[str, ...] = ("1", "2"),
    threads: int = 1,
    set: tuple[str, ...] = (),
) -> Iterator[Row]:
    """Yield a row for each problem and rate.

    Args:
        quick: 0.2 s of the acrobot.
        files: problems or files; none: all shipped problems that have a table [mpc].
        latency: "measured" or "cpu".
        faster: factors of the rate of the file.
        threads: of a controller.
        set: KEY=VALUE of the problem.
    """
    settings = read_settings(list(set))
    if quick:
        yield controlled("acrobot", latency, 1.0, threads, {"mpc.duration": 0.2} | settings)
        return
    names = files or [name for name in problems.catalogue() if symphys.load(name).mpc is not None]
    for factor in faster:
        for name in names:
            yield controlled(name, latency, float(factor), threads, settings)


def controlled(name: str, latency: str, faster: float, threads: int, settings: dict[str, object]) -> Row:
    """Close the loop of one problem with the plant off."""
    problem = symphys.load(name)
    assert problem.mpc is not None, f"{problem.file} has no table [mpc]"
    off = {
        "mpc.plant.masses": OFF,
        "mpc.plant.dt": problem.simulation.dt / 2,
        "mpc.plant.latency": latency,
        "mpc.rate": problem.mpc.rate * faster,
    }
    changed = problem.set({**off, **settings})
    record = record_of(close_loop(Controller(changed, threads), Plant(changed)))
    return {
        "problem": record.problem,
        "rate_hz": record.rate,
        "in_time": record.share,
        "median_ms": 1e3 * record.median,
        "p99_ms": 1e3 * record.p99,
        "worst_ms": 1e3 * record.worst,
        "horizon_s": record.horizon,
        "plan_dt_ms": 1e3 * record.dt,
        "plant_dt_ms": 1e3 * record.plant_dt,
        "task": record.stopped or ("done" if record.done else "missed"),
        "held_s": record.held,
    }
