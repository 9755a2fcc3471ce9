"""Expressions as they are written: what casadi simplifies between functions may round otherwise than each by itself."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import casadi as ca

_LOCK = Lock()
_OPEN: list[object] = []
"""One for each context that is open, in any thread: the option is one for all."""


@contextmanager
def verbatim() -> Iterator[None]:
    """Within, no operation is simplified as it is made: (x - y) + y is not x, as it is not from call to call."""
    with _LOCK:
        _OPEN.append(None)
        ca.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        with _LOCK:
            _OPEN.pop()
            ca.GlobalOptions.setSimplificationOnTheFly(not _OPEN)
