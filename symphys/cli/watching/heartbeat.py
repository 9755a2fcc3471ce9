"""Calls at intervals while work goes on, and the progress of work whose parts are known beforehand."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from threading import Event, Thread

import click
from rich.console import Console
from rich.text import Text

from symphys.cli.watching.progress import StepProgress
from symphys.cli.wording import step_words

LINE_INTERVAL = 5.0
"""[s] between plain lines while work goes on."""
UPDATE_INTERVAL = 1.0
"""[s] between two updates of a live line."""


@contextmanager
def heartbeat(beat: Callable[[], None], every: float) -> Iterator[None]:
    """Call ``beat`` every ``every`` seconds from a thread, while the body runs."""
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
def live_line(name: str, words: Callable[[], str]) -> Iterator[Callable[[], None]]:
    """Show ``words()`` on stderr while the body runs: a live line on a terminal, elsewhere a plain one at intervals.

    Yields a function that redraws the line at once. ``name`` begins plain lines.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        with heartbeat(lambda: click.echo(f"{name}: {words()}", err=True), LINE_INTERVAL):
            yield lambda: None
        return
    with console.status("") as status:

        def show() -> None:
            status.update(Text(words()))

        with heartbeat(show, UPDATE_INTERVAL):
            yield show


@contextmanager
def working(name: str, parts: Mapping[str, float]) -> Iterator[Callable[[str], None]]:
    """Show the progress of work in known parts, see ``StepProgress``; yields the function that announces a part."""
    steps = StepProgress(parts)
    with live_line(name, lambda: step_words(steps)) as show:

        def tell(what: str) -> None:
            steps.tell(what)
            show()

        yield tell
