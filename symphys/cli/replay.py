"""``symphys replay``: simulate a run again and compare bit for bit."""

from __future__ import annotations

from pathlib import Path

import click

from symphys import threads


@click.command()
@click.argument("folder", metavar="RUN", type=click.Path(path_type=Path))
def replay(folder: Path) -> int:
    """Repeat the exact rollout of a run and compare it bit for bit.

    Exit code 0: the motion and all numbers are the same, to the bit. Exit code 1: they are not; the largest difference
    of each quantity is printed, and the versions and processors that differ.
    """
    threads.limit()
    from symphys.cli.watching import working
    from symphys.runs.replay import PARTS
    from symphys.runs.replay import replay as rolled_again

    with working(f"replay {folder}", PARTS) as tell:
        found = rolled_again(folder, tell)
    click.echo(str(found))
    return 0 if found.same else 1
