"""The step of a problem with large nets on casadi's virtual machine: the judge, and machines without a compiler."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from symphys.transcription.network_rollout.step_program import RESULTS, RolloutObjectives, sense_function
from symphys.transcription.rollout import Rollout
from symphys.types import Array


class VirtualMachineStep:
    """Computes what the kernel of ``step_program`` computes; see ``BatchStep``."""

    def __init__(self, rollout: Rollout, objectives: RolloutObjectives, sensors: Sequence[str]) -> None:
        """Build the function of one step."""
        sizes = [int(part.shape[0]) for part in (rollout.x0, rollout.given, rollout.p)]
        sizes += [1, 1, int(rollout.z.shape[0])]
        row, smoothing = ca.MX.sym("row", sum(sizes)), ca.MX.sym("smoothing")
        x, given, p, now, later, z = ca.vertsplit(row, np.cumsum([0, *sizes]).tolist())
        u = given if rollout.feedback is None else rollout.feedback(x, given, p, now)
        after = rollout.step(x, u, p, smoothing)
        found = {"after": after, "inputs": u}
        found["sensed"] = sense_function(rollout, sensors)(after, p, later)
        asked = [
            rollout.compiled(formula)(after if shift else x, u, p, later if shift else now, z)
            for formula, shift in objectives.samples.series
        ]
        found["asked"] = ca.vertcat(ca.MX(0, 1), *asked)
        names = [name for name in RESULTS if found[name].shape[0]]
        self.seeded = tuple(names)
        self.sizes: Mapping[str, int] = {name: int(found[name].shape[0]) for name in names}
        self._value = ca.Function("stage", [row, smoothing], [ca.densify(found[name]) for name in names])
        self._pull = self._value.reverse(1)

    def forward(self, rows: Array, smoothing: Sequence[float]) -> dict[str, Array]:
        """See ``BatchStep``."""
        found = [[np.array(part).ravel() for part in self._value.call([row, smoothing[0]])] for row in rows]
        return {name: np.array([each[i] for each in found]) for i, name in enumerate(self.seeded)}

    def gradient(self, rows: Array, seeds: Array, smoothing: Sequence[float]) -> tuple[Any, Array]:
        """See ``BatchStep``."""
        cuts, slopes = np.cumsum(list(self.sizes.values()))[:-1], []
        for row, seed in zip(rows, seeds, strict=True):
            values, parts = self._value.call([row, smoothing[0]]), np.split(seed, cuts)
            slopes.append(np.array(self._pull.call([row, smoothing[0], *values, *parts])[0]).ravel())
        return None, np.array(slopes)
