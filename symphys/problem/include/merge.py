"""Several files as one: lists one after the other, other tables key by key."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from symphys.problem.reading.faults import Faults, SourceLocation
from symphys.problem.schema.include import IncludeTable


@dataclass(frozen=True)
class IncludedFile:
    """A file.

    Attributes:
        file: its name.
        written: its tables as they stand there.
        data: those of them that are used, with prefixes.
        table: what includes it; None for the problem itself.
    """

    file: str
    written: Mapping[str, Any]
    data: Mapping[str, Any]
    table: IncludeTable | None = None


@dataclass
class MergedFiles:
    """A problem together with what it includes.

    Attributes:
        data: all tables.
        text: of the problem, with those of the included files.
        origins: where what was written; see ``faults.Origins``. Empty if nothing is included.
        moves: each include, with the places of its tables in the lists of ``data``.
    """

    data: dict[str, Any]
    text: str
    origins: dict[tuple[str | int, ...], SourceLocation] = field(default_factory=dict)
    moves: list[tuple[IncludeTable, dict[str, range]]] = field(default_factory=list)

    @property
    def shared(self) -> Collection[str]:
        """The lists that hold tables of included files."""
        return {key for _, ranges in self.moves for key in ranges}


def merge(sources: Sequence[IncludedFile], lists: Collection[str], text: str, faults: Faults) -> MergedFiles:
    """All tables, in the order of the files; notes keys that two files give differently.

    Args:
        sources: the included files, whose tables are of the right kinds, then the problem.
        lists: the names of tables that are lists.
        text: of all.
        faults: gets what does not fit together.
    """
    merged = MergedFiles({}, text)
    for source in sources:
        ranges = dict[str, range]()
        for key, value in source.data.items():
            if key in lists and isinstance(value, list):
                ranges[key] = append(merged, source, key, value)
            elif isinstance(value, dict) and isinstance(merged.data.get(key, {}), dict):
                overlay(merged, source, key, value, faults)
            else:
                merged.data[key] = value
        if source.table is not None:
            merged.moves.append((source.table, ranges))
    faults.stop_if_any()
    return merged


def append(merged: MergedFiles, source: IncludedFile, key: str, entries: Sequence[Any]) -> range:
    """Put the tables of a list after those that are there; where they then are."""
    known = merged.data.setdefault(key, [])
    start = len(known)
    known.extend(entries)
    for index in range(len(entries)):
        merged.origins[key, start + index] = SourceLocation(source.file, source.written, (key, index))
    return range(start, len(known))


def overlay(merged: MergedFiles, source: IncludedFile, key: str, table: Mapping[str, Any], faults: Faults) -> None:
    """Add the keys of a table to those that are there."""
    known = merged.data.setdefault(key, {})
    for name, value in table.items():
        origin = SourceLocation(source.file, source.written, (key, name))
        if name not in known:
            known[name], merged.origins[key, name] = value, origin
        elif known[name] != value:
            other = merged.origins[key, name].file
            faults.add_at(origin, f"differs from what {other} gives; leave one of them out, or make them equal")
