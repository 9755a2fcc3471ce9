"""``symphys show``: draw a problem's guess."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from symphys import files
from symphys.cli.arguments import (
    UsageFault,
    complete_problem,
    out_option,
    read_problems,
    read_settings,
    settings_option,
)


@click.command()
@click.argument("source", metavar="FILE", shell_complete=complete_problem)
@settings_option
@click.option("--keyframe", metavar="NAME", help="MJCF: start at this keyframe instead of the reference pose.")
@click.option("--base", type=click.Choice(["free", "fixed"]), help="URDF: whether the root link floats.")
@click.option("--no-self-collision", is_flag=True, help="Remove contacts between bodies of the model.")
@click.option("--text", is_flag=True, help="Print the file instead, also for shipped robots and tasks.")
@out_option
def show(
    source: str,
    assignments: tuple[str, ...],
    keyframe: str | None,
    base: str | None,
    no_self_collision: bool,
    text: bool,
    out: Path,
) -> None:
    """Simulate the guess of a problem, or a robot by itself, and draw the motion.

    A robot is a shipped one, or a file that problems may include, also one of an installed package
    (package://NAME/PATH). The robot drops to the ground while its position motors hold the start.
    """
    from symphys import problems
    from symphys.importing.packages import model_file
    from symphys.problem import is_robot, robot_alone
    from symphys.report import write_motion
    from symphys.runs import SCENE, TRAJECTORY, make_scene
    from symphys.transcription import transcribe

    named = model_file(source)
    here = named.is_file()
    path = named if here else problems.shipped(source)
    if text:
        click.echo(path.read_text(encoding="utf-8"), nl=False)
        return
    settings = read_settings(assignments)
    alone = is_robot(path) if here else problems.is_part(path)
    given = {"keyframe": keyframe, "base": base, "self_collision": False if no_self_collision else None}
    include = {key: value for key, value in given.items() if value is not None}
    if include and not alone:
        raise UsageFault(f"show: {', '.join(include)}: for robots alone, and {source} is a problem")
    (problem,) = [robot_alone(path, settings, **include)] if alone else read_problems([source], settings)
    transcription = transcribe(problem, backend="casadi")
    guess = transcription.shooting.start(0)
    folder = out / problem.name / "guess"
    motion = transcription.simulate(guess)
    files.write_npz(folder / TRAJECTORY, motion.arrays())
    files.write_json(folder / SCENE, make_scene(problem, transcription.shooting.by_block(guess), motion).to_json())
    if alone and path.suffix.lower() != ".toml":
        tell_losses(path, include)
    click.echo(write_motion(folder / TRAJECTORY, folder / SCENE, folder / "motion.html", title=problem.title))


def tell_losses(path: Path, include: Mapping[str, Any]) -> None:
    """Report how much of a model was approximated or left out."""
    from symphys.api.robot import load_robot

    found = [finding.kind for finding in load_robot(path, **include).findings]
    kinds = [f"{found.count(kind)} {kind}" for kind in ("approximated", "left out", "recovered") if kind in found]
    if kinds:
        click.echo(f"{path.name}: {', '.join(kinds)}; symphys import {path.name} names them", err=True)
