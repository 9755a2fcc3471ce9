"""Rooms that are verbs as well: ``symphys.report(folder)`` makes reports, ``symphys.report`` holds what makes them.

Commands have the names of rooms. Python binds a room's name in ``symphys`` whenever it is imported, so a function of
that name beside it would be lost; the room itself can be called instead.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any


def make_callable(room: str, call: Callable[..., Any]) -> None:
    """Let ``room(...)`` be ``call(...)``.

    Args:
        room: name of a module that is imported, or is just being imported.
        call: keeps its signature and its documentation, which ``help(room.__call__)`` shows.
    """
    module: Any = sys.modules[room]
    module.__class__ = type("CallableRoom", (ModuleType,), {"__call__": staticmethod(call), "__doc__": module.__doc__})
