"""Everything that a problem with large nets is computed with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.problem import ALIVE, Problem
from symphys.transcription.network_rollout.objectives import RolloutObjectives, start_function
from symphys.transcription.network_rollout.partition import Partition, partition
from symphys.transcription.rollout import Rollout
from symphys.transcription.stage import BatchStep, KernelStep, Stage, sense_function
from symphys.types import Array


@dataclass(frozen=True, eq=False)
class RolloutContext:
    """A problem with large nets, ready to be rolled out.

    Attributes:
        partition: the problem taken apart.
        objectives: what is asked of a rollout.
        sensors: names of those that large nets use.
        columns: for each net, which columns of what they read it takes.
    """

    partition: Partition
    objectives: RolloutObjectives
    sensors: tuple[str, ...]
    columns: tuple[NDArray[np.intp], ...]

    @property
    def rollout(self) -> Rollout:
        """Of the problem without its large nets."""
        return self.partition.rollout

    @cached_property
    def start(self) -> ca.Function:
        """See ``start_function``."""
        return start_function(self.rollout, self.sensors)

    @cached_property
    def pull(self) -> ca.Function:
        """The adjoint of ``start``."""
        return self.start.reverse(1)

    @cached_property
    def sense(self) -> ca.Function:
        """See ``sense_function``."""
        return sense_function(self.rollout, self.sensors)

    def alive(self, x: Array) -> Array | float:
        """Return for states (B, nx) whether a motion is not over, (B, 1); 1 where none ever is."""
        memory = self.rollout.memory
        return x[:, memory.columns[ALIVE]] if memory.terminates else 1.0

    @cached_property
    def stage(self) -> Stage:
        """One step."""
        return self.objectives.stage(self.rollout, self.sensors)

    @cached_property
    def plain(self) -> BatchStep:
        """The step on casadi's virtual machine."""
        return self.stage.interpreted()

    def compiled(self, exact: bool, backend: str) -> KernelStep:
        """The step as a kernel of a backend, of one thread; KernelUnavailable if that cannot be."""
        return self.stage.compiled(exact, backend, threads=1)


def make_context(problem: Problem) -> RolloutContext:
    """Take a problem apart and say what is asked of it."""
    parts = partition(problem)
    sensors = tuple(dict.fromkeys(name for controller in parts.nets for name in controller.senses))
    sizes = {sensor.name: sensor.size for sensor in problem.sensors}
    ends = np.cumsum([0, *(sizes[name] for name in sensors)])
    places = {name: np.arange(a, b) for name, a, b in zip(sensors, ends[:-1], ends[1:], strict=True)}
    columns = tuple(np.concatenate([places[name] for name in controller.senses]) for controller in parts.nets)
    return RolloutContext(parts, RolloutObjectives(parts.rollout), sensors, columns)
