"""Compiled kernels of all tests go into a cache of the checkout; what is slow runs only when asked for.

Modules become bytecode, also where $PYTHONDONTWRITEBYTECODE is set, as in containers: else hundreds of processes of the
tests would each compile the package from its sources, a third of a second.

They are compiled by gcc's -Og, which takes 0.6 of the time of -O2; tests/codegen/programs/test_levels.py compares the
bits of both.

Kernels are waited for, since workers of tests leave compilers in the background no processor; tests of what evaluates
until a kernel is there take $SYMPHYS_WAIT away.

Ctrl-C reaches tests that send it themselves also where the shell ignores it, as with ``nohup make test &``.

On a machine without a C compiler a test that finds none is skipped, with that as the reason.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("SYMPHYS_CACHE", str(Path(__file__).parents[1] / "build" / "kernels"))
os.environ.setdefault("SYMPHYS_WAIT", "1")
os.environ.setdefault("SYMPHYS_CFLAGS", "-Og")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
signal.signal(signal.SIGINT, signal.default_int_handler)
COMPILERS = "CC" in os.environ or any(map(shutil.which, ("gcc", "clang", "cc"))) or bool(find_spec("ziglang"))
"""Whether this machine has one, whatever a test makes of its environment."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is marked ``slow`` or ``thorough``, unless the option -m names it; thorough tests may be slow."""
    asked = config.option.markexpr
    marks = [] if "thorough" in asked else ["thorough"] if "slow" in asked else ["slow", "thorough"]
    left_out = [item for item in items if any(map(item.get_closest_marker, marks))]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if not any(map(item.get_closest_marker, marks))]


@contextmanager
def skipping_without_compilers() -> Iterator[None]:
    """Skip a test that needs a C compiler where the machine has none."""
    try:
        yield
    except Exception as error:
        if type(error).__name__ == "KernelUnavailable" and not COMPILERS:
            pytest.skip(str(error))
        raise


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Any:
    """Make the fixtures of a test."""
    with skipping_without_compilers():
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Any:
    """Run a test."""
    with skipping_without_compilers():
        return (yield)
