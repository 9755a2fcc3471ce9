"""``symphys show``: look at a problem's guess."""

from __future__ import annotations

from pathlib import Path

import click

from symphys import files
from symphys.cli.arguments import complete_problem, out_option, read_problems, read_settings, settings_option


@click.command()
@click.argument("source", metavar="FILE", shell_complete=complete_problem)
@settings_option
@click.option("--text", is_flag=True, help="Print the file instead; also of a shipped robot or task.")
@out_option
def show(source: str, assignments: tuple[str, ...], text: bool, out: Path) -> None:
    """Simulate the guess of a problem, or a shipped robot by itself, and draw the motion."""
    from symphys import problems
    from symphys.problem import robot_alone
    from symphys.report import write_motion
    from symphys.runs import SCENE, TRAJECTORY, make_scene
    from symphys.transcription import transcribe

    here = Path(source).is_file()
    path = Path(source) if here else problems.shipped(source)
    if text:
        click.echo(path.read_text(encoding="utf-8"), nl=False)
        return
    settings = read_settings(assignments)
    alone = not here and problems.is_part(path)
    (problem,) = [robot_alone(path, settings)] if alone else read_problems([source], settings)
    transcription = transcribe(problem, backend="casadi")
    guess = transcription.shooting.start(0)
    folder = out / problem.name / "guess"
    motion = transcription.simulate(guess)
    files.write_npz(folder / TRAJECTORY, motion.arrays())
    files.write_json(folder / SCENE, make_scene(problem, transcription.shooting.by_block(guess), motion).to_json())
    click.echo(write_motion(folder / TRAJECTORY, folder / SCENE, folder / "motion.html", title=problem.title))
