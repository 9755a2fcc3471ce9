"""Early termination: the state after a step of a motion that may be over; from then on nothing changes."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.model.world import World
from symphys.problem import ALIVE, Problem, Termination
from symphys.transcription.feedback.sensor_memory import SensorMemory
from symphys.transcription.formula_names import Parameters, compile_formula


def termination_function(
    problem: Problem,
    termination: Termination,
    world: World,
    inputs: Sequence[str],
    parameters: Parameters,
    memory: SensorMemory,
) -> ca.Function:
    """(x, after, p) -> the next state: ``after`` is all of it but ``alive``, as the step from x has it."""
    margin = compile_formula(problem, world, inputs, parameters, memory, termination.margin)
    x, after = ca.SX.sym("x", memory.size), ca.SX.sym("after", memory.size - 1)
    p = ca.SX.sym("p", margin.size1_in(2))
    blank = [ca.SX.zeros(margin.size1_in(i)) for i in (1, 3, 4)]
    left = margin(ca.vertcat(after, 1), blank[0], p, blank[1], blank[2])
    moved = ca.vertcat(after, left >= 0)
    return ca.Function("termination", [x, after, p], [ca.if_else(x[memory.columns[ALIVE]] > 0, moved, x)])
