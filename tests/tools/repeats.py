"""Values that show one law: the first of them in every run of the tests, the others with ``make thorough``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def thorough(*values: Any) -> Any:
    """One case of a parametrised test, for ``make thorough`` alone."""
    return pytest.param(*values, marks=pytest.mark.thorough)


def first(name: str, values: Iterable[Any]) -> pytest.MarkDecorator:
    """``parametrize`` by one argument: its first value in every run, the others with ``make thorough``."""
    head, *others = values
    return pytest.mark.parametrize(name, [head, *map(thorough, others)])
