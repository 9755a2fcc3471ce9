"""Replay of a run: its stored variables simulated again by the exact rollout, and compared with the record.

Nothing of the folder is executed: it holds a problem, settings and numbers. The recorded motion was computed by the
same rollout, so the two agree bit for bit where versions and processor do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys import json_values as values
from symphys.errors import SymphysError
from symphys.files import FileError
from symphys.problem import Problem, load_problem
from symphys.records import dataclass
from symphys.results.config import Config
from symphys.results.file_names import CONFIG, PROBLEM, RESULT, TRAJECTORY
from symphys.results.result import Result
from symphys.results.text_files import ReportError, read_archive, read_table
from symphys.results.trajectories import make_trajectory
from symphys.runs.execute import no_callback
from symphys.runs.provenance import machine, versions
from symphys.trajectory import NotFinite, Trajectory
from symphys.transcription import Assessment, Transcription, transcribe
from symphys.types import Array

BUILDING, ROLLING = "building the problem", "rolling it out"
PARTS = {BUILDING: 8.0, ROLLING: 2.0}
"""The parts that ``replay`` announces, with their relative times."""
COUNTED = {"residual": "N s", "crowded": "", "ambiguous": "", "paradox": ""}
"""Quantities of a whole step, not of a body, joint or contact, and their units."""


class ReplayError(SymphysError):
    """Raised for a run that cannot be simulated again; names the file that is missing or does not fit."""


@dataclass(frozen=True)
class Replay:
    """The comparison of a run with its new rollout.

    Attributes:
        folder: of the run.
        instants: of the recorded motion.
        quantities: how many were compared.
        differences: quantities that are not bit-for-bit equal, those of the motion first.
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
        """Whether everything is bit-for-bit equal."""
        return not self.differences and not self.fault

    def __str__(self) -> str:
        """Return the differences, one a line, or that there are none; then what versions and machine differ."""
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


def replay(folder: Path, tell: Callable[[str], None] = no_callback) -> Replay:
    """Simulate the variables of a run again and compare; ``tell`` is called with each of PARTS.

    Raises:
        ReplayError: no such folder, a file that is missing or damaged, or variables that do not fit the problem.
        ProblemError: problem.toml cannot be read, or has controllers that Python gives.
    """
    result, arrays, problem = read_parts(folder)
    recorded = motion_of(folder, arrays)
    tell(BUILDING)
    transcription = transcribe(problem, backend="casadi")
    tell(ROLLING)
    try:
        z = stored_variables(result, transcription)
    except ReplayError as error:
        raise ReplayError(f"{folder}: {error}") from None
    known = compared_table(result)
    try:
        again, judged = transcription.simulate(z), compared_table(transcription.judge(z))
    except NotFinite as error:
        return Replay(folder, len(recorded.time), 0, (), elsewhere(result), fault=str(error))
    check_fits(folder, recorded, again)
    lacking = tuple(name for name in again.arrays() if name not in arrays)
    recorded = motion_of(folder, {**again.arrays(), **arrays})
    differences = (*compare_motions(recorded, again), *compare_numbers(known, judged))
    quantities = len(again.units) + len(judged)
    return Replay(folder, len(recorded.time), quantities, differences, elsewhere(result), lacking)


def read_parts(folder: Path) -> tuple[Result, dict[str, Array], Problem]:
    """Return result, arrays of the motion, and problem of a run folder. Raises as ``replay`` does."""
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
    """Return the motion in the arrays of trajectory.npz; ReplayError if their shapes do not fit."""
    try:
        return make_trajectory(arrays)
    except (ValueError, KeyError, TypeError) as error:
        why = f"{TRAJECTORY}: not a recorded motion ({values.name(str(error))})"
        raise ReplayError(f"{folder}: cannot be rolled out again: {why}") from error


def stored_variables(result: Result, transcription: Transcription) -> Array:
    """Return the decision vector (n,) of a result; ReplayError if the problem has another size of a variable."""
    parts = []
    for block in transcription.shooting.blocks:
        found = result.z[block.name].value.T.ravel() if block.name in result.z else np.zeros(0)
        if found.size != (size := block.stop - block.start):
            text = f"{RESULT} has {found.size} numbers for variable {block.name!r}, the problem has {size}"
            raise ReplayError(text)
        parts.append(found)
    return np.concatenate(parts)


