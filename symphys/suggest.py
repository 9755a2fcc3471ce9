"""Hints for error messages: what the user may have meant, and what would be valid."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

SHOWN = 30
"""How many valid names a message lists at most."""
COMPARED = 100
"""How many characters of a name are compared: a name from a broken file may be as long as the file."""


def hint(name: str, valid: Iterable[str]) -> str:
    """``did you mean "mass"? (valid: mass, shape)``; a long list is left out where something comes close."""
    names = list(dict.fromkeys(valid))
    if not names:
        return "nothing is valid here"
    by_lower = {known.lower(): known for known in names}
    close = [by_lower[match] for match in get_close_matches(name[:COMPARED].lower(), list(by_lower))]
    listing = f"valid: {', '.join(names[:SHOWN])}{', ...' if len(names) > SHOWN else ''}"
    if not close:
        return listing
    question = f"did you mean {' or '.join(quote(match) for match in close)}?"
    return question if len(names) > SHOWN else f"{question} ({listing})"


def quote(text: str, width: int = 60) -> str:
    """The text in double quotes on one line of printable characters, cut at ``width``."""
    line = "".join(c if c.isprintable() else " " for c in text)
    return f'"{line}"' if len(line) <= width else f'"{line[: width - 3]}..."'
