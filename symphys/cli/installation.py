"""``symphys list``, ``new``, ``schema``, ``doctor`` and ``cache``: what is shipped, and what this machine has."""

from __future__ import annotations

import json
import shutil
import textwrap
from pathlib import Path

import click

from symphys import files, threads
from symphys.cli.arguments import complete_problem


@click.command("list")
def listing() -> None:
    """List the shipped problems, the robots and tasks that problems include, and the solvers.

    Brackets show the solvers that a problem names and the time of the first one, on two cores with compiled kernels.
    """
    from symphys import problems
    from symphys.problem import load_problem
    from symphys.solvers import SOLVERS

    seconds = problems.typical_seconds()
    click.echo("problems:")
    for name, path in problems.catalogue().items():
        problem = load_problem(path)
        took = f", {seconds[name]:g} s" if name in seconds else ""
        echo_item(name, f"{problem.title} [{', '.join(problem.solvers or ()) or NO_SOLVER}{took}]")
    click.echo("robots and tasks, for [[include]]:")
    for file in problems.parts():
        click.echo(f"  {file}")
    click.echo("solvers:")
    for solver in SOLVERS.values():
        echo_item(solver.name, solver.summary)


NO_SOLVER = "automatic"
"""In place of the solvers that a problem names."""


def echo_item(name: str, text: str) -> None:
    """Print a name with a text beside it, wrapped between words to the width of the terminal."""
    width = max(shutil.get_terminal_size().columns, 60)
    click.echo(textwrap.fill(f"{name:<20} {text}", width, initial_indent="  ", subsequent_indent=" " * 23))


@click.command()
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@click.option(
    "--from",
    "source",
    default="ball_throw",
    show_default=True,
    metavar="NAME",
    shell_complete=complete_problem,
    help="A shipped problem, robot or task (see `symphys list`).",
)
def new(file: Path, source: str) -> None:
    """Write a copy of a shipped problem, robot or task, to be changed.

    Includes are found from any folder. Existing files are not overwritten.
    """
    from symphys import problems
    from symphys.api.tools import new as copy

    copy(file, source)
    if problems.is_part(problems.shipped(source)):
        click.echo(f'{file}: to be included in a problem, by [[include]] with file = "{file.name}"')
    else:
        click.echo(f"{file}: try `symphys show {file}`, then `symphys check {file}` and `symphys solve {file}`")


@click.command()
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="File to write.  [default: stdout]")
@click.option("--markdown", is_flag=True, help="Write the reference of tables and keys as a Markdown page instead.")
def schema(out: Path | None, markdown: bool) -> None:
    """Write the JSON Schema of problem files, with which editors complete and check them."""
    from symphys.problem import json_schema, reference_page
    from symphys.solvers import SOLVERS, solver

    options = {name: solver(name).Options for name in SOLVERS}
    text = reference_page(options) if markdown else json.dumps(json_schema(options), indent=2, ensure_ascii=False)
    text = text.rstrip("\n")
    if out is None:
        click.echo(text)
        return
    files.write_text(out, text + "\n")
    click.echo(out)


@click.command()
def doctor() -> int:
    """Test compilers, GPU and optional packages, and print how to fix what fails."""
    threads.limit()
    from symphys.machine import examine, healthy

    findings = []
    for finding in examine():
        findings.append(finding)
        click.echo(f"{finding.state:<8} {finding.name:<18} {finding.text}")
    return 0 if healthy(findings) else 1


@click.group()
def cache() -> None:
    """Show or clear the cache of compiled kernels."""


@cache.command()
def info() -> None:
    """Say where compiled kernels are kept, how many, and how much room they take."""
    from symphys.codegen import default_cache

    kept = default_cache()
    found = kept.info()
    click.echo(f"folder   {found.folder}{'' if found.folder.is_dir() else ' (not made yet)'}")
    click.echo(f"kernels  {found.kernels}")
    click.echo(f"size     {size_text(found.bytes)}")
    click.echo(f"limit    {size_text(found.limit)}; those not used for longest go first")
    if why := kept.distrust():
        click.echo(f"unused   {why}")


@cache.command()
def clear() -> int:
    """Remove all kernels; those that are needed again are compiled again."""
    from symphys.codegen import default_cache

    kept = default_cache()
    before = kept.info()
    gone = kept.clear()
    after = kept.info()
    freed = size_text(before.bytes - after.bytes)
    click.echo(f"removed {gone} of {before.kernels} kernels, {freed}, from {kept.folder}")
    if after.kernels:
        click.echo(f"{after.kernels} cannot be removed: may you write to the folder?", err=True)
    return 1 if after.kernels else 0


def size_text(count: int) -> str:
    """Write a number of bytes in a readable unit."""
    if count < 1000:
        return f"{count} bytes"
    return f"{count / 1e3:.0f} kB" if count < 1e6 else f"{count / 1e6:.1f} MB"
