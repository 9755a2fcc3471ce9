"""Values of variables by name, and as one decision vector z."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symphys.errors import SymphysError
from symphys.shooting import ShootingProblem, VariableBlock
from symphys.suggest import hint, quote
from symphys.types import Array


def shape_of(block: VariableBlock) -> tuple[int, ...]:
    """Return the shape of a variable's values: (components,), or (knots, components) with several knots."""
    components, knots = block.shape
    return (components,) if knots == 1 else (knots, components)


def by_name(shooting: ShootingProblem, z: Array) -> dict[str, Array]:
    """Split z (n,) into variables by name: (components,), or (knots, components) of those with several knots."""
    return {block.name: z[block.start : block.stop].reshape(shape_of(block)) for block in shooting.blocks}


def vector(shooting: ShootingProblem, values: Mapping[str, ArrayLike]) -> Array:
    """Return the guess as a decision vector z (n,), with some variables replaced.

    Args:
        shooting: the shooting problem, which has the variables.
        values: values by the names of variables; a number, or one for each component, holds for all knots.

    Raises:
        SymphysError: no variable has that name, or the shape of its values does not fit; says which would.
    """
    z, blocks = shooting.start(0), {block.name: block for block in shooting.blocks}
    for name, value in values.items():
        if name not in blocks:
            raise SymphysError(f"no variable is called {quote(name)}; {hint(name, blocks)}")
        z[blocks[name].start : blocks[name].stop] = fitted(blocks[name], value)
    return z


def fitted(block: VariableBlock, value: Any) -> Array:
    """Broadcast a value to all components and knots of a variable: (components * knots,)."""
    given, wanted = np.asarray(value, float), shape_of(block)
    if given.ndim == 1 and given.size == int(np.prod(wanted)):
        return given
    try:
        return np.broadcast_to(given, wanted).ravel()
    except ValueError:
        kind = "(components,)" if len(wanted) == 1 else "(knots, components)"
        text = f"variable {quote(block.name)} takes numbers of shape {wanted}, {kind}, not {given.shape}"
        raise SymphysError(text) from None
