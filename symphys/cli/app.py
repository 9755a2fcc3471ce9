"""The group of commands, and what an error looks like: one message, an exit code, no traceback."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import click

from symphys.cli.cache import cache
from symphys.cli.check import check
from symphys.cli.doctor import doctor
from symphys.cli.export import export
from symphys.cli.report import report
from symphys.cli.schema import schema
from symphys.cli.shipped import listing, new
from symphys.cli.show import show
from symphys.cli.solve import solve
from symphys.errors import SymphysError
from symphys.suggest import hint
from symphys.version import __version__

SOLVED, UNSOLVED, WRONG, INTERRUPTED = 0, 1, 2, 130


class Commands(click.Group):
    """A group that suggests what an unknown command may have meant."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; UsageError with the nearest if there is none."""
        name = args[0]
        if name not in self.commands and not name.startswith("-"):
            raise click.UsageError(f"no such command {name!r}; {hint(name, self.commands)}", ctx)
        return super().resolve_command(ctx, args)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="symphys", message="%(prog)s %(version)s")
def app() -> None:
    """Trajectory optimisation through contact: a problem file in, a solution and a report out."""


for command in (new, solve, report, show, check, export, listing, schema, doctor, cache):
    app.add_command(command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; the exit code.

    0: every run solved, or found its best where there is nothing to meet; 1: some run not solved, not to be trusted, or
    failed, or a gradient that is wrong; 2: wrong usage or problem file;
    130: interrupted.
    """
    try:
        code = app.main(args=arguments, prog_name="symphys", standalone_mode=False)
        sys.stdout.flush()
        return int(code or SOLVED)
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
        return close_quietly()
    except OSError as error:
        click.echo(f"symphys: {error}", err=True)
        return WRONG


def close_quietly() -> int:
    """The reader of the output has gone: print nothing more, not even at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return UNSOLVED
