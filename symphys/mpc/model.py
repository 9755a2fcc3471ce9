"""The problem that is solved at every tick: that of the file over one horizon, with a knot for each step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from symphys.errors import Issue, ProblemError
from symphys.problem import Problem, ProblemData, RecedingHorizon, Variable
from symphys.suggest import quote
from symphys.transcription.formula_names import now
from symphys.types import Array


def horizon_of(problem: ProblemData) -> RecedingHorizon:
    """Return the problem's [mpc] settings; ProblemError without any."""
    if problem.mpc is None:
        example = "write [mpc] and below it, for instance, rate = 100, horizon = 1.0 and dt = 0.05"
        raise ProblemError(problem.file, [Issue("mpc", f"there is no such table; {example}")])
    return problem.mpc


def receding_model(problem: Problem) -> Problem:
    """Return the problem over one horizon: costs and constraints along it, targets at its end.

    Every control has a knot for each step of the model, which holds over it; its name is its value at that step.

    Raises:
        ProblemError: the problem has no [mpc], or asks for what has no meaning in a horizon that moves.
    """
    horizon = horizon_of(problem)
    issues = [*fixed_times(problem), *static_variables(problem)]
    if problem.scenarios is not None:
        issues.append(Issue("scenario", "a controller plans for one model; leave the tables out"))
    if issues:
        raise ProblemError(problem.file, issues)
    smoothing = (horizon.smoothing,)
    simulation = replace(problem.simulation, duration=horizon.horizon, dt=horizon.dt, smoothing=smoothing)
    variables = tuple(resampled(each, problem, horizon) for each in problem.variables)
    names = {each.name: now(each.name) for each in problem.variables}
    asked: dict[str, Any] = {
        kind: tuple(replace(each, formula=each.formula.renamed(names)) for each in getattr(problem, kind))
        for kind in ("costs", "targets", "constraints")
    }
    return replace(problem, simulation=simulation, variables=variables, outputs=(), goal=None, **asked)


def fixed_times(problem: ProblemData) -> list[Issue]:
    """Return costs, targets and constraints at a fixed time of the problem."""
    moving = 'a horizon moves on; take "always" or "end", or name `time` in the formula'
    found = [
        Issue(f'phase "{phase.name}".sets', f"holds in a phase, but {moving}") for phase in problem.phases if phase.sets
    ]
    kinds: tuple[tuple[str, Any], ...] = (
        ("cost", problem.costs),
        ("target", problem.targets),
        ("constraint", problem.constraints),
    )
    controls = {each.name for each in problem.variables if each.kind == "control"}
    for kind, tables in kinds:
        for each in tables:
            if not isinstance(each.at, str):
                found.append(Issue(f'{kind} "{each.name}".at', f"is the time {each.at:g} s, but {moving}"))
            elif getattr(each, "during", None) is not None:
                found.append(Issue(f'{kind} "{each.name}".during', f"is a phase, but {moving}"))
            elif each.formula.parts:
                text = f"takes {', '.join(part.name for part in each.formula.parts)} of the whole motion, but {moving}"
                found.append(Issue(f'{kind} "{each.name}"', text))
            elif each.at == "end" and controls & each.formula.names:
                named = ", ".join(sorted(controls & each.formula.names))
                text = f'names {named} at the end, where a plan decides nothing more; take at = "always"'
                found.append(Issue(f'{kind} "{each.name}".at', text))
    return found


def static_variables(problem: ProblemData) -> list[Issue]:
    """Return variables that are no controls, and controls whose bounds change over time."""
    found = []
    for each in problem.variables:
        if each.kind != "control":
            sets = ", ".join(slot.name for slot in each.slots)
            text = f"sets {sets}, but a controller decides forces, torques and commands only"
            found.append(Issue(f"variable {quote(each.name)}", f"{text}; state the value in the file instead"))
        elif any(len(np.unique(rows(each, end), axis=0)) > 1 for end in (each.lower, each.upper)):
            text = "has bounds that change over time; a controller needs the same for every knot"
            found.append(Issue(f"variable {quote(each.name)}", text))
    if not any(each.kind == "control" for each in problem.variables):
        example = '[[variable]] with name = "torque", sets = "joint.command", knots = 20'
        found.append(Issue("variable", f"there is no control, so a controller has nothing to decide; {example}"))
    return found


def rows(variable: Variable, values: Array) -> Array:
    """Return values (knots, components)."""
    return values.reshape(variable.knots, -1)


def resampled(variable: Variable, problem: ProblemData, horizon: RecedingHorizon) -> Variable:
    """Return the control with a knot for each step of the model; the guess at mid-step, constant after the end."""
    steps, knots = horizon.steps, variable.knots
    share = np.minimum((np.arange(steps) + 0.5) * horizon.dt / problem.simulation.duration, 1.0)
    guess = rows(variable, variable.guess)
    if variable.interpolation == "constant" or knots == 1:
        held = guess[np.minimum((share * knots).astype(int), knots - 1)]
    else:
        columns = [np.interp(share * (knots - 1), np.arange(knots), column) for column in guess.T]
        held = np.stack(columns, axis=1)
    alike: dict[str, Any] = {
        key: np.tile(rows(variable, getattr(variable, key)).mean(axis=0), steps)
        for key in ("lower", "upper", "scale", "spread")
    }
    return replace(variable, knots=steps, interpolation="constant", guess=held.ravel(), **alike)
