"""A prefix before all names of an included file, so that a robot can stand in a world twice."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

LABELLED = ("cost", "target", "constraint", "scenario")
"""Tables whose names nothing refers to."""
OTHER_TEXTS = ("at", "during", "file", "interpolation", "height", "activation", "output", "weights")
"""Keys whose texts name nothing of the file."""

BEFORE = r"(?:(?<![\w.])|(?<=\bstart\.)|(?<=\bend\.))"
"""Before a mention of a name: nothing of a longer one, but ``end.`` in ``end.knee.angle``."""


def prefixed(data: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """The tables of a file with ``prefix`` before every name and group, and wherever a text mentions one."""
    lists = {key: value for key, value in data.items() if isinstance(value, list)}
    names = sorted(own_names(lists), key=len, reverse=True)
    mention = (
        re.compile(rf"(?:(?<![\w.])|(?<=\bstart\.)|(?<=\bend\.))(?:{'|'.join(map(re.escape, names))})(?!\w)")
        if names
        else None
    )

    def renamed(value: Any) -> Any:
        if isinstance(value, str):
            return mention.sub(lambda match: prefix + match[0], value) if mention else value
        if isinstance(value, list):
            return [renamed(item) for item in value]
        if isinstance(value, dict):
            return {key: item if key in OTHER_TEXTS else renamed(item) for key, item in value.items()}
        return value

    found = dict(data)
    for key, entries in lists.items():
        found[key] = [renamed(entry) for entry in entries]
        for entry in found[key] if key in LABELLED else ():
            if isinstance(entry, dict) and isinstance(entry.get("name"), str):
                entry["name"] = f"{prefix}{entry['name']}"
    return found


def own_names(lists: Mapping[str, list[Any]]) -> set[str]:
    """What the file calls its bodies, joints, variables and groups."""
    tables = [
        entry for key, entries in lists.items() if key not in LABELLED for entry in entries if isinstance(entry, dict)
    ]
    given = [table.get(key) for table in tables for key in ("name", "group")]
    return {name for name in given if isinstance(name, str) and name}
