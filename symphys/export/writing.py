"""A problem written for other programs, into folders."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from symphys.export.casadi_files import casadi_files
from symphys.export.folder import ExportError, write_folders
from symphys.export.mjcf import mjcf_files
from symphys.export.sources import c_files
from symphys.problem import Problem, require_solvable
from symphys.problem.loading import Source, load
from symphys.transcription import transcribe
from symphys.transcription.network_rollout import require_small_nets
from symphys.version import __version__


def export(
    problem: Source,
    *,
    c: str | Path | None = None,
    casadi: str | Path | None = None,
    mjcf: str | Path | None = None,
) -> list[Path]:
    """Write a problem as files that need no symphys. Also called as ``symphys.export``.

    Args:
        problem: what ``symphys.load`` takes.
        c: folder for C sources: step, rollout and gradient.
        casadi: folder for functions that plain casadi loads.
        mjcf: folder for a model file of MuJoCo: bodies, joints, the start.

    Returns:
        The files.

    Raises:
        ExportError: there is nothing to write, or a file in the way that symphys did not write.
        ProblemError: the problem cannot be exported so; says why.

    Example:
        >>> import symphys
        >>> [path.name for path in symphys.export("arm_reach", mjcf="model")]
        ['arm_reach.xml']
    """
    asked = {
        kind: Path(folder) for kind, folder in (("c", c), ("casadi", casadi), ("mjcf", mjcf)) if folder is not None
    }
    if not asked:
        raise ExportError("export: say what to write and where, as c='folder', casadi='folder' or mjcf='folder'")
    folders: dict[Path, dict[str, bytes]] = {}
    for kind, contents in contents_of(load(problem), list(asked)):
        folders[asked[kind]] = folders.get(asked[kind], {}) | contents
    return write_folders(folders)


def contents_of(problem: Problem, kinds: list[str]) -> Iterator[tuple[str, dict[str, bytes]]]:
    """The files of each kind, "c", "casadi" or "mjcf"; a model asks for nothing to be solved."""
    if "c" in kinds or "casadi" in kinds:
        require_solvable(problem)
        require_small_nets(problem, "export")
        transcription = transcribe(problem, backend="casadi")
    if "c" in kinds:
        yield "c", c_files(transcription, __version__)
    if "casadi" in kinds:
        yield "casadi", casadi_files(transcription, __version__)
    if "mjcf" in kinds:
        yield "mjcf", mjcf_files(problem)
