"""The benchmark of steps, in small."""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.slow


@pytest.mark.slow
def test_every_way_is_measured() -> None:
    pytest.importorskip("torch")
    pytest.importorskip("gymnasium")
    from step_rates import measured

    times = measured("cart_pole", 2, 2)
    assert set(times) == {"kernel", "step", "environment", "adjoint", "torch"} and min(times.values()) > 0
