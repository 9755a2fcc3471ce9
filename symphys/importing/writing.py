"""Tables of a robot as a readable file: comments give units, origins and losses."""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from symphys.importing.records import Finding, counted
from symphys.importing.robot import KINDS, Imported

LINE_WIDTH = 116
"""Largest number of characters in a line."""
BARE = re.compile(r"[A-Za-z0-9_-]+")
HEADINGS = {
    "taken": "Taken over",
    "approximated": "Approximated",
    "left out": "Left out",
    "recovered": "Recovered from the file, as MuJoCo loses it",
}
UNITS = "Units are m, kg, s, rad, N and N m. Positions are in the world, with all joint coordinates 0."
MAX_NOTES = 4
"""Findings that are repeated beside one table, at most."""


def robot_text(robot: Imported) -> str:
    """Return the text of a robot file for ``[[include]]``: TOML with the findings as comments."""
    tables = robot.tables
    head = [f"title = {basic(robot.title)}", f"description = {basic(described(robot))}", ""]
    head += comment(f"Made of {robot.file.name} by `symphys import`. {UNITS}")
    for kind in KINDS:
        found = [finding for finding in robot.findings if finding.kind == kind]
        if found:
            head += ["#", f"# {HEADINGS[kind]}"]
            for finding in found:
                head += comment(sentence(finding), "#   ", "#     ")
    lines = [*head, ""]
    for key, value in tables.items():
        if isinstance(value, Mapping):
            lines += [f"[{name_of(key)}]", *entries(value), ""]
        elif isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
            for table in value:
                lines += [*notes(table, robot.findings), f"[[{name_of(key)}]]", *entries(table), ""]
        else:
            lines.insert(2, f"{name_of(key)} = {text_of(value)}")
    return "\n".join(lines)


def described(robot: Imported) -> str:
    """Return the contents of a robot in a sentence."""
    bodies = [table for table in robot.tables.get("body", ()) if table.get("mass") != 0]
    joints, sites = (robot.tables.get(key, ()) for key in ("joint", "site"))
    motors = sum("motor" in each for each in (*joints, *sites))
    parts = [counted(len(bodies), "body", "bodies"), counted(len(joints), "joint"), counted(motors, "motor")]
    mass = sum(float(table["mass"]) for table in bodies if isinstance(table.get("mass"), int | float))
    return f"{', '.join(parts)}; {mass:.4g} kg."


def sentence(finding: Finding) -> str:
    """Return a finding in one line."""
    amount = f" ({finding.amount})" if finding.amount else ""
    return printable(f"{finding.what}: {finding.how}{amount}")


def comment(text: str, first: str = "# ", later: str = "# ") -> list[str]:
    """Return a text as lines of comment."""
    return textwrap.wrap(
        text, LINE_WIDTH, initial_indent=first, subsequent_indent=later, break_long_words=False, break_on_hyphens=False
    )


def notes(table: Mapping[str, Any], findings: Sequence[Finding]) -> list[str]:
    """Return comments with the findings that name a table."""
    name = table.get("name")
    if not isinstance(name, str) or len(name) < 2:
        return []
    mention = re.compile(rf"(?<![\w.]){re.escape(name)}(?![\w.])")
    found = [finding for finding in findings if mention.search(finding.what)]
    return [line for finding in found[:MAX_NOTES] for line in comment(sentence(finding))]


def entries(table: Mapping[str, Any]) -> list[str]:
    """Return the keys of a table, a line each, or several for long values."""
    return [f"{name_of(key)} = {text_of(value, len(key) + 3)}" for key, value in table.items()]


def text_of(value: Any, before: int = 0, indent: str = "") -> str:
    """Return a value as TOML; one that is wider than a line has a line for each entry of its longest list."""
    value = value.tolist() if hasattr(value, "tolist") else value
    plain = one_line(value)
    if before + len(indent) + len(plain) <= LINE_WIDTH:
        return plain
    deeper = indent + "    "
    if isinstance(value, Mapping) and value:
        # lines may end within the brackets of a list, not within the braces of a table
        parts = [f"{name_of(key)} = {text_of(item, len(key) + 5, indent)}" for key, item in value.items()]
        return f"{{ {', '.join(parts)} }}"
    if isinstance(value, list | tuple) and value:
        return "[\n" + "".join(f"{deeper}{line},\n" for line in rows(value, deeper)) + f"{indent}]"
    return plain


def rows(values: Sequence[Any], indent: str) -> Iterable[str]:
    """Yield the entries of a list as lines, with several short ones in each."""
    line = ""
    for value in values:
        text = text_of(value, 1, indent)
        short = not isinstance(value, Mapping) and "\n" not in text
        if line and short and len(indent) + len(line) + len(text) + 3 <= LINE_WIDTH:
            line = f"{line}, {text}"
            continue
        if line:
            yield line
        line = text
    if line:
        yield line


def one_line(value: Any) -> str:
    """Return a value as TOML in one line; numbers with all their digits."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return basic(value)
        case int():
            return str(value)
        case float():
            return number(value)
        case Mapping():
            return f"{{ {', '.join(f'{name_of(key)} = {one_line(item)}' for key, item in value.items())} }}"
        case list() | tuple():
            return f"[{', '.join(one_line(item) for item in value)}]"
    if hasattr(value, "tolist"):
        return one_line(value.tolist())
    raise TypeError(f"{type(value).__name__} has no place in a robot file")


def number(value: float) -> str:
    """Return a number with at most 15 digits; ``inf`` as TOML writes it."""
    if not math.isfinite(value):
        return "nan" if math.isnan(value) else ("inf" if value > 0 else "-inf")
    short = float(f"{value:.15g}")
    return str(int(short)) if short.is_integer() and abs(short) < 1e6 else repr(short)


def basic(text: str) -> str:
    """Return a TOML string on one line."""
    return json.dumps(printable(text), ensure_ascii=False).replace("\x7f", "")


def printable(text: str) -> str:
    """Replace characters that a line of a file cannot hold."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def name_of(key: str) -> str:
    """Return a key as TOML."""
    return key if BARE.fullmatch(key) else basic(key)
