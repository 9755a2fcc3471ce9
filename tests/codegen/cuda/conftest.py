"""Programs on an emulated device and on the processor, each compiled once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from fakes.emulated import Emulated

from symphys.codegen import Cache


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Cache:
    """A cache of the tests' own."""
    return Cache(tmp_path_factory.mktemp("kernels"))


@pytest.fixture
def device(tmp_path: Path) -> Any:
    """A processor that plays the device."""
    return Emulated(tmp_path / "device")
