"""Convex hulls of meshes, thinned to a few vertices."""

from __future__ import annotations

import numpy as np

from symphys.types import Array

FLAT = 1e-9
"""Share of a mesh's length below which it has no volume."""


def hull_points(vertices: Array, most: int) -> tuple[Array, float]:
    """The vertices of the convex hull, at most so many, and how far one that was left out is from those [mm].

    The farthest point from all that are kept comes next, so that what is left out is near to what is kept.

    Args:
        vertices: (n, 3) [m].
        most: how many to keep at most.

    Raises:
        ValueError: for a mesh that is flat, or has no four points.
    """
    from scipy.spatial import ConvexHull, QhullError

    spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(vertices) < 4 or spread[2] <= FLAT * spread[0]:
        raise ValueError("it is flat, so that it has no volume")
    try:
        corners = vertices[ConvexHull(vertices).vertices]
    except QhullError:
        raise ValueError("it has no convex hull with a volume") from None
    if len(corners) <= most:
        return corners, 0.0
    kept = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    distances = np.linalg.norm(corners - corners[kept[0]], axis=1)
    while len(kept) < most:
        kept.append(int(np.argmax(distances)))
        distances = np.minimum(distances, np.linalg.norm(corners - corners[kept[-1]], axis=1))
    thinned = corners[sorted(kept)]
    outside = ConvexHull(thinned).equations
    lost = np.max(corners @ outside[:, :3].T + outside[:, 3], axis=1)
    return thinned, float(1000 * max(lost.max(), 0.0))
