"""The group of commands, with errors as one message and an exit code, without a traceback."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Sequence
from itertools import chain
from typing import Any

import click

from symphys.cli.arguments import INTERRUPTED
from symphys.cli.check import check
from symphys.cli.export import export
from symphys.cli.identify import identify
from symphys.cli.importing import import_robot
from symphys.cli.installation import cache, doctor, listing, new, schema
from symphys.cli.mpc import mpc
from symphys.cli.replay import replay
from symphys.cli.report import open_page, report
from symphys.cli.runs import best, diff, ls
from symphys.cli.show import show
from symphys.cli.solve import solve
from symphys.errors import SymphysError
from symphys.suggest import hint
from symphys.version import __version__

SOLVED, WRONG, UNREAD = 0, 2, 141
"""Exit codes; UNREAD is 128 + SIGPIPE, for output that nobody reads."""
GROUPS = {
    "Problems": (new, check, show, solve, mpc, identify),
    "Results": (report, open_page, ls, best, diff, replay),
    "Robots and exports": (import_robot, export),
    "Installation": (listing, schema, doctor, cache),
}
FIRST = "Begin with `symphys solve ball_throw`, then `symphys open`. `symphys COMMAND -h` has the options."


class Commands(click.Group):
    """A group that suggests the nearest command for an unknown one, and lists its commands by what they are for."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write each command with the first sentence of its help, whole."""
        for title, commands in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(each.name or "", each.get_short_help_str(limit=10**4)) for each in commands])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; UsageError with the nearest name if it does not exist."""
        name = args[0]
        if name not in self.commands and not name.startswith("-"):
            raise click.UsageError(f"no such command {name!r}; {hint(name, self.commands)}", ctx)
        return super().resolve_command(ctx, args)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]}, epilog=FIRST)
@click.version_option(__version__, prog_name="symphys", message="%(prog)s %(version)s")
def app() -> None:
    """Trajectory optimisation through contact: a problem file in, a solution and a report out."""


for command in chain.from_iterable(GROUPS.values()):
    app.add_command(command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return the exit code.

    0: every run solved, or found its best where there is nothing to meet; 1: some run not solved, not to be trusted, or
    failed, or a gradient that is wrong; 2: wrong usage or problem file;
    3: a page could not be made, and of runs all is as for 0; 130: interrupted; 141: nobody reads the output any more.
    """
    with contextlib.ExitStack() as opened:
        prepare(opened)
        streams = sys.stdout, sys.stderr
        try:
            code = run(arguments)
            for stream in streams:
                stream.flush()
        except (BrokenPipeError, SystemExit):  # click exits, with streams of its own, if nobody reads
            sys.stdout, sys.stderr = streams
            close_quietly()
            return UNREAD
        return code


def run(arguments: Sequence[str] | None) -> int:
    """Run a command and report errors; return the exit code. BrokenPipeError if nobody reads the output."""
    try:
        return int(app.main(args=arguments, prog_name="symphys", standalone_mode=False) or SOLVED)
    except click.ClickException as error:
        error.show()
        return WRONG
    except SymphysError as error:
        click.echo(f"symphys: {error}", err=True)
        return WRONG
    except (KeyboardInterrupt, click.Abort):
        click.echo("symphys: stopped at once; runs that had ended are kept, the same command does the rest", err=True)
        return INTERRUPTED
    except BrokenPipeError:
        raise
    except OSError as error:
        click.echo(f"symphys: {error}", err=True)
        return WRONG


class LossyFile(io.RawIOBase):
    """A file of messages that loses what a full disk does not take, so that no message ends the work it reports."""

    def __init__(self, raw: io.FileIO) -> None:
        """Write to ``raw``, which stays open."""
        self.raw = raw

    def write(self, text: Any) -> int:
        """Write what can be written; BrokenPipeError if nobody reads it."""
        try:
            return self.raw.write(text)
        except BrokenPipeError:
            raise
        except OSError:
            return len(text)

    def writable(self) -> bool:
        """Whether it can be written: always."""
        return True

    def fileno(self) -> int:
        """Return the descriptor of the file."""
        return self.raw.fileno()

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self.raw.isatty()


def file_of(stream: Any) -> io.FileIO | None:
    """Return the file that an output writes to; None if there is none, as in tests."""
    buffer = getattr(stream, "buffer", None)
    raw = getattr(buffer, "raw", buffer)
    return raw if isinstance(raw, io.FileIO) else None


def prepare(opened: contextlib.ExitStack) -> None:
    """Let outputs take every name, and replace those that were closed before the start (``>&-``)."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            nowhere = io.TextIOWrapper(io.FileIO(os.devnull, "w"), encoding="utf-8")
            opened.callback(setattr, sys, name, None)
            setattr(sys, name, opened.enter_context(nowhere))
        elif name == "stderr" and (raw := file_of(stream)):
            opened.callback(setattr, sys, name, stream)
            whole = io.BufferedWriter(LossyFile(raw))
            sys.stderr = io.TextIOWrapper(whole, stream.encoding, "replace", line_buffering=True)
        elif stream.errors in ("strict", "surrogateescape") and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def close_quietly() -> None:
    """Print nothing more to outputs whose reader has gone, not even at exit."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
