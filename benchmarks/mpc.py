"""Model predictive control of plants with half the step and masses 10 % off: rates, latencies, tasks done or not.

    python benchmarks/mpc.py [FILE ...] [--latency measured|cpu] [--faster 2] [--threads 1] [--set KEY=VALUE]

Without files, all shipped problems that have a table [mpc]. The loop runs in simulated time. With ``measured`` a plan
acts when as much wall time has passed as the solver took; ``cpu`` counts its processor time instead, for machines that
do other work. ``--faster``: times the rate of the file. The plant's step is half of that of [simulation] at most.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import symphys
from symphys import problems
from symphys.cli.arguments import read_settings
from symphys.mpc import Controller, Plant, close_loop, record_of
from symphys.problem import Problem
from symphys.results.closed_loop import ClosedLoopRecord

OFF = 1.1
"""Factor of the plant's masses and inertias."""
HEADER = (
    f"{'problem':<14}{'rate':>8}{'in time':>9}{'median':>9}{'99 %':>9}{'worst':>9}{'horizon':>15}"
    f"{'plant step':>12}{'task':>9}{'held':>8}"
)


@dataclass(frozen=True)
class Asked:
    """How a problem is run; see the options of the command line."""

    latency: str
    faster: float
    threads: int
    settings: dict[str, object]


def main() -> None:
    """A row for each problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*")
    parser.add_argument("--latency", choices=("measured", "cpu"), default="measured")
    parser.add_argument("--faster", type=float, default=1.0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--set", dest="settings", action="append", default=[])
    given = parser.parse_args()
    asked = Asked(given.latency, given.faster, given.threads, read_settings(given.settings))
    print(f"masses times {OFF}, latency {asked.latency}, threads {asked.threads}\n{HEADER}", flush=True)
    for name in given.files or controlled():
        print(row(run(symphys.load(name), asked)), flush=True)


def controlled() -> list[str]:
    """The shipped problems that have a table [mpc]."""
    return [name for name in problems.catalogue() if symphys.load(name).mpc is not None]


def run(problem: Problem, asked: Asked) -> ClosedLoopRecord:
    """Its closed loop with the plant off."""
    assert problem.mpc is not None, f"{problem.file} has no table [mpc]"
    off = {
        "mpc.plant.masses": OFF,
        "mpc.plant.dt": problem.simulation.dt / 2,
        "mpc.plant.latency": asked.latency,
        "mpc.rate": problem.mpc.rate * asked.faster,
    }
    changed = problem.set({**off, **asked.settings})
    return record_of(close_loop(Controller(changed, asked.threads), Plant(changed)))


def row(record: ClosedLoopRecord) -> str:
    """Of the table."""
    times = "".join(f"{1e3 * each:>7.2f}ms" for each in (record.median, record.p99, record.worst))
    plans = f"{record.horizon:g} s of {record.dt:g}"
    done = record.stopped or ("done" if record.done else "missed")
    return (
        f"{record.problem:<14}{record.rate:>5.0f} Hz{100 * record.share:>7.1f} %{times}{plans:>15}"
        f"{1e3 * record.plant_dt:>9.2f} ms{done:>9}{record.held:>6.1f} s"
    )


if __name__ == "__main__":
    main()
