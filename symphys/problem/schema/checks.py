"""Checks of single values, each with one message that goes to the user as it is."""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Callable, Collection
from itertools import pairwise
from typing import Any, TypeGuard

from pydantic_core import PydanticCustomError

from symphys.expression import CONSTANTS, FUNCTIONS, OVER_TIME
from symphys.problem.reading.messages import shown
from symphys.suggest import quote

RESERVED = frozenset({*FUNCTIONS, *CONSTANTS, *keyword.kwlist, *OVER_TIME, "time", "gravity", "ground", "contact"})
IDENTIFIER = "[A-Za-z][A-Za-z0-9_]*"
MAX_IDENTIFIER = 64
MAX_LABEL = 100
STAGES = "[0.1, 0.01, 0]"
LEAST_POINTS, MOST_POINTS = 4, 2000
"""Points whose hull is a shape."""
MIN_GRID_SIDE = 2
MAX_HEIGHTS = 1024
"""Each height of a terrain is in every contact with it, in every step."""


def fault(message: str) -> PydanticCustomError:
    """An error whose message goes to the user as it is."""
    return PydanticCustomError("symphys", "{message}", {"message": message})


def is_number(value: object, bound: bool = False) -> TypeGuard[int | float]:
    """Tell whether the value is a finite number; ``bound`` allows infinities."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        number = float(value)
    except OverflowError:
        return False
    return not math.isnan(number) if bound else math.isfinite(number)


def nonzero(value: object) -> float:
    """Return the value if it is a finite number but 0."""
    if not is_number(value) or value == 0:
        raise fault(f"must be a number but 0, not {shown(value)}")
    return float(value)


def identifier(value: object) -> str:
    """A name that formulas can use."""
    if not isinstance(value, str) or not re.fullmatch(IDENTIFIER, value) or len(value) > MAX_IDENTIFIER:
        shown = quote(value) if isinstance(value, str) else "this"
        words = re.findall(r"[A-Za-z0-9_]+", value) if isinstance(value, str) else []
        fitting = "_".join(words)[:MAX_IDENTIFIER]
        instead = f'; for instance "{fitting}"' if re.fullmatch(IDENTIFIER, fitting) else ""
        rule = f"letters, digits and _, a letter first, at most {MAX_IDENTIFIER}, since formulas use it"
        raise fault(f"{shown} is no name: {rule}{instead}")
    if value in RESERVED:
        raise fault(f"{quote(value)} already has a meaning in formulas; choose another name")
    return value


def prefix(value: object) -> str:
    """Return the longest start that is a valid name; empty if there is none."""
    return "" if value == "" else identifier(value)


def label(value: object) -> str:
    """A name for people: one line of text."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable() or len(value) > MAX_LABEL:
        raise fault(f"must be a name: one line of text, at most {MAX_LABEL} characters")
    return value


def vector(count: int) -> Callable[[object], list[float]]:
    """A list of ``count`` finite numbers."""

    def check(value: object) -> list[float]:
        if not isinstance(value, list) or len(value) != count:
            raise fault(f"must be a list of {count} numbers, not {shown(value)}")
        for item in value:
            if not is_number(item):
                raise fault(f"must be a list of {count} finite numbers; one is {shown(item)}")
        return [float(item) for item in value]

    return check


def friction(value: object) -> float | tuple[float, float]:
    """Check Coulomb's coefficient, or two: along a direction and across it."""
    numbers: list[Any] = value if isinstance(value, list) and len(value) == 2 else [value]
    if not all(is_number(number) and number >= 0 for number in numbers):
        raise fault(f"must be a number of at least 0, or two: [along, across] friction_direction, not {shown(value)}")
    found = [float(number) for number in numbers]
    return (found[0], found[1]) if len(found) == 2 else found[0]


def direction(value: object) -> tuple[float, ...]:
    """Check three numbers that are not all 0."""
    numbers = vector(3)(value)
    if not any(numbers):
        raise fault("must not be zero; [1, 0, 0] is along x")
    return tuple(numbers)


def ends(value: object) -> list[float]:
    """A lower and an upper bound; either may be infinite."""
    if not isinstance(value, list) or len(value) != 2:
        raise fault(f"must be two numbers, [lower, upper], not {shown(value)}")
    for item in value:
        if not is_number(item, bound=True):
            raise fault(f"must be two numbers, [lower, upper]; one is {shown(item)}; -inf or inf is no bound")
    low, high = (float(item) for item in value)
    if low == math.inf or high == -math.inf or low > high:
        raise fault(f"the lower end, {low:g}, must not be above the upper, {high:g}; [-inf, inf] is no bound at all")
    return [low, high]


