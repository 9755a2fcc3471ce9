"""Everything that a problem with large nets is computed with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen import Kernel
from symphys.codegen.backends import build_kernel
from symphys.problem import Problem
from symphys.transcription.network_rollout.partition import Partition, partition
from symphys.transcription.network_rollout.step_program import (
    RESULTS,
    RolloutObjectives,
    sense_function,
    start_function,
    step_program,
)
from symphys.transcription.network_rollout.virtual_machine import VirtualMachineStep
from symphys.transcription.rollout import Rollout
from symphys.types import Array


class BatchStep(Protocol):
    """Computes one step of many robots.

    Attributes:
        seeded: names of the results, in their order.
        sizes: of each.
    """

    seeded: tuple[str, ...]
    sizes: Mapping[str, int]

    def forward(self, rows: Array, smoothing: Sequence[float]) -> Mapping[str, Array]:
        """(B, m) -> results by name, each (B, size)."""

    def gradient(self, rows: Array, seeds: Array, smoothing: Sequence[float]) -> tuple[Any, Array]:
        """(B, m), (B, all sizes) -> something, and the slopes (B, m) of seeds . results."""


class KernelStep:
    """The same by a kernel; see ``Stage``."""

    def __init__(self, kernel: Kernel) -> None:
        """Of a ``step_program``."""
        self.kernel, self.seeded = kernel, kernel.seeded
        self.sizes: Mapping[str, int] = {name: kernel.program.outputs[name].size for name in kernel.seeded}
        self.forward, self.gradient = kernel.forward, kernel.gradient


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

    @cached_property
    def plain(self) -> BatchStep:
        """The step on casadi's virtual machine."""
        return VirtualMachineStep(self.rollout, self.objectives, self.sensors)

    def compiled(self, exact: bool, backend: str) -> Kernel:
        """The step as a kernel of a backend, of one thread; KernelUnavailable if that cannot be."""
        program = step_program(self.rollout, self.objectives, self.sensors, exact)
        seeded = [name for name in RESULTS if name in program.outputs]
        return build_kernel(backend, program, seeded, threads=1)


def make_context(problem: Problem) -> RolloutContext:
    """Take a problem apart and say what is asked of it."""
    parts = partition(problem)
    sensors = tuple(dict.fromkeys(name for controller in parts.nets for name in controller.senses))
    sizes = {sensor.name: sensor.size for sensor in problem.sensors}
    ends = np.cumsum([0, *(sizes[name] for name in sensors)])
    places = {name: np.arange(a, b) for name, a, b in zip(sensors, ends[:-1], ends[1:], strict=True)}
    columns = tuple(np.concatenate([places[name] for name in controller.senses]) for controller in parts.nets)
    return RolloutContext(parts, RolloutObjectives(parts.rollout), sensors, columns)
