"""Collecting what is wrong with a file, each fault with its place written one way: ``body "ball".shape.sphere``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NoReturn

from symphys.errors import Issue, ProblemError
from symphys.records import dataclass
from symphys.suggest import quote

Place = Sequence[str | int]
"""Keys and indices from the top of the file, for instance ("body", 0, "mass")."""


@dataclass(frozen=True)
class SourceLocation:
    """The file, its parsed content, and the place there at which something was written."""

    file: str
    data: Mapping[str, Any]
    place: Place


Origins = Mapping[tuple[str | int, ...], SourceLocation]
"""Of tables in lists, and of keys in other tables, by their places in what files that include others become."""


class Faults:
    """The faults found so far in one file, and in those that it includes."""

    def __init__(self, file: str, data: Mapping[str, Any], origins: Origins = MappingProxyType({})) -> None:
        """Keep the file's name and its parsed content, from which places take names; ``origins``: what is included."""
        self.file = file
        self.data = data
        self.origins = origins
        self.issues: list[Issue] = []

    def add(self, place: Place, message: str) -> None:
        """Note a fault."""
        self.add_at(self.origin(place), message)

    def add_at(self, origin: SourceLocation, message: str) -> None:
        """Note a fault where something was written."""
        file = "" if origin.file == self.file else origin.file
        issue = Issue(describe_place(origin.place, origin.data), message, file)
        if issue not in self.issues[-1000:]:
            self.issues.append(issue)

    def origin(self, place: Place) -> SourceLocation:
        """Return where the value at a place was written."""
        found = self.origins.get(tuple(place[:2]))
        if found is None:
            return SourceLocation(self.file, self.data, place)
        return SourceLocation(found.file, found.data, (*found.place, *place[2:]))

    def called(self, place: Place, beside: Place) -> str:
        """``pair[3] of robot.toml``: what to call a place in a message about the place ``beside``."""
        origin = self.origin(place)
        return describe_place(origin.place, origin.data) + self.elsewhere(beside, place)

    def elsewhere(self, place: Place, other: Place) -> str:
        """`` of robot.toml``: the file of ``other``, if that is not the file of ``place``."""
        file = self.origin(other).file
        return "" if file == self.origin(place).file else f" of {file}"

    def stop_if_any(self) -> None:
        """Raise all that was found as one ProblemError; return if there is nothing."""
        if self.issues:
            raise ProblemError(self.file, self.issues)

    def stop(self, place: Place, message: str) -> NoReturn:
        """Note a fault and raise all that was found."""
        self.add(place, message)
        raise ProblemError(self.file, self.issues)


def describe_place(place: Place, data: Any) -> str:
    """``body "ball".mass``: an entry with a name of its own is shown by it, others as ``body[0]``."""
    text = ""
    for key in place:
        if isinstance(key, str):
            text += f".{key}" if text else key
            data = data.get(key) if isinstance(data, Mapping) else None
            continue
        entries = data if isinstance(data, list) else []
        name = own_name(entries, key)
        text += f"[{key}]" if name is None else f" {quote(name)}"
        data = entries[key] if -len(entries) <= key < len(entries) else None
    return text


def own_name(entries: Sequence[Any], index: int) -> str | None:
    """The name of a table in a list, if no other table in the list has the same."""
    names = [entry.get("name") if isinstance(entry, Mapping) else None for entry in entries]
    name = names[index] if index < len(names) else None
    return name if isinstance(name, str) and name.strip() and names.count(name) == 1 else None
