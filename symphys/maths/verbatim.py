"""Expressions without simplification: one that spans several functions may round differently from each by itself."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import casadi as ca

_LOCK = Lock()
_OPEN: list[object] = []
"""An entry for each open context of any thread, since the option is global."""


@contextmanager
def verbatim() -> Iterator[None]:
    """Switch off casadi's simplification of operations in the block: (x - y) + y stays so, as between functions."""
    with _LOCK:
        _OPEN.append(None)
        ca.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        with _LOCK:
            _OPEN.pop()
            ca.GlobalOptions.setSimplificationOnTheFly(not _OPEN)
