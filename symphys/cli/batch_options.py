"""The options of ``symphys solve`` that say how a batch is done."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import click

from symphys.cli.arguments import UsageFault

UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
"""[s]"""
MOST_RETRIES = 1000


@dataclass(frozen=True)
class BatchOptions:
    """How a batch is done.

    Attributes:
        retries: how often a run that fails is tried again.
        timeout, budget: [s] of a run, of the batch; inf without.
        rerun: what is done again although it is over.
        dry_run: whether only to say what would be done.
        json: whether to write events on stdout.
        quiet: whether to show failures only.
        on: the engine that starts drivers elsewhere; empty for runs in this process and its workers.
        scheduler: where the engine finds machines, or what it asks for; empty for its default.
    """

    retries: int
    timeout: float
    budget: float
    rerun: str
    dry_run: bool
    json: bool
    quiet: bool
    on: str = ""
    scheduler: str = ""


OPTIONS = (
    click.option(
        "--retries",
        type=click.IntRange(0, MOST_RETRIES),
        default=0,
        show_default=True,
        help="How often a run that fails is tried again; one whose process dies is so once in any case.",
    ),
    click.option(
        "--timeout",
        metavar="TIME",
        help="End a run after so long, whatever it is at: 90, 10min, 2h. It can go on later.",
    ),
    click.option("--budget", metavar="TIME", help="Stop the whole batch after so long. The same command goes on."),
    click.option(
        "--rerun",
        type=click.Choice(("failed", "changed", "all")),
        default=None,
        help="Do again what is over: runs that failed, those of another version of symphys, or all.",
    ),
    click.option("--dry-run", is_flag=True, help="Say what would be done, and why, and do nothing."),
    click.option("--json", is_flag=True, help="Write what happens to stdout, a JSON object a line."),
    click.option("--quiet", is_flag=True, help="Show nothing but failures."),
    click.option(
        "--on",
        type=click.Choice(("dask", "slurm")),
        default=None,
        help="Let as many drivers as --jobs says do the runs: on dask workers, or as jobs of Slurm.",
    ),
    click.option(
        "--scheduler",
        metavar="TEXT",
        help="dask: the address of a cluster, tcp://host:8786, instead of workers here. slurm: what to ask for, "
        "partition=short,timeout_min=60,mem_gb=4, or local.",
    ),
)


def batch_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command these options, as its argument ``how``."""

    @functools.wraps(command)
    def taking(*, timeout: str | None, budget: str | None, rerun: str | None, **rest: Any) -> Any:
        switches: dict[str, Any] = {name: rest.pop(name) for name in ("retries", "dry_run", "json", "quiet")}
        times = read_time("--timeout", timeout), read_time("--budget", budget)
        on, scheduler = rest.pop("on") or "", rest.pop("scheduler") or ""
        check_engine(on, scheduler, rest.get("multi_start", False))
        how = BatchOptions(**switches, timeout=times[0], budget=times[1], rerun=rerun or "", on=on, scheduler=scheduler)
        return command(how=how, **rest)

    for option in reversed(OPTIONS):
        taking = option(taking)
    return taking


def check_engine(on: str, scheduler: str, multi_start: bool) -> None:
    """UsageFault for options that do not go together."""
    if scheduler and not on:
        raise UsageFault(f"--scheduler {scheduler!r} needs --on dask or --on slurm")
    if on and multi_start:
        raise UsageFault(f"--multi-start solves seeds side by side in one process: leave it or --on {on} out")


def read_time(option: str, text: str | None) -> float:
    """[s] of a time such as 90, 10min or 2h; inf for none; UsageFault for anything else."""
    if text is None:
        return math.inf
    found = re.fullmatch(r"\s*([0-9.]+)\s*([a-z]*)\s*", text)
    try:
        seconds = float(found[1]) * UNITS[found[2]] if found else 0.0
    except (ValueError, KeyError):
        seconds = 0.0
    if not seconds > 0:
        raise UsageFault(f"{option} {text!r}: write a time above 0, such as 90, 90s, 10min, 2h or 1d")
    return seconds
