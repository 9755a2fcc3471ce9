"""Sensors and controllers along a rollout: from the state at t_k to the inputs of the step from there."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca

from symphys.model.state_layout import input_columns, input_sizes, inputs_size
from symphys.model.world import World
from symphys.problem import FeedbackController, Problem, Sensor
from symphys.transcription.feedback.force_laws import force_function
from symphys.transcription.feedback.sensor_memory import SensorMemory
from symphys.transcription.formula_names import Parameters, instant, namespace
from symphys.types import Expr


class Control:
    """The sensors and controllers of a problem, as functions that a rollout calls in every step."""

    def __init__(
        self, problem: Problem, world: World, inputs: Sequence[str], parameters: Parameters, memory: SensorMemory
    ) -> None:
        """Nothing is built before it is asked for."""
        self.problem, self.world, self.inputs, self.parameters, self.memory = problem, world, inputs, parameters, memory

    def sensor(self, sensor: Sensor) -> ca.Function:
        """(x, p, time) -> what a sensor reads; x with its memory."""
        at = instant(self.world, self.inputs, self.parameters, self.memory, 0)
        wanted = frozenset[str]().union(*(formula.names for formula in sensor.formulas))
        names = namespace(self.problem, self.world, self.inputs, self.parameters, self.memory, at, wanted)
        zeros = {name: ca.SX.zeros(size) for name, size in input_sizes(self.world).items()}
        names |= {**zeros, **self.memory.commands(at.x)}
        parts = [ca.SX(formula.evaluate({name: names[name] for name in formula.names})) for formula in sensor.formulas]
        return ca.Function("sense", [at.x, at.p, at.time], [ca.densify(ca.vertcat(*parts))])

    def numbers(self, controller: FeedbackController, p: Expr) -> dict[str, Expr]:
        """The controller's numbers among the parameters."""
        return {key: p[self.parameters.columns[f"{controller.name}.{key}"]] for key in controller.law.sizes}

    def place(self, controller: FeedbackController) -> ca.DM:
        """(nu, m) sparse: which input each output is added to, scaled."""
        columns = input_columns(self.world, self.inputs)
        rows = [columns[name].start + component for name, component in controller.drives]
        count = len(rows)
        return ca.DM.triplet(
            rows, list(range(count)), ca.DM(controller.scale), inputs_size(self.world, self.inputs), count
        )

    def function(self) -> ca.Function:
        """(x, u, p, time) -> the inputs: u, which variables give, and what all controllers and force laws add."""
        at = instant(self.world, self.inputs, self.parameters, self.memory, 0)
        read = {s.name: self.sensor(s)(at.x, at.p, at.time) for s in self.problem.sensors}
        u = at.u
        for controller in self.problem.controllers:
            sensed = ca.vertcat(ca.SX(0, 1), *(read[name] for name in controller.senses))
            outputs = controller.law.act(sensed, at.time, self.numbers(controller, at.p))
            u = u + ca.mtimes(self.place(controller), outputs)
        if self.laws is not None:
            u = self.laws(at.x, u, at.p, at.time)
        return ca.Function("control", [at.x, at.u, at.p, at.time], [ca.densify(u)])

    @cached_property
    def laws(self) -> ca.Function | None:
        """See ``force_function``; None without force laws."""
        if not self.problem.forces:
            return None
        return force_function(self.problem, self.world, self.inputs, self.parameters, self.memory)
