"""The parts of a problem with large nets from which rollouts are computed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.problem import ALIVE, Problem
from symphys.records import dataclass
from symphys.transcription.decision_variables import start_of
from symphys.transcription.gradient_probe import combined
from symphys.transcription.network_rollout.partition import Partition, partition
from symphys.transcription.objective import FormulaSamples, terms
from symphys.transcription.rollout import Rollout
from symphys.transcription.stage import BatchStep, KernelStep, Stage, Value, sense_function
from symphys.types import Array, Expr


class RolloutObjectives:
    """The objectives of a rollout as functions of (z, p, x and u at moments, series), and their slopes.

    ``value`` gives merit, objective, errors, costs and outputs, ``slopes`` the derivatives of the merit; ``probe`` and
    ``probe_slopes`` are the same of what is differentiated to examine gradients.
    """

    def __init__(self, rollout: Rollout) -> None:
        """Build the functions."""
        self.samples = FormulaSamples(rollout)
        asked = terms(self.samples)
        self.terms = asked
        merit = asked.objective + asked.penalties
        self.arguments = self.samples.symbols
        results = [ca.densify(part) for part in (merit, asked.objective, asked.errors, asked.costs, asked.outputs)]
        self.value = ca.Function("objectives", self.arguments, results)
        self.slopes, number = self._slopes(merit), combined(asked.means)
        self.probe, self.probe_slopes = ca.Function("probe", self.arguments, [number]), self._slopes(number)

    def stage(self, rollout: Rollout, sensors: Sequence[str]) -> Stage:
        """Return a stage; its ``asked`` are the values of the formulas of ``samples.series`` in order."""

        def ask(value: Value) -> dict[str, Expr]:
            return {"asked": ca.vertcat(ca.SX(0, 1), *(value(*each) for each in self.samples.series))}

        return Stage(rollout, sense_function(rollout, sensors), ask, with_inputs=True)

    def _slopes(self, number: Expr) -> ca.Function:
        slopes = [ca.densify(ca.gradient(number, symbol)) for symbol in self.arguments]
        return ca.Function("slopes", self.arguments, slopes)


def start_function(rollout: Rollout, sensors: Sequence[str]) -> ca.Function:
    """Return z -> x0, the inputs of all steps, p, the sensor readings at the start, and the time step."""
    start = start_of(rollout.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.z)
    x0 = rollout.memory.start(start.x0)
    interval = rollout.parameters.step_length(rollout.problem.simulation, start.p)
    results = [x0, ca.vec(start.u), start.p, sense_function(rollout, sensors)(x0, start.p, 0.0), ca.MX(interval)]
    return ca.Function("start", [rollout.z], [ca.densify(result) for result in results]).expand()


@dataclass(frozen=True, eq=False)
class RolloutContext:
    """A problem with large nets, ready to be simulated.

    Attributes:
        partition: the problem taken apart.
        objectives: of a rollout.
        sensors: names of those that large nets use.
        columns: for each net, which columns of what they read it takes.
    """

    partition: Partition
    objectives: RolloutObjectives
    sensors: tuple[str, ...]
    columns: tuple[NDArray[np.intp], ...]

    @property
    def rollout(self) -> Rollout:
        """Return the rollout of the problem without its large nets."""
        return self.partition.rollout

    @cached_property
    def start(self) -> ca.Function:
        """Return ``start_function`` of the rollout."""
        return start_function(self.rollout, self.sensors)

    @cached_property
    def pull(self) -> ca.Function:
        """Return the adjoint of ``start``."""
        return self.start.reverse(1)

    @cached_property
    def sense(self) -> ca.Function:
        """Return ``sense_function`` of the rollout."""
        return sense_function(self.rollout, self.sensors)

    def alive(self, x: Array) -> Array | float:
        """Return (B, 1) whether motions with states (B, nx) go on; 1 without termination."""
        memory = self.rollout.memory
        return x[:, memory.columns[ALIVE]] if memory.terminates else 1.0

    @cached_property
    def stage(self) -> Stage:
        """Return the stage of one step."""
        return self.objectives.stage(self.rollout, self.sensors)

    @cached_property
    def plain(self) -> BatchStep:
        """Return the step on casadi's virtual machine."""
        return self.stage.interpreted()

    def compiled(self, exact: bool, backend: str) -> KernelStep:
        """Return the step as a kernel of a backend with one thread; KernelUnavailable if that fails."""
        return self.stage.compiled(exact, backend, threads=1)


def make_context(problem: Problem) -> RolloutContext:
    """Partition a problem and build its objectives."""
    parts = partition(problem)
    sensors = tuple(dict.fromkeys(name for controller in parts.nets for name in controller.senses))
    sizes = {sensor.name: sensor.size for sensor in problem.sensors}
    ends = np.cumsum([0, *(sizes[name] for name in sensors)])
    places = {name: np.arange(a, b) for name, a, b in zip(sensors, ends[:-1], ends[1:], strict=True)}
    columns = tuple(np.concatenate([places[name] for name in controller.senses]) for controller in parts.nets)
    return RolloutContext(parts, RolloutObjectives(parts.rollout), sensors, columns)
