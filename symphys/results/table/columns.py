"""The columns of the table of runs: names, order, and the names that users may give."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

from symphys.errors import SymphysError
from symphys.suggest import hint, quote

Row = dict[str, Any]
"""A run by column: texts, numbers and booleans; no entry where nothing is known."""

OUTPUT, COST, SETTING = "output: ", "cost: ", "set: "
"""Prefixes of the names of outputs and costs, and of settings whose key has no table."""
UNFINISHED, UNREADABLE = "unfinished", "unreadable"
"""Verdicts of folders without a result that can be read."""
ASKED = ("run", "problem", "case", "solver", "seed")
FOUND = ("verdict", "status", "solved", "objective", "worst")
SPENT = ("iterations", "equivalents", "solve_seconds", "compile_seconds", "build_seconds", "peak_memory")
ORIGIN = ("backend", "host", "when", "why", "fault")
FIXED = (*ASKED, *FOUND, *SPENT, *ORIGIN)
"""Columns that every table has; settings come after ASKED, outputs and costs after FOUND."""
NUMBERS = frozenset(("seed", "objective", "worst", *SPENT))
"""Columns of FIXED that hold numbers."""
MAX_EXACT_INTEGER = 2**53
"""Bound of integers that are doubles, too; a column holds no larger ones as integers."""
UNITS = {"solve_seconds": "s", "compile_seconds": "s", "build_seconds": "s", "peak_memory": "bytes"}
"""Units of columns; the names of outputs contain theirs."""
UNIT = re.compile(r" \[[^\]]*\]$")


class UnknownColumn(SymphysError):
    """Raised for an unknown column; lists the known ones."""


def setting_column(key: str) -> str:
    """Return the column of a setting: its key, ``ground.friction``."""
    return key if "." in key and not key.startswith((OUTPUT, COST)) else SETTING + key


def numeric(column: str) -> bool:
    """Whether a column holds numbers, whatever the problem."""
    return column in NUMBERS or column.startswith((OUTPUT, COST))


def columns(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the names of all columns of the rows, in the order of the table; those in FIXED always."""
    others = set(chain.from_iterable(rows)) - set(FIXED)
    outputs = sorted(name for name in others if name.startswith(OUTPUT))
    costs = sorted(name for name in others if name.startswith(COST))
    settings = sorted(others - set(outputs) - set(costs))
    return [*ASKED, *settings, *FOUND, *outputs, *costs, *SPENT, *ORIGIN]


def find_column(name: str, known: Sequence[str]) -> str:
    """Return the column that a user means: by its name, or by that of an output or a cost without prefix and unit.

    Raises:
        UnknownColumn: none or several have that name.
    """
    name = name.strip()
    if name in known:
        return name
    short = [column for column in known if name in short_names(column)]
    if len(short) == 1:
        return short[0]
    if short:
        raise UnknownColumn(f"several columns are called {quote(name)}: {', '.join(map(quote, short))}")
    raise UnknownColumn(f"no run has a column {quote(name)}; {hint(name, known)}")


def short_names(column: str) -> set[str]:
    """Return other names of a column: ``speed [m/s]`` or ``speed`` for ``output: speed [m/s]``."""
    for prefix in (OUTPUT, COST, SETTING):
        if column.startswith(prefix):
            bare = column.removeprefix(prefix)
            return {bare, UNIT.sub("", bare), UNIT.sub("", column)}
    return set()
