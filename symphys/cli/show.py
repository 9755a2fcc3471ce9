"""``symphys show``: look at a problem's guess."""

from __future__ import annotations

from pathlib import Path

import click

from symphys import files
from symphys.cli.arguments import out_option, read_problems, read_settings, settings_option


@click.command()
@click.argument("source", metavar="FILE")
@settings_option
@out_option
def show(source: str, assignments: tuple[str, ...], out: Path) -> None:
    """Simulate the guess of a problem, and draw the motion."""
    from symphys.report import write_motion
    from symphys.runs import SCENE, TRAJECTORY, make_scene
    from symphys.transcription import transcribe

    (problem,) = read_problems([source], read_settings(assignments))
    transcription = transcribe(problem, backend="casadi")
    guess = transcription.shooting.start(0)
    folder = out / problem.name / "guess"
    motion = transcription.simulate(guess)
    files.write_npz(folder / TRAJECTORY, motion.arrays())
    files.write_json(folder / SCENE, make_scene(problem, transcription.shooting.by_block(guess), motion).to_json())
    click.echo(write_motion(folder / TRAJECTORY, folder / SCENE, folder / "motion.html", title=problem.title))