def compared_table(judged: Result | Assessment) -> dict[str, float]:
    """Return the numbers of a judgement that are compared, by name."""
    return {
        "objective": judged.objective,
        **{f"output: {name}": value for name, value in judged.outputs.items()},
        **{f"cost: {name}": value for name, value in judged.costs.items()},
        **{f"{check.kind}: {check.name}": check.error for check in judged.checks},
    }


def check_fits(folder: Path, recorded: Trajectory, again: Trajectory) -> None:
    """Raise ReplayError where the recorded motion has other bodies, or another number of instants."""
    for what in ("body_names", "contact_names", "joint_names", "time"):
        first, second = (np.asarray(getattr(each, what)) for each in (recorded, again))
        same = first.size == second.size if what == "time" else first.tolist() == second.tolist()
        if not same:
            sizes = f"{first.size} and {second.size}"
            raise ReplayError(f"{folder}: {TRAJECTORY} and {PROBLEM} do not belong together: {what}, {sizes}")


def elsewhere(result: Result) -> dict[str, tuple[str, str]]:
    """Return what differs between the origin of the run and this machine, by name; hosts are not compared."""
    then, now = {**result.versions, **result.provenance}, {**versions(), **machine()}
    del now["host"]
    return {name: (str(then[name]), now[name]) for name in then if name in now and str(then[name]) != now[name]}


@dataclass(frozen=True)
class QuantityDifference:
    """A quantity that is not bit-for-bit equal.

    Attributes:
        name: ``ball.position``, ``output: speed [m/s]``, ``objective``.
        unit: of the difference; empty where it has none, or where the name has it.
        size: the largest difference of a component; inf where only one is a number, 0 where only signs of zero differ.
        time: [s] at which it is; None for what is no motion.
        recorded, again: the two numbers there.
    """

    name: str
    unit: str
    size: float
    time: float | None
    recorded: float
    again: float

    def __str__(self) -> str:
        """Return one line for people."""
        unit = f" {self.unit}" if self.unit else ""
        when = "" if self.time is None else f" at {self.time:g} s"
        return f"{self.name}: {self.size:.3g}{unit}{when} ({self.recorded!r} was recorded, {self.again!r} again)"


def compare_motions(recorded: Trajectory, again: Trajectory) -> Iterator[QuantityDifference]:
    """Yield the quantities that differ between two motions of the same bodies at the same times."""
    for name, unit in [*again.units.items(), *COUNTED.items()]:
        pair = [getattr(each, name) if name in COUNTED else each[name] for each in (recorded, again)]
        yield from compare_arrays(name, unit, again.time, *pair)


def compare_arrays(
    name: str, unit: str, time: Array, recorded: NDArray[np.generic], again: NDArray[np.generic]
) -> Iterator[QuantityDifference]:
    """Yield the largest difference of two arrays, whose rows are at ``time``; nothing if they agree bit for bit.

    Arrays of different shapes count as one infinite difference.
    """
    first, second = (np.ascontiguousarray(each, float) for each in (recorded, again))
    if first.shape != second.shape:
        yield QuantityDifference(name, unit, np.inf, None, np.nan, np.nan)
        return
    differs = first.view(np.int64) != second.view(np.int64)
    if not differs.any():
        return
    gaps = np.where(differs, distances(first, second), -1.0)
    place = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
    yield QuantityDifference(
        name, unit, float(gaps[place]), float(time[place[0]]), float(first[place]), float(second[place])
    )


def compare_numbers(recorded: Mapping[str, float], again: Mapping[str, float]) -> Iterator[QuantityDifference]:
    """Yield the numbers of two tables that differ, by name; NaN stands for a missing one."""
    for name in dict.fromkeys([*recorded, *again]):
        pair = [np.array([table.get(name, np.nan)], float) for table in (recorded, again)]
        if pair[0].tobytes() != pair[1].tobytes() and not all(np.isnan(each).all() for each in pair):
            size = float(distances(*pair)[0])
            yield QuantityDifference(name, "", size, None, float(pair[0][0]), float(pair[1][0]))


def distances(first: Array, second: Array) -> Array:
    """Return the absolute differences: 0 where both are NaN, inf where one is."""
    with np.errstate(invalid="ignore"):
        gaps = np.where(first == second, 0.0, np.abs(first - second))
    gaps = np.where(np.isnan(first) & np.isnan(second), 0.0, gaps)
    return np.where(np.isnan(gaps), np.inf, gaps)
