"""Read and parse TOML, and check that its numbers are small enough to be computed with."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from symphys.errors import Issue, ProblemError
from symphys.files import check_regular
from symphys.problem.reading.faults import Faults, Place

MAX_BYTES = 10_000_000
MAX_KEY_PARTS = 20
LONG_KEY = re.compile(rf"(?<![\w-])(?:[\"']?[\w-]++[\"']?[ \t]*\.[ \t]*){{{MAX_KEY_PARTS}}}")
"""Dotted keys cost the parser quadratic time in their length."""
EXAMPLE = (
    'a problem file is TOML text such as: [simulation] with duration and dt, then [[body]] with name = "ball", ...'
)
MAX_NUMBER = 1e150
"""Largest absolute value of a number; its square is finite."""
TOO_LARGE = f"is too large to be computed with; numbers are from {-MAX_NUMBER:g} to {MAX_NUMBER:g}"
UNCHECKED_TABLES = ("solver", "recording")
"""Tables that are not checked: their numbers go to libraries, or have a range of their own."""
UNCHECKED_KEYS = ("axis", "axes", "normal", "mass", "density", "inertia", "noise")
"""Keys that are not checked: directions, whose length does not matter, and numbers with a range of their own."""
MAX_FAULTS = 3
"""Largest number of faults of one table that are named."""


def refuse(path: Path, message: str) -> ProblemError:
    """The error for a file as a whole."""
    return ProblemError(str(path), [Issue("", message)])


def read_source(path: Path) -> str:
    """The text of the file."""
    try:
        if path.is_dir():
            raise refuse(path, "this is a folder; name a problem file in it")
        if not path.exists():
            raise refuse(path, "there is no such file")
        check_regular(path)
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise refuse(path, f"cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise refuse(path, "this is no valid path") from None
    if len(content) > MAX_BYTES:
        raise refuse(path, f"the file is larger than {MAX_BYTES // 1_000_000} MB, too large for a problem file")
    return decode(path, content)


def decode(path: Path, content: bytes) -> str:
    """The content as text with plain line ends."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise refuse(path, f"the file is not UTF-8 text (line {line}); {EXAMPLE}") from None
    if not text.strip():
        raise refuse(path, f"the file is empty; {EXAMPLE}")
    return text.replace("\r\n", "\n")


def toml_string(text: str) -> str:
    """Return a text as a TOML string on one line."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def parse_toml(path: Path, text: str) -> dict[str, Any]:
    """The tables and keys of the text."""
    long = LONG_KEY.search(text)
    if long:
        line = text.count("\n", 0, long.start()) + 1
        raise refuse(path, f"line {line}: a name with more than {MAX_KEY_PARTS} dots")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise refuse(path, f"this is not valid TOML: {error}") from None
    except RecursionError:
        raise refuse(path, "brackets or braces are nested too deep") from None
    except (ValueError, OverflowError, MemoryError) as error:
        reason = str(error).split(";")[0]  # what follows is advice to programmers
        raise refuse(path, f"this is not valid TOML: {reason}") from None


def check_range(data: Mapping[str, Any], faults: Faults) -> None:
    """Name the finite numbers of a file that are too large."""
    for key, table in data.items():
        if key in UNCHECKED_TABLES:
            continue
        for count, (place, value) in enumerate(_beyond((key,), table)):
            if count < MAX_FAULTS:
                faults.add(place, f"{_shown(value)} {TOO_LARGE}")


def _beyond(place: Place, value: Any) -> Iterator[tuple[Place, float]]:
    """The numbers beyond the range, with their places."""
    stack: list[tuple[tuple[str | int, ...], Any]] = [(tuple(place), value)]
    while stack:
        where, here = stack.pop()
        if isinstance(here, Mapping):
            stack += [
                ((*where, str(key)), each) for key, each in reversed(list(here.items())) if key not in UNCHECKED_KEYS
            ]
        elif isinstance(here, list | tuple):
            stack += [((*where, k), each) for k, each in reversed(list(enumerate(here)))]
        elif isinstance(here, int | float) and MAX_NUMBER < abs(here) < math.inf:
            yield where, here


def _shown(value: float) -> str:
    """A number in a few characters."""
    return f"{value:g}" if isinstance(value, float) or abs(value) < 2**1000 else "an integer of over 300 digits"
