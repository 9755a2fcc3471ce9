"""``symphys schema``: the schema of problem files, for editors and for readers."""

from __future__ import annotations

import json
from pathlib import Path

import click

from symphys import files


@click.command()
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="File to write.  [default: print it]")
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