def coordinates(value: object) -> list[float]:
    """A finite number, or one for each coordinate of a joint; a list comes out."""
    numbers: list[Any] = value if isinstance(value, list) else [value]
    if not numbers or not all(is_number(number) for number in numbers):
        raise fault(f"must be a number, or a list with one for each coordinate, not {shown(value)}")
    return [float(number) for number in numbers]


def positive(count: int) -> Callable[[object], list[float]]:
    """A list of ``count`` positive finite numbers."""

    def check(value: object) -> list[float]:
        numbers = vector(count)(value)
        for number in numbers:
            if number <= 0:
                raise fault(f"must be {count} numbers greater than 0; one is {shown(number)}")
        return numbers

    return check


def positive_number(reason: str) -> Callable[[object], float]:
    """A positive finite number; ``reason`` goes into the message."""

    def check(value: object) -> float:
        if not is_number(value) or value <= 0:
            raise fault(f"must be a number greater than 0, not {shown(value)}; {reason}")
        return float(value)

    return check


def spacing(value: object) -> list[float]:
    """A positive number or two of them; always two come out."""
    if not isinstance(value, list):
        if not is_number(value) or value <= 0:
            raise fault(f"must be a number greater than 0, or two: [along x, along y], not {shown(value)}")
        value = [value, value]
    return positive(2)(value)


def grid(value: object) -> list[list[float]]:
    """Rows of heights, equally long, not too many."""
    rows: list[Any] = value if isinstance(value, list) else []
    if not rows or not all(isinstance(row, list) for row in rows):
        raise fault("must be a list of rows along y, each a list of heights along x [m]")
    uneven = next((k for k, row in enumerate(rows) if len(row) != len(rows[0])), None)
    if uneven is not None:
        raise fault(f"row {uneven} has {len(rows[uneven])} heights, row 0 has {len(rows[0])}; rows are equally long")
    if min(len(rows), len(rows[0])) < MIN_GRID_SIDE:
        raise fault(f"has {len(rows)} rows of {len(rows[0])}; {MIN_GRID_SIDE} or more rows and columns are needed")
    count = len(rows) * len(rows[0])
    if count > MAX_HEIGHTS:
        remedy = "take a coarser grid, or give height as a formula of x and y"
        raise fault(f"has {count} heights ({len(rows)} x {len(rows[0])}), at most {MAX_HEIGHTS} are allowed; {remedy}")
    for k, row in enumerate(rows):
        for item in row:
            if not is_number(item):
                raise fault(f"must hold finite numbers; one in row {k} is {shown(item)}")
    return [[float(item) for item in row] for row in rows]


def points(value: object) -> list[list[float]]:
    """Points [x, y, z], some and not too many."""
    rows: list[Any] = value if isinstance(value, list) else []
    if not rows or not all(isinstance(row, list) for row in rows):
        raise fault("must be a list of points, each a list [x, y, z] [m]")
    if not LEAST_POINTS <= len(rows) <= MOST_POINTS:
        wanted = f"give {LEAST_POINTS} to {MOST_POINTS}"
        raise fault(f"has {len(rows)} points; {wanted}, of which only those on the hull count")
    for k, row in enumerate(rows):
        if len(row) != 3 or not all(is_number(item) for item in row):
            raise fault(f"point {k} must be three finite numbers [x, y, z], not {shown(row)}")
    return [[float(item) for item in row] for row in rows]


def nested(bound: bool) -> Callable[[object], Any]:
    """A number, a list of numbers, or a list of lists of numbers; ``bound`` lets infinities through."""
    kind = "numbers" if bound else "finite numbers"

    def check(value: object) -> Any:
        rows = value if isinstance(value, list) else [value]
        flat = [item for row in rows for item in (row if isinstance(row, list) else [row])]
        mixed = len({isinstance(row, list) for row in rows}) > 1
        if not flat or mixed or not all(is_number(item, bound) for item in flat):
            raise fault(f"must be a number, a list with one number per component, or one such list per knot ({kind})")
        return value

    return check


def smoothing(value: object) -> list[float]:
    """The stages of the smoothing, from large to small; a number is one stage."""
    stages: list[float] = []
    for stage in value if isinstance(value, list) else [value]:
        if not is_number(stage):
            raise fault(f"must be a number, or a list of stages such as {STAGES}, not {shown(stage)}")
        if stage < 0:
            raise fault(f"must be at least 0, not {shown(stage)}")
        if stages and stage >= stages[-1]:
            raise fault(f"stages must decrease, as in {STAGES}: {shown(stage)} comes after {stages[-1]:g}")
        stages.append(float(stage))
    if not stages:
        raise fault(f"a list of stages needs at least one, as in {STAGES}")
    return stages


