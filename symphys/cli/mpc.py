"""``symphys mpc``: model predictive control of a plant, in simulated time with the latencies that are measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from symphys import threads as linear_algebra
from symphys.cli.arguments import (
    INTERRUPTED,
    complete_problem,
    out_option,
    read_problems,
    read_settings,
    settings_option,
)

if TYPE_CHECKING:
    from symphys.results.closed_loop import ClosedLoopRecord

COMPILING, TENTHS, PART = "compiling the model and the plant", 10, "controlling, {} tenths of the time"


@click.command()
@click.argument("source", metavar="FILE", shell_complete=complete_problem)
@settings_option
@click.option(
    "--threads",
    type=click.IntRange(1, 256),
    default=1,
    show_default=True,
    help="Number of threads of the planner. Several help for robots with many joints.",
)
@out_option
def mpc(source: str, assignments: tuple[str, ...], threads: int, out: Path) -> int:
    """Simulate model predictive control of a plant, and report the closed loop.

    Every tick measures the plant, shifts the last plan and improves it. A plan acts after the time that the
    solver took. Ctrl-C ends the loop, and what happened until then is written.

    Exit code 0: every target is met at the end. Exit code 1: one is not, or the loop ended before its time.
    """
    linear_algebra.limit()
    from symphys.cli.watching import working
    from symphys.interrupts import Interrupts
    from symphys.mpc import Controller, Plant, close_loop, write_closed_loop
    from symphys.report import write_closed_loop_page
    from symphys.results.config import case_name

    settings = read_settings(assignments)
    (problem,) = read_problems([source], settings)
    folder = out / case_name(problem.name, settings) / "mpc"
    parts = {PART.format(k): 1.0 for k in range(TENTHS)}
    with Interrupts().listening() as asked, working(f"mpc {problem.name}", {COMPILING: 5.0, **parts}) as tell:
        tell(COMPILING)
        controller = Controller(problem, threads)
        duration = controller.horizon.duration

        def show_time(time: float) -> None:
            tell(PART.format(int(TENTHS * time / duration * (1 - 1e-9))))

        loop = close_loop(controller, Plant(problem), show_time, asked)
        record, _ = write_closed_loop(loop, folder)
    click.echo("\n".join(lines(record)))
    click.echo(write_closed_loop_page(folder))
    if loop.stopped == "interrupted":
        return INTERRUPTED
    return 0 if record.done else 1


def lines(record: ClosedLoopRecord) -> list[str]:
    """Return the summary of a closed loop, in lines."""
    found = [
        f"{record.problem}: {record.title}",
        f"  simulated    {record.duration:g} s at {record.rate:g} Hz, {record.ticks} ticks",
        f"  in time      {100 * record.share:.1f} % of the ticks, within {1e3 / record.rate:.3g} ms",
        f"  latency      median {1e3 * record.median:.3g} ms, 99 % {1e3 * record.p99:.3g} ms, "
        f"worst {1e3 * record.worst:.3g} ms",
    ]
    if record.share < 1:
        found.append("  when late    the previous plan continues until the new one is ready")
    for target in record.targets:
        word = f"met for {target.held:.3g} s" if target.met else "not met"
        found.append(f"  target       {target.name}: {target.error:.3g} of {target.tolerance:g}, {word}")
    if record.stopped:
        found.append(f"  stopped      {record.stopped}")
    return found
