"""Work whose parts are known beforehand, shown while it goes on; and what is done every so many seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from threading import Event, Thread

import click
from rich.console import Console
from rich.text import Text

from symphys.batches.progress import StepProgress
from symphys.cli.watching.words import step_words

EVERY = 5.0
"""[s] between plain lines while work goes on."""
TICK = 1.0
"""[s] between two looks at the clock of a live line."""


@contextmanager
def heartbeat(beat: Callable[[], None], every: float) -> Iterator[None]:
    """Call ``beat`` every so many seconds from a thread of its own, while the body runs."""
    over = Event()

    def run() -> None:
        while not over.wait(every):
            beat()

    thread = Thread(target=run, name="symphys-progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@contextmanager
def working(name: str, parts: Mapping[str, float]) -> Iterator[Callable[[str], None]]:
    """What takes the words that announce a part of a work, see ``StepProgress``; ``name``: of the work."""
    steps, console = StepProgress(parts), Console(stderr=True)
    if not console.is_terminal:
        with heartbeat(lambda: click.echo(f"{name}: {step_words(steps)}", err=True), EVERY):
            yield steps.tell
        return
    with console.status("") as status:

        def tell(what: str) -> None:
            steps.tell(what)
            show()

        def show() -> None:
            status.update(Text(step_words(steps)))

        with heartbeat(show, TICK):
            yield tell
