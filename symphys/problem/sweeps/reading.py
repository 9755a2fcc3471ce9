"""Sweeps as a [sweep] table or the options ``--sweep`` and ``--samples`` state them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from symphys.errors import ProblemError
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.reading.messages import read_value, report, shown
from symphys.problem.reading.source import parse_toml
from symphys.problem.schema.sweep import RangeTable, SweepTable
from symphys.problem.sweeps.sweep import (
    GRID,
    KINDS,
    SPACINGS,
    Axis,
    Interval,
    Kind,
    Levels,
    Samples,
    Spacing,
    Sweep,
    SweepError,
    spaced,
)
from symphys.suggest import hint

SWEEP = "sweep"
"""The name of the table."""
TABLE_FORMS = "a list of values, or a table { from = 0.2, to = 2, count = 10 }"
HEADER = re.compile(r"\s*\[\[?\s*(?P<name>[A-Za-z_\"'][^\]]*?)\s*\]\]?\s*(?:#.*)?")
OWN_HEADER = re.compile(r"([\"']?)sweep\1(?:\s*\..*)?", re.DOTALL)
BLANK = re.compile(r"\s*(?:#.*)?")
NO_SWEEP = "none"
"""What ``--sweep`` takes to leave the [sweep] table of a file out."""
OPTION_FORMS = "KEY=FROM:TO:COUNT, KEY=FROM:TO:COUNT:log, KEY=FROM:TO for samples, or KEY=A,B,C"
OPTION_EXAMPLE = "ball.mass=0.2:2:10"
NUMBER = r"[-+]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
RANGE = re.compile(rf"\s*{NUMBER}\s*:.*", re.DOTALL)
SHORT_KINDS: dict[str, Kind] = {"lhs": "latin hypercube", "latin-hypercube": "latin hypercube"}
CLOSING_BRACKETS = {"[": "]", "{": "}"}


def read_sweep(table: object, file: str) -> Sweep:
    """The sweep of a table; ProblemError names every fault."""
    faults = Faults(file, {SWEEP: table})
    if not isinstance(table, dict):
        faults.stop((SWEEP,), f'must be a table, not {shown(table)}; write [sweep] and below it "ball.mass" = [1, 2]')
    own = {key: value for key, value in table.items() if key in SweepTable.model_fields}
    try:
        head = SweepTable.model_validate(own)
    except ValidationError as error:
        report(error, SweepTable, faults, (SWEEP,))
        faults.stop_if_any()
        raise
    axes = [axis for key, value in entries(table) if (axis := read_entry(key, value, faults)) is not None]
    samples = GRID
    try:
        samples = Samples(head.samples, head.count or 0, head.seed)
    except SweepError as error:
        faults.add((SWEEP, "count"), str(error))
    if not axes and not faults.issues:
        faults.add((SWEEP,), f'has no key to sweep; add one, such as "ball.mass" = {TABLE_FORMS[2:]}')
    faults.stop_if_any()
    return Sweep(tuple(axes), samples)


def entries(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, object]]:
    """Dotted keys with what is behind them: TOML reads ``ball.mass = [1, 2]`` as a table within another."""
    for key, value in table.items():
        if not above and key in SweepTable.model_fields:
            continue
        if isinstance(value, dict) and value and not {"from", "to"} & value.keys():
            yield from entries(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def read_entry(key: str, value: object, faults: Faults) -> Axis | None:
    """Read one axis; None after a fault."""
    place: Place = (SWEEP, key)
    try:
        if isinstance(value, list):
            return Levels(key, tuple(value))
        if not isinstance(value, dict) or not value:
            raise SweepError(f"must be {TABLE_FORMS}, not {shown(value)}")
        table = RangeTable.model_validate(value)
        ends = (table.start, table.to)
        if table.count is None:
            return Interval(key, ends, table.spacing)
        return spaced(key, ends, table.count, table.spacing)
    except ValidationError as error:
        report(error, RangeTable, faults, place)
    except SweepError as error:
        faults.add(place, str(error))
    return None


def without_sweep(path: Path, text: str, data: Mapping[str, Any]) -> str:
    """The text of a problem file without its [sweep], so that a problem is the same whatever is swept.

    Args:
        path: of the file.
        text: what is in it.
        data: its tables without [sweep].
    """
    kept = list[str]()
    inside, lately = False, list[str]()
    for line in text.splitlines(keepends=True):
        header = HEADER.fullmatch(line.rstrip())
        if header:
            inside = OWN_HEADER.fullmatch(header["name"]) is not None
            while inside and kept and kept[-1].lstrip().startswith("#"):
                kept.pop()  # a comment right above the table
            if not inside:
                kept += lately[next((k for k, each in enumerate(lately) if each.strip()), len(lately)) :]
                lately = []
        if not inside:
            kept.append(line)
        elif BLANK.fullmatch(line.rstrip()):
            lately.append(line)  # what comments the next table stays with it
        else:
            lately = []
    cut = "".join(kept).rstrip() + "\n"
    try:
        if parse_toml(path, cut) == data:
            return cut
    except ProblemError:
        pass
    return tomli_w.dumps(data)


def read_axes(texts: Sequence[str]) -> tuple[tuple[Axis, ...], bool]:
    """The axes of all ``--sweep``, and whether the table of a file is left out; SweepError names what is wrong."""
    axes: list[Axis] = []
    for text in texts:
        if text.strip() == NO_SWEEP:
            continue
        try:
            axis = read_axis(text)
            if any(axis.key == other.key for other in axes):
                raise SweepError(f"{axis.key} is swept twice; give all of its values at once: {axis.key}=A,B,C")
        except SweepError as error:
            raise SweepError(f"--sweep {text!r}: {error}") from None
        axes.append(axis)
    return tuple(axes), any(text.strip() == NO_SWEEP for text in texts)


def read_axis(text: str) -> Axis:
    """``ball.mass=0.2:2:10`` or ``ground.friction=0.2,0.5``."""
    key, equals, values = text.partition("=")
    key, values = key.strip(), values.strip()
    if not key or not equals or not values:
        raise SweepError(
            f"write {OPTION_FORMS}; for instance {OPTION_EXAMPLE}. `--sweep {NO_SWEEP}` leaves out what the file sweeps"
        )
    try:
        if RANGE.fullmatch(values):
            return read_range(key, values)
        items = [item.strip() for item in split(values)]
        if "" in items:
            raise SweepError("has an empty value between its commas")
        return Levels(key, tuple(map(read_value, items)))
    except SweepError as error:
        raise SweepError(f"{key} {error}") from None


def read_range(key: str, text: str) -> Axis:
    """``0.2:2:10``, ``0.2:2:10:log``, ``0.2:2`` or ``0.2:2:log``."""
    parts = [part.strip() for part in text.split(":")]
    spacing: Spacing = "linear"
    found = next((each for each in SPACINGS if parts[-1] == each), None)
    if found:
        spacing = found
        parts.pop()
    if len(parts) not in (2, 3) or not all(re.fullmatch(NUMBER, part) for part in parts[:2]):
        raise SweepError(f"cannot be {text!r}; write {OPTION_FORMS}")
    low, high = (float(part) for part in parts[:2])
    if len(parts) == 2:
        return Interval(key, (low, high), spacing)
    if not re.fullmatch(r"\d{1,9}", parts[2]):
        raise SweepError(
            f"needs a whole number of values behind {low:g}:{high:g}, not {parts[2]!r}; write {OPTION_FORMS}"
        )
    return spaced(key, (low, high), int(parts[2]), spacing)


def split(text: str) -> list[str]:
    """The parts between commas, but for those in quotes, brackets and braces."""
    parts, open_ends, quote = [""], list[str](), ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in CLOSING_BRACKETS:
            open_ends.append(CLOSING_BRACKETS[letter])
        elif open_ends and letter == open_ends[-1]:
            open_ends.pop()
        elif letter == "," and not open_ends:
            parts.append("")
            continue
        parts[-1] += letter
    return parts


def read_samples(text: str) -> Samples:
    """``grid``, ``lhs:64``, ``sobol:64``, and with a seed ``sobol:64:1``; SweepError names what is wrong."""
    word, *numbers = (part.strip() for part in text.split(":"))
    names = (*KINDS, *SHORT_KINDS)
    kind = SHORT_KINDS.get(word) or next((each for each in KINDS if each == word), None)
    try:
        if kind is None:
            raise SweepError(f"there are no samples of the kind {word!r}; {hint(word, names)}")
        if len(numbers) > 2 or not all(re.fullmatch(r"\d{1,9}", number) for number in numbers):
            raise SweepError("write KIND:COUNT or KIND:COUNT:SEED, such as lhs:100 or sobol:64:1")
        return Samples(kind, *map(int, numbers))
    except SweepError as error:
        raise SweepError(f"--samples {text!r}: {error}") from None
