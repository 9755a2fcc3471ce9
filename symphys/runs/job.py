"""Jobs: requested runs, with problem, solver, seed and folder."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from pathlib import Path
from typing import Any

from symphys.codegen.backends import BEST
from symphys.problem import Problem, require_solvable, require_solvers, validate_options
from symphys.records import dataclass
from symphys.results.config import Config, case_name, make_config
from symphys.runs.choice import chosen
from symphys.runs.folder import RunFolder
from symphys.runs.guess import OWN_GUESS, GuessOrigin, RunGuess, with_guess
from symphys.solvers import SOLVERS, recorded_options, solver


@dataclass(frozen=True)
class Job:
    """A requested run with everything that it needs; may be sent to another process.

    Attributes:
        problem: the problem to solve.
        config: the exact request, as plain values.
        options: of the solver, validated.
        folder: where the run is written.
        command: as typed.
        examine: whether the solution is examined.
        outdated: the stamp (see ``RunInspection``) of a result that is to be replaced.
        chosen: the reason for its solver, where none was named.
        guess: where the guess of the problem was taken from, if from a run.
    """

    problem: Problem
    config: Config
    options: Any
    folder: RunFolder
    command: str
    examine: bool = True
    outdated: str = ""
    chosen: str = ""
    guess: GuessOrigin = OWN_GUESS

    @property
    def name(self) -> str:
        """The name for messages: ``ball_throw gradient seed 0``."""
        return f"{self.case} {self.config.solver} seed {self.config.seed}"

    @property
    def case(self) -> str:
        """The problem with its settings, as its folder is called: ``ball_throw@ground.friction=0.6``."""
        return case_name(self.config.problem, self.config.settings, self.guess.word)

    @property
    def subject(self) -> Hashable:
        """The key of the transcription: jobs of one subject share their functions."""
        return self.problem.file, self.problem.identity, repr(self.config.settings), self.smooth

    @property
    def size(self) -> int:
        """The approximate work of an evaluation: time steps times the length of the problem's text."""
        return self.problem.simulation.steps * len(self.problem.text)

    @property
    def smooth(self) -> bool:
        """Whether the solver will use a smoothing above 0."""
        return self.problem.simulation.smoothing[0] > 0


def make_jobs(
    problems: Iterable[Problem],
    solvers: Sequence[str] | None,
    seeds: Iterable[int],
    settings: dict[str, object],
    out: Path,
    command: str = "",
    backend: str = BEST,
    examine: bool = True,
    guess: RunGuess | None = None,
) -> list[Job]:
    """Return the jobs of every problem with every solver and seed, below ``out``; other settings have other folders.

    ``solvers`` None: those that each problem names, or those that are chosen for it, see ``choice``.

    ``guess``: what a run found, from which all start.

    ProblemError for a problem without variables or objectives, and for bad solver options; SymphysError where
    nothing of the guess fits.
    """
    seeds = tuple(seeds)
    jobs = []
    for problem in problems:
        require_solvable(problem)
        check_tables(problem)
        problem, origin = with_guess(problem, guess) if guess else (problem, OWN_GUESS)
        taken = {"run": origin.folder, "digest": origin.digest} if guess else {}
        reasons = {} if solvers or problem.solvers else {each.solver: each.reason for each in chosen(problem)}
        for name in solvers or problem.solvers or reasons:
            options = solver_options(problem, name)
            plain = recorded_options(options)
            for seed in seeds:
                config = make_config(problem.name, problem.identity, name, seed, settings, plain, backend, taken)
                folder = RunFolder.of(out, problem.name, name, seed, settings, origin.word)
                why = reasons.get(name, "")
                jobs.append(Job(problem, config, options, folder, command, examine, chosen=why, guess=origin))
    return jobs


def solver_options(problem: Problem, name: str) -> Any:
    """Return the options of the file's [solver.NAME] table, others at their defaults; ProblemError if they are bad."""
    table = problem.solver_tables.get(name, {})
    return validate_options(solver(name).Options, table, problem.file, f"solver.{name}")


def check_tables(problem: Problem) -> None:
    """Raise ProblemError for a [solver.NAME] table of an unknown solver, or with an unknown option."""
    require_solvers(problem.solver_tables, problem.solvers or (), SOLVERS, problem.file)
    for name in problem.solver_tables:
        solver_options(problem, name)