OF_PHASE = "(end|start) of (.+)"
"""An instant by the name of a phase."""


def moment(value: object) -> str | float:
    """``end``, ``always``, a time, or ``end of`` a phase."""
    if is_number(value):
        return float(value)
    if isinstance(value, str) and (value in ("end", "always") or re.fullmatch(OF_PHASE, value)):
        return value
    raise fault('must be "end", "always" or a time in seconds, or "end of" a phase')


def instant(value: object) -> str | float:
    """``end``, a time, or ``end of`` a phase."""
    if is_number(value):
        return float(value)
    if isinstance(value, str) and (value == "end" or re.fullmatch(OF_PHASE, value)):
        return value
    advice = '; for "always" use a [[constraint]] or a [[cost]]' if value == "always" else ""
    raise fault(f'must be "end" or a time in seconds, or "end of" a phase{advice}')


def inertia(value: object) -> Any:
    """A number, three numbers or a 3 x 3 matrix."""
    rows: list[Any] = value if isinstance(value, list) else [value]
    matrix = len(rows) == 3 and all(isinstance(row, list) and len(row) == 3 for row in rows)
    flat = [item for row in rows for item in row] if matrix else rows
    if not (matrix or not isinstance(value, list) or len(rows) == 3) or not all(is_number(item) for item in flat):
        raise fault("must be a number, three principal moments or a 3 x 3 matrix (three lists of three), in kg m^2")
    return value


def texts(value: object) -> list[str]:
    """One text or a list of texts."""
    items = value if isinstance(value, list) else [value]
    if not items or not all(isinstance(item, str) for item in items):
        raise fault('must be a text or a list of texts, for instance "ball.velocity" or ["ball.force[0:2]"]')
    return list(items)


def cells(value: object) -> list[Any]:
    """A column of numbers, or of rows of numbers; NaN is a missing one."""
    rows: list[Any] = value if isinstance(value, list) else []
    width = len(rows[0]) if rows and isinstance(rows[0], list) else 0
    flat = [item for row in rows for item in row] if width else rows
    uneven = width and any(len(row) != width for row in rows if isinstance(row, list))
    if not flat or uneven or not all(is_cell(item) for item in flat):
        raise fault("must be a list of numbers, or of rows with equally many; nan where one is missing")
    return [[float(item) for item in row] for row in rows] if width else [float(item) for item in rows]


def is_cell(value: object) -> bool:
    """Whether the value is a finite number or NaN."""
    return is_number(value) or (isinstance(value, float) and math.isnan(value))


def positive_numbers(value: object) -> list[float]:
    """A positive number, or a list of them; a list comes out."""
    numbers: list[Any] = value if isinstance(value, list) else [value]
    if not numbers or not all(is_number(number) and number > 0 for number in numbers):
        raise fault(f"must be a number greater than 0, or a list with one for each component, not {shown(value)}")
    return [float(number) for number in numbers]


def rising_to_one(value: object) -> list[float]:
    """Shares above 0 that rise to 1."""
    if isinstance(value, list) and value and all(map(is_number, value)):
        shares = [float(share) for share in value]
        if shares[-1] == 1 and all(0 < a < b for a, b in pairwise([*shares, 2.0])):
            return shares
    raise fault(f"must be a list of shares above 0 that rise to 1, such as [0.3, 0.6, 1], not {shown(value)}")


def held_back(value: object) -> bool | float | list[int | str]:
    """True or false, a share, or a list of numbers and names."""
    if isinstance(value, bool):
        return value
    if is_number(value) and 0 <= value <= 1:
        return float(value)
    if isinstance(value, list) and value and all(isinstance(item, str) or is_index(item) for item in value):
        return list(value)
    raise fault(f"must be true, a share from 0 to 1, or a list of numbers from 0 or names, not {shown(value)}")


def is_index(value: object) -> bool:
    """Whether the value is a whole number of at least 0."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def prior(value: object) -> list[list[float]]:
    """A mean and a positive standard deviation, each a number or a list of numbers; lists come out."""
    if not isinstance(value, list) or len(value) != 2:
        raise fault(f"must be [mean, standard deviation], each a number or a list of numbers, not {shown(value)}")
    return [coordinates(value[0]), positive_numbers(value[1])]


def one_of(valid: Collection[str]) -> Callable[[object], str]:
    """One of some texts."""

    def check(value: object) -> str:
        if not isinstance(value, str) or value not in valid:
            raise fault(f"must be one of {', '.join(map(quote, valid))}, not {shown(value)}")
        return value

    return check
