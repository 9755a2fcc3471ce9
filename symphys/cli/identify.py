"""``symphys identify``: a problem's variables from its recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    from symphys.identification import FitStep


@click.command()
@click.argument("source", metavar="FILE", shell_complete=complete_problem)
@settings_option
@click.option("--loss", type=click.Choice(["squares", "huber"]), help="Loss function.  [default: that of [identify]]")
@click.option("--bootstrap", type=click.IntRange(0, 1000), metavar="N", help="Number of bootstrap draws; 0 for none.")
@click.option("--check", type=click.Choice(["none", "cma"]), help="Search for other minima by CMA-ES.")
@click.option("--threads", type=click.IntRange(1, 256), help="Number of threads of the simulations.  [default: all]")
@out_option
def identify(source: str, assignments: tuple[str, ...], threads: int | None, out: Path, **options: Any) -> int:
    """Estimate the variables of a problem from recordings, with intervals and a residual analysis.

    Levenberg-Marquardt over all [[recording]] tables at once. The estimates with their intervals, what the recordings
    do not determine, and how well those that were held back are predicted go to the terminal and into the run folder.
    Ctrl-C stops after an iteration; the same command goes on.

    Exit code 0: it has converged. Exit code 1: it has not, or its results are doubted.
    """
    linear_algebra.limit()
    from symphys.interrupts import Interrupts
    from symphys.prediction import identify as identified
    from symphys.report import write_identification_page
    from symphys.results.config import case_name
    from symphys.results.identification.summary import summary

    settings = read_settings(assignments)
    (problem,) = read_problems([source], settings)
    folder = out / case_name(problem.name, settings) / "identify"
    asked_for = {name: value for name, value in options.items() if value is not None}
    with Interrupts().listening() as asked:
        found = identified(problem, folder, threads=threads, monitor=print_step, stop=asked, **asked_for)
    click.echo(f"\n{summary(found)}")
    click.echo(write_identification_page(folder))
    if found.status == "interrupted":
        return INTERRUPTED
    return 0 if found.status == "converged" and not found.doubts else 1


def print_step(step: FitStep) -> None:
    """Print a line for an iteration on stderr."""
    left = f"{step.left:.2g} standard errors left"
    click.echo(f"iteration {step.iteration:3d}  merit {step.merit:.6g}  {left}  {step.seconds:.1f} s", err=True)
