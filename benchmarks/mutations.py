"""Changes that break a text at random places, for benchmarks/mutated_files.py and benchmarks/mutated_robots.py."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence

Change = Callable[[bytes, random.Random], bytes]
"""Returns the text with one change at a random place."""
LONGEST_CUT = 100
"""[bytes] of a piece that is cut out."""
EXTREMES = (
    b"nan", b"inf", b"-inf", b"-1", b"0", b"1e30", b"1e-30", b"1e308", b"1e400", b"999999999", b"-0.0", b"1e8", b"1e15",
    b"99999", b"0x10", b"", b"9" * 400,
)  # fmt: skip
"""What takes the place of a number: no number, none that fits, or one that is extreme."""


def flip(text: bytes, dice: random.Random) -> bytes:
    """Replace one byte."""
    place = dice.randrange(len(text))
    return text[:place] + bytes([dice.randrange(256)]) + text[place + 1 :]


def cut(text: bytes, dice: random.Random) -> bytes:
    """Remove a piece, or the end."""
    place = dice.randrange(len(text))
    return text[:place] + (b"" if dice.random() < 0.3 else text[place + dice.randrange(1, LONGEST_CUT) :])


def replacing(pattern: re.Pattern[bytes], new: Callable[[re.Match[bytes], random.Random], bytes]) -> Change:
    """Return the change that replaces one match of a pattern by ``new``; a text without matches stays as it is."""

    def change(text: bytes, dice: random.Random) -> bytes:
        found = list(pattern.finditer(text))
        if not found:
            return text
        match = dice.choice(found)
        return text[: match.start()] + new(match, dice) + text[match.end() :]

    return change


def mutated(text: bytes, dice: random.Random, changes: Sequence[Change]) -> bytes:
    """Return the text with one to three changes; never empty."""
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        text = dice.choice(changes)(text, dice) or b" "
    return text
