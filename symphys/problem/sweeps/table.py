"""The [sweep] table of a problem file, or tables like it from Python, as a sweep; and a file's text without it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from symphys.errors import ProblemError
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.reading.messages import report
from symphys.problem.reading.source import parse_toml
from symphys.problem.reading.value_texts import shown
from symphys.problem.schema.sweep import RangeTable, SweepTable
from symphys.problem.sweeps.axes import Axis, Interval, Levels, SweepError, spaced
from symphys.problem.sweeps.samples import GRID, Samples
from symphys.problem.sweeps.sweep import Sweep

SWEEP = "sweep"
"""The name of the table."""
FORMS = "a list of values, or a table { from = 0.2, to = 2, count = 10 }"
HEADER = re.compile(r"\s*\[\[?\s*(?P<name>[A-Za-z_\"'][^\]]*?)\s*\]\]?\s*(?:#.*)?")
OWN_HEADER = re.compile(r"([\"']?)sweep\1(?:\s*\..*)?", re.DOTALL)
BLANK = re.compile(r"\s*(?:#.*)?")


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
        faults.add((SWEEP,), f'has no key to sweep; add one, such as "ball.mass" = {FORMS[2:]}')
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
    """One axis; None after a fault."""
    place: Place = (SWEEP, key)
    try:
        if isinstance(value, list):
            return Levels(key, tuple(value))
        if not isinstance(value, dict) or not value:
            raise SweepError(f"must be {FORMS}, not {shown(value)}")
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
