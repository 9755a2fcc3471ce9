"""Stretches of time in which something holds."""

from __future__ import annotations

import numpy as np

from symphys.trajectory import Mask


def spans(holds: Mask) -> list[tuple[int, int]]:
    """(start, stop) of every run of True in a mask (N,): it holds in the steps from start to stop - 1."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]
