"""What the text of a problem keeps of the files of recordings: small ones whole, of others place and digest."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

from symphys.problem.recordings.types import RecordedFile

HEADING = "\n[[recorded]]\n"
PLACES = re.compile(r'^path = ".*"\n(?=sha256 = "[0-9a-f]{64}"$)', re.MULTILINE)


def plain_text(content: bytes) -> str | None:
    """The text of a file, if a problem's text can keep it."""
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        return None
    return text if all(letter.isprintable() or letter in "\n\t" for letter in text) else None


def recorded_appendix(files: Iterable[RecordedFile]) -> str:
    """Return what a problem's text needs elsewhere: the content of small files, the paths of others."""
    parts = []
    for each in files:
        place = "" if each.text is not None else f"path = {quoted(each.path)}\n"
        text = "" if each.text is None else f"text = {quoted(each.text)}\n"
        parts.append(f'{HEADING}file = {quoted(each.file)}\n{place}sha256 = "{each.sha256}"\n{text}')
    return "".join(parts)


def without_places(text: str) -> str:
    """A problem's text without the places of recorded files: digests say what is in them."""
    return PLACES.sub("", text) if HEADING in text else text


def quoted(text: str) -> str:
    """A TOML string."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
