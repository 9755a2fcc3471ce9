"""Differences between two runs: settings, the problem's text, results, and provenance."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from symphys import json_values as values
from symphys.files import FileError
from symphys.records import dataclass
from symphys.results.file_names import CONFIG, PROBLEM, RESULT
from symphys.results.result import VariableRecord
from symphys.results.text_files import ReportError, read_table, read_words

T = TypeVar("T")
CONFIGURED = ("problem", "solver", "seed", "backend")
FOUND = ("verdict", "status", "objective", "iterations", "equivalents")
VOLATILE = ("pid", "peak_memory")
"""Fields of the provenance that differ from run to run."""
TEXT = "problem.toml"
"""The part whose differences are lines of a unified diff."""
FILES = "files"
"""The part of unreadable files."""
CONTEXT = 3
"""Lines around a change."""


@dataclass(frozen=True)
class Difference:
    """A difference between two runs.

    Attributes:
        part: "asked for", "settings", "options", "problem.toml", "found", "checks", "outputs", "costs", "variables",
            "versions", "provenance" or "files".
        name: in its part; a line of a unified diff in "problem.toml".
        first, second: the values, None where one has none; texts of what could not be read in "files".
    """

    part: str
    name: str
    first: Any = None
    second: Any = None

    def __str__(self) -> str:
        """Write the difference in a line."""
        if self.part == TEXT:
            return self.name
        if self.part == FILES:
            return "; ".join(f"{which} run: {fault}" for which, fault in self.faults if fault)
        change = f" ({self.change:+.3g})" if self.change else ""
        return f"{self.name}: {shown(self.first, self.second)} -> {shown(self.second, self.first)}{change}"

    @property
    def faults(self) -> tuple[tuple[str, Any], ...]:
        """Return what could not be read, by run."""
        return ("first", self.first), ("second", self.second)

    @property
    def change(self) -> float | None:
        """Return the second number less the first; None where they are no numbers, or not finite."""
        pair = self.first, self.second
        if any(isinstance(each, bool) or not isinstance(each, int | float) for each in pair):
            return None
        change = values.number(self.second) - values.number(self.first)
        return change if math.isfinite(change) else None


def differences(first: Path, second: Path) -> list[Difference]:
    """List what differs between two run folders, and the files that only one has or that cannot be read.

    Raises:
        FileError: one is no folder.
    """
    for folder in (first, second):
        if not folder.is_dir():
            raise FileError(f"{folder}: there is no such folder; a run folder is one as reports/ball_throw/cma-seed0")
    found: list[Difference] = []
    configs, results = (read_both(first, second, name, read_table, found) for name in (CONFIG, RESULT))
    texts = read_both(first, second, PROBLEM, read_words, changes := list[Difference]())
    if configs:
        found += compared("asked for", *(chosen(config, CONFIGURED) for config in configs))
        for part in ("settings", "options"):
            found += compared(part, *(flat(config.get(part)) for config in configs))
    if texts:
        names = (f"{first}/{PROBLEM}", f"{second}/{PROBLEM}")
        one, other = (text.splitlines() for text in texts)
        lines = difflib.unified_diff(one, other, *names, lineterm="", n=CONTEXT)
        changes = [Difference(TEXT, line) for line in lines]
    found += changes
    if results:
        found += result_differences(*results)
    return found


def result_differences(*results: Mapping[str, Any]) -> Iterator[Difference]:
    """Yield what differs between two results."""
    yield from compared("found", *(chosen(result, FOUND) for result in results))
    yield from compared("checks", *(errors(result) for result in results))
    for part in ("outputs", "costs"):
        yield from compared(part, *(values.measures(result.get(part)) for result in results))
    yield from variable_differences(*results)
    yield from compared("versions", *(values.table(result.get("versions")) for result in results))
    origins = [values.table(result.get("provenance")) for result in results]
    yield from compared("provenance", *({k: v for k, v in each.items() if k not in VOLATILE} for each in origins))


def read_both(
    first: Path, second: Path, name: str, read: Callable[[Path], T], found: list[Difference]
) -> tuple[T, T] | None:
    """Read a file of both runs; None, and the fault among those found, where one cannot be read."""
    contents, faults = list[T](), list[str | None]()
    for folder in (first, second):
        try:
            contents.append(read(folder / name))
            faults.append(None)
        except ReportError as error:
            faults.append(str(error))
    if len(contents) == 2:
        return contents[0], contents[1]
    found.append(Difference(FILES, name, *faults))
    return None


def compared(part: str, first: Mapping[str, Any], second: Mapping[str, Any]) -> list[Difference]:
    """Return the entries of two tables that are not the same."""
    names = dict.fromkeys([*first, *second])
    return [
        Difference(part, name, first.get(name), second.get(name))
        for name in names
        if not same(first.get(name), second.get(name))
    ]


def same(first: Any, second: Any) -> bool:
    """Whether two values are equal; nan is itself, and true is no 1."""
    both_nan = all(isinstance(each, float) and math.isnan(each) for each in (first, second))
    return both_nan or (first == second and isinstance(first, bool) is isinstance(second, bool))


def chosen(table: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    """Return some entries of a table."""
    return {name: table.get(name) for name in names}


def flat(table: object, before: str = "") -> dict[str, Any]:
    """Return the entries of a table and of those inside by dotted keys."""
    found: dict[str, Any] = {}
    for key, value in values.table(table).items():
        found |= flat(value, f"{before}{key}.") if isinstance(value, dict) else {before + key: value}
    return found


def errors(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return the error of every check by its kind and name."""
    checks = values.tables(result.get("checks"))
    return {f"{check.get('kind', 'check')}: {check.get('name', '')}": check.get("error") for check in checks}


def variable_differences(first: Mapping[str, Any], second: Mapping[str, Any]) -> Iterator[Difference]:
    """Yield the component that differs most of every variable."""
    read = [
        {name: VariableRecord.from_json(entry).value for name, entry in values.table(each.get("z")).items()}
        for each in (first, second)
    ]
    for name in dict.fromkeys([*read[0], *read[1]]):
        one, other = (each.get(name) for each in read)
        if one is None or other is None or one.shape != other.shape:
            sizes = ("none" if each is None else f"{each.size} numbers" for each in (one, other))
            yield Difference("variables", name, *sizes)
        elif not np.array_equal(one, other, equal_nan=True):
            gaps = np.nan_to_num(np.abs(one - other), nan=np.inf)
            gaps[np.isnan(one) & np.isnan(other)] = 0
            component, knot = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
            place = f"[{component}]" + (f" at knot {knot}" if one.shape[1] > 1 else "")
            yield Difference("variables", name + place, float(one[component, knot]), float(other[component, knot]))


def shown(value: Any, other: Any) -> str:
    """Return a value in short, but with all of its digits where the other reads the same in short."""
    if value is None:
        return "-"
    if isinstance(value, float):
        short = f"{value:.6g}"
        return repr(value) if isinstance(other, float) and f"{other:.6g}" == short else short
    return values.name(str(value))
