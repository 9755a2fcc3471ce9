"""Sites: named points with axes on bodies, where formulas look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Site:
    """A point with axes that is fixed in a body, or in the world.

    Attributes:
        name: formulas name ``<site>.position`` (3,) [m], ``.orientation`` (4,) and ``.velocity`` (3,) [m/s].
        body: its index; None: the world.
        position: (3,) from the centre of mass, body frame [m]; of the world: world frame.
        orientation: (4,) unit quaternion w x y z from the site's axes to the body's, or the world's.
    """

    name: str
    body: int | None
    position: Sequence[Any] = (0.0, 0.0, 0.0)
    orientation: Sequence[Any] = (1.0, 0.0, 0.0, 0.0)
