"""Values that show one law: the first of them in every run of the tests, the others when asked for."""

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


def few(names: str | tuple[str, ...], values: Iterable[Any], count: int, **options: Any) -> pytest.MarkDecorator:
    """``parametrize``: the first ``count`` values in every run, the others with ``make test-all``."""
    single, listed = isinstance(names, str) and "," not in names, list(values)
    later = [
        value if hasattr(value, "marks") else pytest.param(*([value] if single else value)) for value in listed[count:]
    ]
    slow = [pytest.param(*each.values, marks=[*each.marks, pytest.mark.slow], id=each.id) for each in later]
    return pytest.mark.parametrize(names, [*listed[:count], *slow], **options)
