"""``symphys import``: another program's model of a robot as a file for ``[[include]]``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from symphys.api.robot import Robot

STYLES = {"taken": "green", "approximated": "yellow", "left out": "red", "recovered": "cyan"}
"""Colours of findings on a terminal."""


@click.command("import")
@click.argument("model", metavar="MODEL", type=str)
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Robot file to write.")
@click.option("--keyframe", metavar="NAME", help="MJCF: start at this keyframe instead of the reference pose.")
@click.option("--no-self-collision", is_flag=True, help="Remove contacts between bodies of the robot.")
@click.option(
    "--base",
    type=click.Choice(["auto", "free", "fixed"]),
    default="auto",
    show_default=True,
    help="URDF: whether the root link floats.",
)
@click.option(
    "--assets",
    type=click.Path(path_type=Path, file_okay=False),
    multiple=True,
    metavar="DIR",
    help="Permit reading meshes and included files from this folder, besides the model's own. Repeatable.",
)
@click.option(
    "--meshes",
    type=click.Choice(["hull", "fit"]),
    default="hull",
    show_default=True,
    help="Convex hulls, exact on planes and terrain; or spheres, boxes or capsules near them, which touch other bodies "
    "too: some ten seconds a mesh.",
)
def import_robot(
    model: str,
    out: Path | None,
    keyframe: str | None,
    no_self_collision: bool,
    base: str,
    assets: tuple[Path, ...],
    meshes: str,
) -> None:
    """Convert an MJCF or URDF model to a robot file, and list what was approximated or left out.

    Needs MuJoCo: `pip install '.[robots]'` in the checkout. The file that is written is for [[include]].
    """
    from symphys.api.robot import load_robot

    robot = load_robot(
        model,
        keyframe=keyframe,
        self_collision=not no_self_collision,
        base="free" if base == "free" else "fixed" if base == "fixed" else "auto",
        assets=assets,
        meshes="fit" if meshes == "fit" else "hull",
    )
    tell(robot)
    if out is not None:
        robot.save(out)
        click.echo(f'{out}: to be included in a problem, by [[include]] with file = "{out.name}"')


def tell(robot: Robot) -> None:
    """Print the findings of an import: a table on a terminal, else a line each."""
    import sys

    if not sys.stdout.isatty():
        click.echo(str(robot))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=str(robot).partition("\n")[0], title_justify="left", expand=False)
    for heading in ("", "part", "what was done", "how far off"):
        table.add_column(heading, overflow="fold")
    for finding in robot.findings:
        cells = (finding.what, finding.how, finding.amount)
        table.add_row(Text(finding.kind, STYLES[finding.kind]), *(Text(cell) for cell in cells))
    Console().print(table)
