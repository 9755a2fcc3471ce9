"""``symphys schema``: what a problem file may hold, for editors."""

from __future__ import annotations

import json
from pathlib import Path

import click

from symphys import files


@click.command()
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="File to write.  [default: print it]")
def schema(out: Path | None) -> None:
    """Write the JSON Schema of problem files, with which editors complete and check them."""
    from symphys.problem import json_schema
    from symphys.solvers import SOLVERS, solver

    text = json.dumps(json_schema({name: solver(name).Options for name in SOLVERS}), indent=2, ensure_ascii=False)
    if out is None:
        click.echo(text)
        return
    files.write_text(out, text + "\n")
    click.echo(out)
