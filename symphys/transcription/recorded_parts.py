"""A simulated rollout as arrays, and the parts of formulas that depend on the whole motion."""

from __future__ import annotations

import numpy as np

from symphys.expression import Formula, MotionPart
from symphys.records import dataclass
from symphys.transcription.rollout import Rollout
from symphys.transcription.terms import part_points
from symphys.types import Array


@dataclass(frozen=True)
class RolloutArrays:
    """States, inputs, parameters and times of a rollout.

    Attributes:
        z: (n,) decision vector.
        smoothing: [m/s].
        x: (N + 1, nx) states, with all memory.
        u: (N, nu) inputs.
        given: (N, nu) inputs as variables give them, to which controllers add.
        p: (np,) parameters.
        time: (N + 1,) [s].
    """

    z: Array
    smoothing: float
    x: Array
    u: Array
    given: Array
    p: Array
    time: Array

    @property
    def finite(self) -> bool:
        """Whether all states are finite."""
        return bool(np.isfinite(self.x).all())

    def step_arguments(self, k: int) -> list[Array]:
        """Return the arguments of the step function at step k."""
        return [self.x[k], self.u[k], self.p, np.array([self.smoothing])]

    def control_arguments(self, k: int) -> list[Array]:
        """Return the arguments of the controllers at step k."""
        return [self.x[k], self.given[k], self.p, self.time[k : k + 1]]

    def closed_arguments(self, k: int, rollout: Rollout) -> list[Array]:
        """Return the arguments of the step with its controllers."""
        time = [] if rollout.feedback is None else [self.time[k]]
        return [self.x[k], np.array([*self.given[k], *time]), self.p, np.array([self.smoothing])]


def part_numbers(rollout: Rollout, arrays: RolloutArrays, formula: Formula) -> list[Array]:
    """Evaluate the parts of a formula over the whole motion of a simulated rollout."""
    if not formula.parts:
        return []
    return [np.concatenate([_numbers(rollout, arrays, part) for part in formula.parts])]


def _numbers(rollout: Rollout, arrays: RolloutArrays, part: MotionPart) -> Array:
    """Evaluate a part (m,)."""
    compiled = rollout.compiled(part.formula)
    found = [
        np.array(compiled(*formula_arguments(arrays, k, row))).ravel() for k, row in part_points(rollout, part).pairs
    ]
    total = np.mean(found, axis=0)
    return np.asarray(total * arrays.time[-1] if part.kind == "integral" else total)


def formula_arguments(arrays: RolloutArrays, k: int, row: int) -> list[Array]:
    """Return the arguments of a compiled formula without parts, at state k with inputs ``row``."""
    return [arrays.x[k], arrays.u[row], arrays.p, arrays.time[k : k + 1], arrays.z]
