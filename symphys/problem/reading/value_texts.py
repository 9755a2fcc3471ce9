"""How values of a file are shown in messages, and what a value means that was typed."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence

from symphys import files
from symphys.suggest import quote


def shown(value: object) -> str:
    """A value as its author would recognise it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"the text {quote(value)}"
    if isinstance(value, int | float):
        return repr(value) if isinstance(value, float) or abs(value) < 10**18 else "a number that large"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return "a table" if isinstance(value, Mapping) else f"a {type(value).__name__}"


def listed(words: Sequence[str], last: str) -> str:
    """``a, b or c``; ``last`` is the word before the last one."""
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def read_value(text: str) -> object:
    """A TOML value that JSON has too, else the text itself."""
    try:
        table = tomllib.loads(f"value = {text}")
        files.strict(table)
    except (ValueError, TypeError, RecursionError):
        return text
    return table["value"] if table.keys() == {"value"} else text
