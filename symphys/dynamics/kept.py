"""A cache of functions of worlds that are equal but for the meaning of their symbols.

Building a step takes a tenth of a second for a ball and several for a robot, as long as many a solve.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

import casadi as ca

from symphys.dynamics.tracing.pytree import flatten
from symphys.latest import Latest
from symphys.model.world import Scheme, World

T = TypeVar("T")
KEPT = Latest[Any](6)


def structure(world: World, parameters: Sequence[Any], *more: Any) -> Hashable:
    """Return what is equal for worlds that are equal as functions of these symbols (SX) and of their phases.

    Numbers are part of it. ``more``: trees that are compared as worlds are.
    """
    leaves: list[Any] = []
    shape = flatten((world, *more), leaves)
    column = ca.vertcat(ca.SX(0, 1), *(ca.vec(ca.densify(leaf)) for leaf in leaves))
    symbols = [*parameters, *(symbol for _, symbol in world.scheduled)]
    return shape, ca.Function("world", [ca.vertcat(ca.SX(0, 1), *symbols)], [column]).serialize()


def kept(
    make: Callable[..., T],
    world: World,
    scheme: Scheme,
    inputs: Sequence[str],
    parameters: Sequence[Any],
    *more: Hashable,
) -> T:
    """Return ``make(world, scheme, inputs, parameters, *more)``, or its result for an equal world."""
    key = (make, structure(world, parameters, scheme), tuple(inputs), more)
    found: T | None = KEPT.get(key)
    return KEPT.put(key, make(world, scheme, inputs, parameters, *more)) if found is None else found
