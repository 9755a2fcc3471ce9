"""Linear algebra takes one thread while Python solves, and as many as before afterwards."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import symphys
from symphys import threads


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[threads.OpenBlas]]:
    """The libraries, asked to take two threads."""
    for name in threads.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    libraries = threads.libraries()
    if not libraries:
        pytest.skip("numpy and scipy are built without OpenBLAS")
    before = [each.get() for each in libraries]
    for each in libraries:
        each.set(2)
    if any(each.get() != 2 for each in libraries):
        pytest.skip("OpenBLAS takes one thread only here")
    yield libraries
    for each, count in zip(libraries, before, strict=True):
        each.set(count)


def test_solving_takes_one_thread(two: list[threads.OpenBlas]) -> None:
    seen: list[int] = []
    symphys.solve(
        "ball_throw", "least_squares", backend="casadi", iterations=1,
        progress=lambda row: seen.extend(each.get() for each in two),
    )  # fmt: skip
    assert seen and set(seen) == {1}
    assert {each.get() for each in two} == {2}


def test_the_environment_decides(two: list[threads.OpenBlas], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    with threads.limited():
        assert {each.get() for each in two} == {2}
