"""Compiled kernels of all tests go into a cache of the checkout; what is slow runs only when asked for.

Modules become bytecode, also where $PYTHONDONTWRITEBYTECODE is set, as in containers: else hundreds of processes of the
tests would each compile the package from its sources, a third of a second.

Ctrl-C reaches tests that send it themselves also where the shell ignores it, as with ``nohup make test &``.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

os.environ.setdefault("SYMPHYS_CACHE", str(Path(__file__).parents[1] / "build" / "kernels"))
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is marked ``slow`` or ``thorough``, unless the option -m names it; thorough tests may be slow."""
    asked = config.option.markexpr
    marks = [] if "thorough" in asked else ["thorough"] if "slow" in asked else ["slow", "thorough"]
    left_out = [item for item in items if any(map(item.get_closest_marker, marks))]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in set(left_out)]
