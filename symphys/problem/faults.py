"""Collecting what is wrong with a file, each fault with its place written one way: ``body "ball".shape.sphere``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from symphys.errors import Issue, ProblemError
from symphys.suggest import quote

Place = Sequence[str | int]
"""Keys and indices from the top of the file, for instance ("body", 0, "mass")."""


class Faults:
    """The faults found so far in one file."""

    def __init__(self, file: str, data: Mapping[str, Any]) -> None:
        """Keep the file's name and its parsed content, from which places take names."""
        self.file = file
        self.data = data
        self.issues: list[Issue] = []

    def add(self, place: Place, message: str) -> None:
        """Note a fault."""
        issue = Issue(describe_place(place, self.data), message)
        if issue not in self.issues[-1000:]:
            self.issues.append(issue)

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
