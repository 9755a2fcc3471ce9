"""Selection of rows of the table: conditions, order, and the best rows."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.results.table.columns import UNFINISHED, UNREADABLE, Row, columns, find_column
from symphys.suggest import quote

OPERATORS: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "!=": operator.ne,
    "==": operator.eq,
    "=": operator.eq,
    "<": operator.lt,
    ">": operator.gt,
}
SPLIT = re.compile(r"<=|>=|!=|==|=|<|>")
EQUALITY = (operator.eq, operator.ne)
TRUTHS = {"true": True, "yes": True, "false": False, "no": False}


class BadCondition(SymphysError):
    """Raised for an unreadable condition; says how one is written."""


@dataclass(frozen=True)
class Condition:
    """A column compared with a value, as in ``objective<0.5`` or ``solver=cma``.

    Attributes:
        column: its name.
        sign: one of OPERATORS.
        text: the value as it was written; a number where the column has one, else a text, in which ``*`` stands for
            anything where it is compared by ``=`` or ``!=``.
    """

    column: str
    sign: str
    text: str

    def holds(self, row: Row) -> bool:
        """Whether a row meets the condition; an unknown value only equals an empty text."""
        value, compare = row.get(self.column), OPERATORS[self.sign]
        if isinstance(value, bool):
            return compare in EQUALITY and compare(value, TRUTHS.get(self.text.lower()))
        if isinstance(value, int | float):
            asked = number(self.text)
            return self.sign == "!=" if asked is None else compare(value, asked)
        known = value or ""
        if compare in EQUALITY:
            return fnmatchcase(known, self.text.replace("[", "[[]")) is (compare is operator.eq)
        return bool(known) and compare(known, self.text)


def read_condition(text: str, known: Sequence[str]) -> Condition:
    """Read the condition in a text, such as ``objective<0.5``.

    Raises:
        BadCondition: no comparison.
        UnknownColumn: no such column.
    """
    parts = SPLIT.search(text)
    if parts is None or not text[: parts.start()].strip():
        raise BadCondition(
            f"{quote(text)} is no condition; write KEY, one of {' '.join(OPERATORS)}, and a value: objective<0.5"
        )
    column = find_column(text[: parts.start()], known)
    return Condition(column, parts.group(), text[parts.end() :].strip())


def number(text: str) -> float | None:
    """Return the number in a text; None for none."""
    try:
        return float(text)
    except ValueError:
        return None


def chosen(rows: Iterable[Row], conditions: Iterable[str]) -> list[Row]:
    """Return the rows that meet all conditions; see ``Condition``.

    Raises:
        BadCondition, UnknownColumn: see ``read_condition``.
    """
    rows = list(rows)
    texts = list(conditions)
    known = columns(rows) if texts else []
    asked = [read_condition(text, known) for text in texts]
    return [row for row in rows if all(condition.holds(row) for condition in asked)]


def ordered(rows: Iterable[Row], key: str) -> list[Row]:
    """Return the rows by a column, ``-`` before its name for the largest first; those that do not have it come last.

    Several columns are separated by commas, the one that counts most first: ``case,-objective``.

    Raises:
        UnknownColumn: no such column.
    """
    found = list(rows)
    for name, falling in reversed([sorting(each, columns(found)) for each in key.split(",")]):
        having = [row for row in found if row.get(name) is not None]
        lacking = [row for row in found if row.get(name) is None]
        having.sort(key=partial(ranked, name), reverse=falling)
        found = having + lacking
    return found


def sorting(key: str, known: Sequence[str]) -> tuple[str, bool]:
    """Return the column that a key names, and whether its largest value comes first."""
    key = key.strip()
    return find_column(key.removeprefix("-"), known), key.startswith("-")


def ranked(column: str, row: Row) -> tuple[bool, Any]:
    """Return the key by which rows are sorted that have a column."""
    return rank(row[column])


def rank(value: Any) -> tuple[bool, Any]:
    """Return a sort key with numbers before texts: a setting may be either."""
    return isinstance(value, str), value


def best(rows: Iterable[Row], by: str = "objective", overall: bool = False) -> list[Row]:
    """Return the best run of each case, or of all: by its verdict, then by a column, then by its cost in rollouts.

    Args:
        rows: of runs; those without a result are left out.
        by: a column whose least value is best, with ``-`` before it the largest. One with an equal verdict that does
            not have it comes last.
        overall: whether to take one of all.

    Raises:
        UnknownColumn: no such column.
    """
    from symphys.results.discovery import RANKS  # late: the other choices need none of that

    rows = list(rows)
    column, falling = sorting(by, columns(rows))

    def merit(row: Row) -> tuple[Any, ...]:
        value, work = row.get(column), row.get("equivalents", float("inf"))
        if falling and isinstance(value, int | float):
            value = -value
        return RANKS.get(row["verdict"], len(RANKS)), value is None, rank(0 if value is None else value), work

    found: dict[str, Row] = {}
    for row in rows:
        if row["verdict"] in (UNFINISHED, UNREADABLE):
            continue
        case = "" if overall else row["case"]
        if case not in found or merit(row) < merit(found[case]):
            found[case] = row
    return list(found.values())
