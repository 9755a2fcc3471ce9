"""A model file as the tables of a problem file, with what became of its parts."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from symphys.files import modified
from symphys.importing.findings import Finding, Kind
from symphys.importing.options import ImportOptions
from symphys.importing.packages import model_file
from symphys.importing.source import AS_IT_IS, Source, read_source
from symphys.importing.tables import tables_of

KINDS: tuple[Kind, ...] = ("taken", "approximated", "left out", "recovered")
"""In the order of tables."""
MOST_KEPT = 32
"""Robots that a process keeps, since reading one takes a second."""


@dataclass(frozen=True)
class Imported:
    """A robot.

    Attributes:
        file: that was read.
        title: of the robot: what the model calls itself, else the name of the file.
        tables: of a problem file, as ``[[include]]`` takes them: bodies, joints, ...
        findings: what became of the parts of the model, in the order of ``KINDS``.
    """

    file: Path
    title: str
    tables: dict[str, Any]
    findings: tuple[Finding, ...]


_kept: dict[tuple[str, ImportOptions], tuple[dict[Path, int | None], Imported]] = {}
"""By path and options: when the files of each were written, and what was made of them."""


def read_robot(path: str | Path, options: ImportOptions = AS_IT_IS) -> Imported:
    """Read an MJCF or URDF file, unless this process has read it and none of its files has changed.

    ``package://name/path`` is a file of an installed package.

    Raises:
        ImportProblem: names the file, and where known the line, the element and the attribute.
        Unavailable: MuJoCo, which does the reading, is not installed.
    """
    path = model_file(path)
    key = (str(path.absolute()), options)
    times, known = _kept.get(key, ({}, None))
    if known is None or any(modified(file) != time for file, time in times.items()):
        source = read_source(path, options)
        known = made(source, options)
        while len(_kept) >= MOST_KEPT:
            _kept.pop(next(iter(_kept)))
        _kept[key] = {file: modified(file) for file in source.files}, known
    return replace(known, file=path, tables=deepcopy(known.tables))


def made(source: Source, options: ImportOptions) -> Imported:
    """The robot of a compiled model."""
    tables, findings = tables_of(source, options)
    told = dict.fromkeys((*source.findings, *findings))
    ordered = tuple(sorted(told, key=lambda finding: KINDS.index(finding.kind)))
    return Imported(source.file, title(source.model, source.file), tables, ordered)


def title(model: Any, file: Path) -> str:
    """What a compiled model calls itself; the name of the file where it has none of its own."""
    own = bytes(model.names).split(b"\0", 1)[0].decode("utf-8", "replace")
    return file.stem if own in ("", "MuJoCo Model") else own
