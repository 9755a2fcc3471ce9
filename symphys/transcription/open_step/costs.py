"""What a step adds to the objective, and what is observed after it."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.model.state_layout import GIVEN, Layout
from symphys.problem import Cost, Problem, Target
from symphys.transcription.rollout import Rollout
from symphys.transcription.stage import Stage, Value, sense_function
from symphys.types import Expr


def looks_at_variables(problem: Problem) -> bool:
    """Whether a cost or target has a variable in its formula."""
    names = {variable.name for variable in problem.variables}
    return any(not names.isdisjoint(each.formula.names) for each in asked(problem))


def asked(problem: Problem) -> list[Cost | Target]:
    """What the objective is made of."""
    return [*problem.costs, *problem.targets]


def moments(problem: Problem) -> tuple[int, ...]:
    """The steps, by number, in which something is asked for at one instant: at their starts, in the last at its end."""
    last = problem.simulation.steps
    instants = {each.at for each in asked(problem) if each.at != "always"}
    return tuple(sorted({last if isinstance(at, str) else round(at / problem.simulation.dt) for at in instants}))


def costs(rollout: Rollout, value: Value) -> tuple[Expr, Expr]:
    """What a step adds to the objective: running costs, and (moments,) what is added if the step has that number.

    Over all steps of a horizon both add up to the objective.
    """
    problem, dt = rollout.problem, rollout.dt
    running: Expr = ca.DM(0)
    ticks = moments(problem)
    single: list[Expr] = [ca.DM(0) for _ in ticks]
    for each in asked(problem):
        squares = each.squares if isinstance(each, Cost) else True
        if each.at == "always":
            shifts = (0, 1) if rollout.moves(each.formula) else (0,)
            for shift in shifts:
                running = running + each.weight * dt / len(shifts) * size(value(each.formula, shift), squares)
        else:
            tick = rollout.tick(each.at)
            found = value(each.formula, 1 if tick == problem.simulation.steps else 0)
            single[ticks.index(tick)] = single[ticks.index(tick)] + each.weight * size(found, squares)
    return running, ca.vertcat(ca.DM(0, 1), *single)


def size(value: Expr, squares: bool) -> Expr:
    """A cost of a value: its square, or itself."""
    return ca.sumsqr(value) if squares else value


def open_stage(rollout: Rollout, sensors: Sequence[str]) -> Stage:
    """A step with the costs ``running`` and ``moments``; see ``costs``."""

    def ask(value: Value) -> dict[str, Expr]:
        return dict(zip(("running", "moments"), costs(rollout, value), strict=True))

    return Stage(rollout, observe_function(rollout, sensors), ask, looks_at_variables(rollout.problem))


def observe_function(rollout: Rollout, sensors: Sequence[str]) -> ca.Function:
    """(x, p, time) -> what these sensors read; without any, the states of all bodies."""
    if sensors:
        return sense_function(rollout, sensors)
    x, p, time = ca.SX.sym("x", rollout.x0.shape[0]), ca.SX.sym("p", rollout.p.shape[0]), ca.SX.sym("time")
    columns = [x[part] for _, part in body_columns(rollout)]
    return ca.Function("sense", [x, p, time], [ca.densify(ca.vertcat(ca.SX(0, 1), *columns))])


def body_columns(rollout: Rollout) -> list[tuple[str, slice]]:
    """Name and columns of the state of each body."""
    layout = Layout(rollout.world)
    return [(f"{body.name}.{key}", layout[f"{body.name}.{key}"]) for body in rollout.world.bodies for key in GIVEN]
