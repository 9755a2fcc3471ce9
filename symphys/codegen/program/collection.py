"""Building without Python's search for cyclic garbage, which would go through millions of objects that all stay."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Suspend the garbage collector for objects that are made meanwhile."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        if not gc.get_freeze_count():  # what was made counts as old: else all of it would be looked through at once
            gc.freeze()
            gc.unfreeze()
        gc.enable()
