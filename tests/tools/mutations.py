"""Changes that break files at random places: of any text, of numbers in TOML and JSON, of models in XML."""

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


NUMBER = re.compile(rb'(?<![\w"])-?\d+\.?\d*(?:[eE][-+]?\d+)?')
VALUES = (
    *EXTREMES, b"-1e308", b"1e150", b"1e100", b"1e-308", b"9223372036854775808", b"true", b'"x"', b"[]", b"{}",
    b"[1, 2]", b"[[1e308, -1e308]]", b"1_0", b"1979-05-27", b'"\\u0000"', b"null", b'"1e400"',
)  # fmt: skip
LINE = re.compile(rb"[^\n]*\n")
MEMBER = re.compile(rb'("[^"]*")(:)("[^"]*"|[^",{}]+)')
"""Name, colon and value of a member of a JSON object."""
SPOIL_NUMBER = replacing(NUMBER, lambda _, dice: dice.choice(VALUES))
TEXT_CHANGES = (
    flip,
    cut,
    *[SPOIL_NUMBER] * 3,
    replacing(LINE, lambda match, dice: dice.choice(LINE.findall(match.string))),
    replacing(LINE, lambda *_: b""),
    replacing(LINE, lambda match, _: match[0] * 2),
)
XML_NUMBER = re.compile(rb'(?<=[" ])-?\d+\.?\d*(?:[eE][-+]?\d+)?(?=[" ])')
TAG = re.compile(rb"<[^>]*>")
ATTRIBUTE = re.compile(rb'([\w:]+)="([^"]*)"')
XML_VALUES = (*EXTREMES, b"1,5", b"abc")
EXTRA = (
    b'<include file="/etc/passwd"/>', b'<include file="../../secret.xml"/>', b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"&b;",
    b'<size memory="900T" njmax="999999999"/>', b'<composite type="cable" count="999999 1 1"/>', b"<![CDATA[", b"-->",
    b'<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>', b"<a>" * 300, b"\xff\xfe", b"\x00",
    b'<asset><mesh name="q" file="/dev/zero"/></asset>', b'<worldbody><body><freejoint/></body></worldbody>',
    b'<replicate count="9999999"><body/></replicate>', b'<asset><mesh name="e" vertex="0 0 0 1 1 1"/></asset>',
    b'<compiler meshdir="/etc" eulerseq="abc" angle="no"/>', b'<option timestep="-1" gravity="1 2"/>',
    b'<mimic joint="nothing"/>', b'<limit effort="-1" velocity="nan"/>', b"<inertial/>",
)  # fmt: skip


def with_value(attribute: re.Match[bytes], value: bytes) -> bytes:
    """Return an attribute with another value."""
    return attribute[1] + b'="' + value + b'"'


TEXTUAL = (flip, cut, replacing(TAG, lambda *_: b""), replacing(TAG, lambda match, _: match[0] * 2))
MEANT = (
    replacing(ATTRIBUTE, lambda *_: b""),
    replacing(ATTRIBUTE, lambda match, dice: with_value(match, dice.choice(ATTRIBUTE.findall(match.string))[1])),
    replacing(XML_NUMBER, lambda _, dice: dice.choice(XML_VALUES)),
    replacing(ATTRIBUTE, lambda match, dice: with_value(match, dice.choice(XML_VALUES))),
    replacing(TAG, lambda match, dice: match[0] + dice.choice(EXTRA)),
)
MODEL_CHANGES = (*TEXTUAL, *MEANT, *MEANT)
"""Changes of models; most keep the text well-formed, since well-formed models get further."""
