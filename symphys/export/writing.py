"""Write a problem for other programs into folders."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from symphys.export.casadi_files import casadi_files
from symphys.export.folder import ExportError, write_folders
from symphys.export.mjcf_departures import Departure
from symphys.export.mjcf_trial import tried_model
from symphys.export.sources import c_files
from symphys.problem import Problem, require_solvable
from symphys.problem.problem import Source, load
from symphys.records import dataclass
from symphys.transcription.network_rollout import require_small_nets
from symphys.transcription.transcribe import transcribe_whole
from symphys.version import __version__


def export_problem(
    problem: Source,
    *,
    c: str | Path | None = None,
    casadi: str | Path | None = None,
    mjcf: str | Path | None = None,
    approximate: bool = False,
) -> list[Path]:
    """Write a problem as files that other programs use without symphys.

    Args:
        problem: any argument of ``symphys.load``.
        c: folder for C sources: step, rollout and gradient.
        casadi: folder for functions that plain casadi loads.
        mjcf: folder for a model file of MuJoCo: bodies, joints, the start.
        approximate: leave out of that model the parts that MuJoCo has no counterpart for, instead of refusing them; the
            file begins with a list of them.

    Returns:
        The paths of the files.

    Raises:
        SymphysError: there is nothing to write, a file that symphys did not write is in the way, or MJCF cannot express
            the world.
        ProblemError: the problem cannot be exported to this format; says why.

    Example:
        >>> import symphys
        >>> [path.name for path in symphys.export_problem("arm_reach", mjcf="model")]
        ['arm_reach.xml']
    """
    asked = {
        kind: Path(folder) for kind, folder in (("c", c), ("casadi", casadi), ("mjcf", mjcf)) if folder is not None
    }
    if not asked:
        raise ExportError("say what to write and where, as c='folder', casadi='folder' or mjcf='folder'")
    return list(write(load(problem), asked, approximate).paths)


@dataclass(frozen=True)
class ExportedFiles:
    """The files that an export has written.

    Attributes:
        paths: the paths of the files.
        departures: how the model for MuJoCo differs from the problem's world.
    """

    paths: tuple[Path, ...]
    departures: tuple[Departure, ...]


def write(problem: Problem, asked: Mapping[str, Path], approximate: bool = False) -> ExportedFiles:
    """Write the files of each kind, "c", "casadi" or "mjcf", into its folder, as ``export_problem`` does."""
    folders: dict[Path, dict[str, bytes]] = {}
    for kind, contents in contents_of(problem, list(asked)):
        folders[asked[kind]] = folders.get(asked[kind], {}) | contents
    departures: tuple[Departure, ...] = ()
    if "mjcf" in asked:
        model = tried_model(problem, approximate)
        departures, folder = model.departures, asked["mjcf"]
        folders[folder] = folders.get(folder, {}) | {f"{problem.name}.xml": model.text.encode()}
    return ExportedFiles(tuple(write_folders(folders)), departures)


def contents_of(problem: Problem, kinds: list[str]) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield the files of each kind, "c" or "casadi", which need a problem that can be solved."""
    if "c" in kinds or "casadi" in kinds:
        require_solvable(problem)
        require_small_nets(problem, "export")
        transcription = transcribe_whole(problem, exact=False, backend="casadi", threads=None)
    if "c" in kinds:
        yield "c", c_files(transcription, __version__)
    if "casadi" in kinds:
        yield "casadi", casadi_files(transcription, __version__)
