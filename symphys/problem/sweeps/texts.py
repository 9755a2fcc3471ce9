"""What ``--sweep`` and ``--samples`` say, as axes and samples."""

from __future__ import annotations

import re
from collections.abc import Sequence

from symphys.problem.reading.value_texts import read_value
from symphys.problem.sweeps.axes import SPACINGS, Axis, Interval, Levels, Spacing, SweepError, spaced
from symphys.problem.sweeps.samples import KINDS, Kind, Samples
from symphys.suggest import hint

NONE = "none"
"""What ``--sweep`` takes to leave the [sweep] table of a file out."""
FORMS = "KEY=FROM:TO:COUNT, KEY=FROM:TO:COUNT:log, KEY=FROM:TO for samples, or KEY=A,B,C"
EXAMPLE = "ball.mass=0.2:2:10"
NUMBER = r"[-+]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
RANGE = re.compile(rf"\s*{NUMBER}\s*:.*", re.DOTALL)
SHORT: dict[str, Kind] = {"lhs": "latin hypercube", "latin-hypercube": "latin hypercube"}
CLOSED_BY = {"[": "]", "{": "}"}


def read_axes(texts: Sequence[str]) -> tuple[tuple[Axis, ...], bool]:
    """The axes of all ``--sweep``, and whether the table of a file is left out; SweepError names what is wrong."""
    axes: list[Axis] = []
    for text in texts:
        if text.strip() == NONE:
            continue
        try:
            axis = read_axis(text)
            if any(axis.key == other.key for other in axes):
                raise SweepError(f"{axis.key} is swept twice; give all of its values at once: {axis.key}=A,B,C")
        except SweepError as error:
            raise SweepError(f"--sweep {text!r}: {error}") from None
        axes.append(axis)
    return tuple(axes), any(text.strip() == NONE for text in texts)


def read_axis(text: str) -> Axis:
    """``ball.mass=0.2:2:10`` or ``ground.friction=0.2,0.5``."""
    key, equals, values = text.partition("=")
    key, values = key.strip(), values.strip()
    if not key or not equals or not values:
        raise SweepError(f"write {FORMS}; for instance {EXAMPLE}. `--sweep {NONE}` leaves out what the file sweeps")
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
        raise SweepError(f"cannot be {text!r}; write {FORMS}")
    low, high = (float(part) for part in parts[:2])
    if len(parts) == 2:
        return Interval(key, (low, high), spacing)
    if not re.fullmatch(r"\d{1,9}", parts[2]):
        raise SweepError(f"needs a whole number of values behind {low:g}:{high:g}, not {parts[2]!r}; write {FORMS}")
    return spaced(key, (low, high), int(parts[2]), spacing)


def split(text: str) -> list[str]:
    """The parts between commas, but for those in quotes, brackets and braces."""
    parts, open_ends, quote = [""], list[str](), ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in CLOSED_BY:
            open_ends.append(CLOSED_BY[letter])
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
    names = (*KINDS, *SHORT)
    kind = SHORT.get(word) or next((each for each in KINDS if each == word), None)
    try:
        if kind is None:
            raise SweepError(f"there are no samples of the kind {word!r}; {hint(word, names)}")
        if len(numbers) > 2 or not all(re.fullmatch(r"\d{1,9}", number) for number in numbers):
            raise SweepError("write KIND:COUNT or KIND:COUNT:SEED, such as lhs:100 or sobol:64:1")
        return Samples(kind, *map(int, numbers))
    except SweepError as error:
        raise SweepError(f"--samples {text!r}: {error}") from None
