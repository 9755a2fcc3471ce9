"""Measured states: the whole state vector, or coordinates and rates by name, as another simulator has them."""

from __future__ import annotations

import re
from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from symphys.dynamics.observation import reading_function
from symphys.errors import SymphysError
from symphys.maths import rotation
from symphys.model.state_layout import Layout
from symphys.suggest import hint, quote
from symphys.transcription.staged.tangent import Tangent
from symphys.types import Array

MAX_NORM_ERROR = 1e-3
"""Largest deviation of the length of a measured quaternion from 1."""


class StateReader:
    """Converts measurements to states.

    Attributes:
        sizes: the names of a state by name with their numbers of entries: ``shoulder.angle`` and ``shoulder.rate``,
            ``rail.position``; of a body that floats ``torso.position`` [m], ``torso.orientation`` (w, x, y, z),
            ``torso.velocity`` [m/s], ``torso.angular_velocity`` [rad/s], world frame. Angles count whole turns.
        floating: names of the bodies that float.
    """

    def __init__(self, tangent: Tangent, nominal: Array) -> None:
        """Read the names; ``nominal`` (np,): the rollout's parameters."""
        rollout = tangent.rollout
        self._tangent, self._world, self._nominal = tangent, rollout.world, nominal
        self._size, self._layout = rollout.memory.size, Layout(rollout.world)
        self._reading = reading_function(rollout.world, rollout.parameters.symbols)
        at = {name: k for k, name in enumerate(tangent.names)}
        self._joints: dict[str, tuple[int, list[int], list[int]]] = {}
        self.sizes: dict[str, int] = {}
        column = 0
        for joint in rollout.world.joints:
            count = len(joint.kind.coordinates)
            places = [at.get(f"{joint.name}.coordinate[{k}]") for k in range(count)]
            if count and None not in places:
                for which, key in enumerate((joint.kind.quantity, "rate")):
                    kind = "coordinate" if which == 0 else "rate"
                    into = [at[f"{joint.name}.{kind}[{k}]"] for k in range(count)]
                    self._joints[f"{joint.name}.{key}"] = which, list(range(column, column + count)), into
                    self.sizes[f"{joint.name}.{key}"] = count
            column += count
        self.floating = [name.removesuffix(".turn[0]") for name in tangent.names if name.endswith(".turn[0]")]
        self._at = at
        for body in self.floating:
            fields = (("position", 3), ("orientation", 4), ("velocity", 3), ("angular_velocity", 3))
            self.sizes |= {f"{body}.{field}": size for field, size in fields}
        balls = sorted({found[1] for name in tangent.names if (found := re.fullmatch(r"(.*)\.coordinate\[0\]", name))})
        known = {name.rpartition(".")[0] for name in self._joints}
        self._unnamed = [joint for joint in balls if joint not in known]

    def __call__(self, state: ArrayLike | Mapping[str, ArrayLike], expected: Array) -> Array:
        """Return the state (nx,).

        Args:
            state: (nx,) as this engine has it, or numbers by the names of ``sizes``.
            expected: (nx,) a state like it: what is not measured, the forces that a step begins from, is as there.

        Raises:
            SymphysError: names that are missing or that there are not, shapes that do not fit, numbers not finite.
        """
        if isinstance(state, Mapping):
            return self._named(state, expected)
        whole = np.asarray(state, float)
        if whole.shape != (self._size,):
            text = f"a state has {self._size} numbers, not the shape {whole.shape}; or give names: {self._listed()}"
            raise SymphysError(text)
        if not np.isfinite(whole).all():
            raise SymphysError("the measured state has numbers that are not finite")
        return whole

    def values(self, x: Array) -> dict[str, Array]:
        """Split a state (nx,) by the names of ``sizes``."""
        world = x[: self._layout.size]
        now = [np.array(part).ravel() for part in self._reading(world, self._nominal)[:2]]
        found = {name: now[which][columns] for name, (which, columns, _) in self._joints.items()}
        return found | {name: world[self._layout[name]] for name in self.sizes if name not in found}

    def noisy(self, x: Array, noise: float, rate_noise: float, rng: np.random.Generator) -> Array:
        """Return the state (nx,) with noise on coordinates and positions, and on rates and velocities."""
        off = np.zeros(self._tangent.size)
        for k, name in enumerate(self._tangent.names):
            field = name.rpartition(".")[2].partition("[")[0]
            if field in ("coordinate", "position", "turn"):
                off[k] = noise
            elif field in ("rate", "velocity", "angular_velocity"):
                off[k] = rate_noise
        off *= rng.standard_normal(len(off))
        return np.asarray(self._tangent.retract(x[None], off[None], self._nominal)[0])

    def _named(self, state: Mapping[str, ArrayLike], expected: Array) -> Array:
        if self._unnamed:
            text = f"the joints {', '.join(self._unnamed)} have no coordinates by name; give the whole state (nx,)"
            raise SymphysError(text)
        for name in state:
            if name not in self.sizes:
                raise SymphysError(f"a state has no {quote(str(name))}; {hint(str(name), self.sizes)}")
        missing = [name for name in self.sizes if name not in state]
        if missing:
            raise SymphysError(f"the state lacks {', '.join(missing)}")
        given = {name: self._numbers(name, state[name]) for name in self.sizes}
        world = expected[: self._layout.size]
        now = [np.array(part).ravel() for part in self._reading(world, self._nominal)[:2]]
        off = np.zeros(self._tangent.size)
        for name, (which, columns, into) in self._joints.items():
            off[into] = given[name] - now[which][columns]
        for body in self.floating:
            self._float(body, given, world, off)
        return np.asarray(self._tangent.retract(expected[None], off[None], self._nominal)[0])

    def _float(self, body: str, given: Mapping[str, Array], world: Array, off: Array) -> None:
        """Return the part of the tangent that moves a floating body to its measured pose."""
        for field in ("position", "velocity", "angular_velocity"):
            first = self._at[f"{body}.{field}[0]"]
            off[first : first + 3] = given[f"{body}.{field}"] - world[self._layout[f"{body}.{field}"]]
        wanted = given[f"{body}.orientation"]
        if abs(np.linalg.norm(wanted) - 1) > MAX_NORM_ERROR:
            raise SymphysError(f"{body}.orientation: {wanted.tolist()} is no unit quaternion w, x, y, z")
        turn, old = self._at[f"{body}.turn[0]"], ca.DM(world[self._layout[f"{body}.orientation"]])
        unit = ca.DM(wanted / np.linalg.norm(wanted))
        off[turn : turn + 3] = np.array(rotation.between(old, unit)).ravel()

    def _numbers(self, name: str, value: ArrayLike) -> Array:
        numbers = np.atleast_1d(np.asarray(value, float))
        if numbers.shape != (self.sizes[name],):
            raise SymphysError(f"{name}: {self.sizes[name]} numbers are expected, not the shape {np.shape(value)}")
        if not np.isfinite(numbers).all():
            raise SymphysError(f"{name}: {numbers.tolist()} is not finite")
        return numbers

    def _listed(self) -> str:
        return ", ".join(self.sizes)
