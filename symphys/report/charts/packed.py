"""Data and scripts of a page, compressed: base64 of a zlib stream, which ``unpack.js`` unpacks in the browser."""

from __future__ import annotations

import base64
import json
import zlib

LEVEL = 9


def pack(text: str) -> str:
    """The compressed text, in letters that need no escape in HTML."""
    return base64.b64encode(zlib.compress(text.encode(), LEVEL)).decode("ascii")


def unpack(text: str) -> str:
    """The inverse of ``pack``."""
    return zlib.decompress(base64.b64decode(text)).decode()


def pack_json(value: object) -> str:
    """A value of strict JSON, compressed."""
    return pack(json.dumps(value, separators=(",", ":"), allow_nan=False, ensure_ascii=False))
