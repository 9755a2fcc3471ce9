"""Which way a batch is shown."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Column

from symphys.cli.watching.events import Events
from symphys.cli.watching.heartbeat import EVERY, TICK, heartbeat
from symphys.cli.watching.live import Live
from symphys.cli.watching.plain import Plain
from symphys.cli.watching.quiet import Quiet

Shown = Plain | Live | Events | Quiet


@contextmanager
def watch(runs: int, quiet: bool = False, json: bool = False) -> Iterator[Shown]:
    """An observer of a batch of so many runs; ``json``: events on stdout, ``quiet``: what fails on stderr."""
    console = Console(stderr=True)
    if json:
        yield Events()
    elif quiet:
        yield Quiet()
    elif not console.is_terminal:
        plain = Plain(runs=runs)
        with heartbeat(plain.beat, EVERY):
            yield plain
    else:
        text = TextColumn("{task.description}", markup=False, table_column=Column(overflow="fold"))
        with Progress(BarColumn(16), TimeElapsedColumn(), text, console=console, transient=True) as progress:
            live = Live(progress, runs)
            with heartbeat(live.beat, TICK):
                yield live
