"""A small laboratory: roll a world out and differentiate a function of its final state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.functions import step_function
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Scheme, World
from symphys.types import Array


@lru_cache(64)
def built(world: World, scheme: Scheme, *inputs: str) -> ca.Function:
    """The step of a world of numbers: tests that look at one world from several sides build it once."""
    return step_function(world, scheme, inputs)


class Lab:
    """Rollouts of one world under one scheme."""

    def __init__(self, world: World, scheme: Scheme, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()):
        self.world, self.scheme, self.layout = world, scheme, Layout(world)
        self.step = step_function(world, scheme, inputs, parameters) if parameters else built(world, scheme, *inputs)
        self.horizon = cache(self.step.mapaccum)

    def trajectory(
        self, values: Mapping[str, Any], time: float, u: Any = None, p: Any = None, smoothing: Any = 0
    ) -> Any:
        """(nx, steps + 1), symbolic or numeric like the arguments."""
        steps = round(time / self.scheme.dt)
        u = ca.DM.zeros(self.step.size1_in(1), steps) if u is None else u
        p = ca.DM(0, 1) if p is None else p
        x = initial_state(self.world, values)
        if any(isinstance(given, ca.MX) for given in (x, u, p, smoothing)):
            return ca.horzcat(x, self.horizon(steps)(x, u, ca.repmat(p, 1, steps), ca.repmat(smoothing, 1, steps)))
        states, inputs = [x], ca.horzsplit(ca.DM(u))
        for k in range(steps):
            states.append(self.step(states[-1], inputs[k], p, smoothing))
        return ca.horzcat(*states)

    def states(self, values: Mapping[str, Any], time: float, **more: Any) -> dict[str, Array]:
        """Each quantity by name: (steps + 1, components)."""
        trajectory = np.array(self.trajectory(values, time, **more)).T
        return {name: trajectory[:, self.layout[name]] for name in self.layout.names()}


def value_and_gradient(f: Callable[[Any], Any], at: Sequence[float]) -> tuple[Array, Array]:
    """f and df/dz at a point, by casadi's adjoint."""
    z = ca.MX.sym("z", len(at))
    y = f(z)
    value, slope = ca.Function("f", [z], [y, ca.jacobian(y, z)])(at)
    return np.array(value).ravel(), np.array(slope)


def central_difference(f: Callable[[Any], Any], at: Sequence[float], step: float = 1e-6) -> Array:
    """df/dz at a point by central differences."""
    z = ca.MX.sym("z", len(at))
    g = ca.Function("f", [z], [f(z)])
    columns = []
    for i in range(len(at)):
        high, low = np.array(at, float), np.array(at, float)
        high[i] += step
        low[i] -= step
        columns.append((np.array(g(high)).ravel() - np.array(g(low)).ravel()) / (2 * step))
    return np.stack(columns, axis=1)
