"""The stored variables of a run, rolled out again by the exact rollout from problem.toml and the settings beside it.

Nothing of the folder is run: it has a problem, settings and numbers. What is compared was judged and recorded by the
same rollout, so it is the same to the bit where versions and processor are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from symphys import json_values as values
from symphys.errors import SymphysError
from symphys.files import FileError
from symphys.problem import Problem, load_problem
from symphys.results.archives import read_archive
from symphys.results.config import Config
from symphys.results.file_names import CONFIG, PROBLEM, RESULT, TRAJECTORY
from symphys.results.result import Result
from symphys.results.text_files import ReportError, read_table
from symphys.results.trajectories import make_trajectory
from symphys.runs.provenance import machine, versions
from symphys.runs.replay.comparison import QuantityDifference, compare_motions, compare_numbers
from symphys.trajectory import NotFinite, Trajectory
from symphys.transcription import Assessment, Transcription, transcribe
from symphys.types import Array

BUILDING, ROLLING = "building the problem", "rolling it out"
PARTS = {BUILDING: 8.0, ROLLING: 2.0}
"""What ``replay`` announces, and about how the time is shared."""


class ReplayError(SymphysError):
    """A run that cannot be rolled out again; says which file is missing or does not fit."""


@dataclass(frozen=True)
class Replay:
    """How a run does when it is rolled out again.

    Attributes:
        folder: of the run.
        instants: of the recorded motion.
        quantities: how many were compared.
        differences: those that are not the same to the bit, those of the motion first.
        elsewhere: what the run was made with and what is here, by name, where the two differ: versions, processor,
            platform.
        lacking: arrays that trajectory.npz does not have, as in older files; they are not compared.
        fault: why there is no motion now where one is recorded; empty if there is one.
    """

    folder: Path
    instants: int
    quantities: int
    differences: tuple[QuantityDifference, ...]
    elsewhere: Mapping[str, tuple[str, str]]
    lacking: tuple[str, ...] = ()
    fault: str = ""

    @property
    def same(self) -> bool:
        """Whether everything is the same, to the bit."""
        return not self.differences and not self.fault

    def __str__(self) -> str:
        """The differences, a line each, or that there are none; then what is not as it was."""
        if self.same:
            lines = [f"{self.folder}: the same, to the bit ({self.quantities} quantities, {self.instants} instants)"]
        else:
            why = self.fault or f"{len(self.differences)} of {self.quantities} quantities differ, by at most"
            lines = [f"{self.folder}: not the same: {why}", *(f"  {each}" for each in self.differences)]
        if self.lacking:
            lines.append(f"  not in {TRAJECTORY}, and not compared: {', '.join(self.lacking)}")
        lines += [f"  {name}: {then} then, {now} now" for name, (then, now) in self.elsewhere.items()]
        if not self.same and not self.elsewhere:
            lines.append("  versions, processor and platform are those of then")
        return "\n".join(lines)


def silent(what: str) -> None:
    """Tell nobody."""


def replay(folder: Path, tell: Callable[[str], None] = silent) -> Replay:
    """Roll out the variables of a run again, and compare with what is recorded; ``tell`` is called with each of PARTS.

    Raises:
        ReplayError: no such folder, a file that is missing or damaged, or variables that do not fit the problem.
        ProblemError: problem.toml cannot be read, or has controllers that Python gives.
    """
    result, arrays, problem = read_parts(folder)
    recorded = motion_of(folder, arrays)
    tell(BUILDING)
    transcription = transcribe(problem, backend="casadi")
    tell(ROLLING)
    z = stored_variables(folder, result, transcription)
    known = judged_numbers(result)
    try:
        again, judged = transcription.simulate(z), assessed_numbers(transcription.judge(z))
    except NotFinite as error:
        return Replay(folder, len(recorded.time), 0, (), elsewhere(result), fault=str(error))
    check_fits(folder, recorded, again)
    lacking = tuple(name for name in again.arrays() if name not in arrays)
    recorded = motion_of(folder, {**again.arrays(), **arrays})
    differences = (*compare_motions(recorded, again), *compare_numbers(known, judged))
    quantities = len(again.units) + len(judged)
    return Replay(folder, len(recorded.time), quantities, differences, elsewhere(result), lacking)


def read_parts(folder: Path) -> tuple[Result, dict[str, Array], Problem]:
    """Result, the arrays of a motion, and problem of a run folder. Raises as ``replay`` does."""
    if not folder.is_dir():
        raise ReplayError(f"{folder}: there is no such folder; a run folder is one as reports/ball_throw/cma-seed0")
    try:
        config = Config.from_json(read_table(folder / CONFIG), values.verbatim)
        result = Result.from_json(read_table(folder / RESULT), values.verbatim)
        if not result.z:
            raise ReportError(f"{RESULT}: the run has no variables, its solver failed: {result.advice}")
        arrays = read_archive(folder / TRAJECTORY)
    except (ReportError, FileError) as error:
        raise ReplayError(f"{folder}: cannot be rolled out again: {error}") from error
    return result, arrays, load_problem(folder / PROBLEM, config.settings)


def motion_of(folder: Path, arrays: Mapping[str, Any]) -> Trajectory:
    """The motion in the arrays of trajectory.npz; ReplayError if their shapes do not fit."""
    try:
        return make_trajectory(arrays)
    except (ValueError, KeyError, TypeError) as error:
        why = f"{TRAJECTORY}: not a recorded motion ({values.name(str(error))})"
        raise ReplayError(f"{folder}: cannot be rolled out again: {why}") from error


def stored_variables(folder: Path, result: Result, transcription: Transcription) -> Array:
    """(n,): the decision vector of a result."""
    parts = []
    for block in transcription.shooting.blocks:
        found = result.z[block.name].value.T.ravel() if block.name in result.z else np.zeros(0)
        if found.size != block.stop - block.start:
            raise ReplayError(
                f"{folder}: {RESULT} has {found.size} numbers for variable {block.name!r}, {PROBLEM} has "
                f"{block.stop - block.start}"
            )
        parts.append(found)
    return np.concatenate(parts)


def judged_numbers(result: Result) -> dict[str, float]:
    """What the judge said of the run."""
    return {
        "objective": result.objective,
        **{f"output: {name}": value for name, value in result.outputs.items()},
        **{f"cost: {name}": value for name, value in result.costs.items()},
        **{f"{check.kind}: {check.name}": check.error for check in result.checks},
    }


def assessed_numbers(judged: Assessment) -> dict[str, float]:
    """The same of what is judged now."""
    return {
        "objective": judged.objective,
        **{f"output: {name}": value for name, value in judged.outputs.items()},
        **{f"cost: {name}": value for name, value in judged.costs.items()},
        **{f"{check.kind}: {check.name}": check.error for check in judged.checks},
    }


def check_fits(folder: Path, recorded: Trajectory, again: Trajectory) -> None:
    """ReplayError where the recorded motion is of other things, or has another number of instants."""
    for what in ("body_names", "contact_names", "joint_names", "time"):
        first, second = (np.asarray(getattr(each, what)) for each in (recorded, again))
        same = first.size == second.size if what == "time" else first.tolist() == second.tolist()
        if not same:
            sizes = f"{first.size} and {second.size}"
            raise ReplayError(f"{folder}: {TRAJECTORY} and {PROBLEM} do not belong together: {what}, {sizes}")


def elsewhere(result: Result) -> dict[str, tuple[str, str]]:
    """What the run was made with and what is here, by name, where both are known and differ; hosts may."""
    then, now = {**result.versions, **result.provenance}, {**versions(), **machine()}
    del now["host"]
    return {name: (str(then[name]), now[name]) for name in then if name in now and str(then[name]) != now[name]}
