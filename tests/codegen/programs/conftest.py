"""Kernels of the toy programs, compiled once for all tests, in a cache of their own."""

from __future__ import annotations

from pathlib import Path

import pytest
from worlds import programs

from symphys.codegen import Cache, Kernel, compile_program


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Cache:
    return Cache(Path(tmp_path_factory.mktemp("kernels")))


def build(name: str, cache: Cache) -> Kernel:
    return compile_program(getattr(programs, name)(), cache=cache, threads=1)


@pytest.fixture(scope="session")
def pendulum(cache: Cache) -> Kernel:
    return build("pendulum", cache)


@pytest.fixture(scope="session")
def chain(cache: Cache) -> Kernel:
    return build("chain", cache)


@pytest.fixture(params=["pendulum", "chain"])
def kernel(request: pytest.FixtureRequest) -> Kernel:
    found = request.getfixturevalue(request.param)
    assert isinstance(found, Kernel)
    return found
