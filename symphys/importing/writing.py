"""Tables of a robot as a file to read: comments say units, what came from where, and what is missing."""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from symphys.importing.findings import Finding
from symphys.importing.robot import KINDS, Imported
from symphys.importing.wording import counted

WIDTH = 116
BARE = re.compile(r"[A-Za-z0-9_-]+")
HEADINGS = {
    "taken": "Taken over",
    "approximated": "Approximated",
    "left out": "Left out",
    "recovered": "Recovered from the file, as MuJoCo loses it",
}
UNITS = "Units are m, kg, s, rad, N and N m. Positions are in the world, with all joint coordinates 0."
MOST_NOTES = 4
"""Findings that are repeated beside one table."""


def robot_text(robot: Imported) -> str:
    """The text of a robot file, which ``[[include]]`` takes: TOML with the findings as comments."""
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
        elif is_list_of_tables(value):
            for table in value:
                lines += [*notes(table, robot.findings), f"[[{name_of(key)}]]", *entries(table), ""]
        else:
            lines.insert(2, f"{name_of(key)} = {text_of(value)}")
    return "\n".join(lines)


def described(robot: Imported) -> str:
    """What there is, in a sentence."""
    bodies = [table for table in robot.tables.get("body", ()) if table.get("mass") != 0]
    joints = robot.tables.get("joint", ())
    motors = sum("motor" in joint for joint in joints)
    parts = [counted(len(bodies), "body", "bodies"), counted(len(joints), "joint"), counted(motors, "motor")]
    mass = sum(float(table["mass"]) for table in bodies if isinstance(table.get("mass"), int | float))
    return f"{', '.join(parts)}; {mass:.4g} kg."


def sentence(finding: Finding) -> str:
    """A finding in one line."""
    amount = f" ({finding.amount})" if finding.amount else ""
    return printable(f"{finding.what}: {finding.how}{amount}")


def comment(text: str, first: str = "# ", later: str = "# ") -> list[str]:
    """A text as lines of comment."""
    return textwrap.wrap(
        text, WIDTH, initial_indent=first, subsequent_indent=later, break_long_words=False, break_on_hyphens=False
    )


def notes(table: Mapping[str, Any], findings: Sequence[Finding]) -> list[str]:
    """What findings say of a table, by its name."""
    name = table.get("name")
    if not isinstance(name, str) or len(name) < 2:
        return []
    mention = re.compile(rf"(?<![\w.]){re.escape(name)}(?![\w.])")
    found = [finding for finding in findings if mention.search(finding.what)]
    lines = [line for finding in found[:MOST_NOTES] for line in comment(sentence(finding))]
    return lines


def entries(table: Mapping[str, Any]) -> list[str]:
    """The keys of a table, a line each, or several for what is long."""
    return [f"{name_of(key)} = {text_of(value, len(key) + 3)}" for key, value in table.items()]


def text_of(value: Any, before: int = 0, indent: str = "") -> str:
    """A value as TOML; what is wider than a line has a line for each entry of its longest list."""
    value = value.tolist() if hasattr(value, "tolist") else value
    plain = one_line(value)
    if before + len(indent) + len(plain) <= WIDTH:
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
    """Entries of a list as lines: several short ones in each."""
    line = ""
    for value in values:
        text = text_of(value, 1, indent)
        if line and len(indent) + len(line) + len(text) + 3 <= WIDTH and "\n" not in text and not mapping(value):
            line = f"{line}, {text}"
            continue
        if line:
            yield line
        line = text
    if line:
        yield line


def mapping(value: Any) -> bool:
    """Whether it is a table."""
    return isinstance(value, Mapping)


def one_line(value: Any) -> str:
    """A value as TOML in one line; numbers with all their digits."""
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
    """At most 15 digits; ``inf`` as TOML writes it."""
    if not math.isfinite(value):
        return "nan" if math.isnan(value) else ("inf" if value > 0 else "-inf")
    short = float(f"{value:.15g}")
    return str(int(short)) if short.is_integer() and abs(short) < 1e6 else repr(short)


def basic(text: str) -> str:
    """A TOML string on one line."""
    return json.dumps(printable(text), ensure_ascii=False).replace("\x7f", "")


def printable(text: str) -> str:
    """The text without what a line of a file cannot hold."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def name_of(key: str) -> str:
    """A key as TOML."""
    return key if BARE.fullmatch(key) else basic(key)


def is_list_of_tables(value: Any) -> bool:
    """Whether it is written with double brackets."""
    return isinstance(value, list) and bool(value) and all(isinstance(each, Mapping) for each in value)
