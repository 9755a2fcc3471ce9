"""Keys of what is made of a problem: equal for equal things, whichever process makes them; None where not known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import casadi as ca

from symphys.codegen.toolchain.identity import identity_of
from symphys.dynamics.kept import structure
from symphys.problem import STEP_LENGTH, Problem, Variable
from symphys.transcription.rollout import Rollout

IGNORED_FIELDS = frozenset({"name", "title", "description", "file", "text", "settings", "solvers", "solver_tables"})
"""Fields of a problem on which no program depends."""


def program_identity(problem: Problem, exact: bool) -> str | None:
    """Return a key of a rollout's program; problems that differ only in texts and solver options share it."""
    data = {field.name: getattr(problem, field.name) for field in fields(problem) if field.name not in IGNORED_FIELDS}
    return identity_of(data, exact)


def motion_identity(rollout: Rollout, *what: object) -> str | None:
    """Return a key of what is made of a rollout's formulas in some way, as functions of its states, p and z.

    Numbers that p stacks are no part of it: problems of a sweep share what is made. None where it is not known.
    """
    known = rollout.once(identity_without_numbers, lambda: identity_without_numbers(rollout, rollout.problem.variables))
    return None if known is None else identity_of(known, *what)


def terms_identity(rollout: Rollout, *what: object) -> str | None:
    """Return a key of what is made of the formulas of terms one by one: as ``motion_identity``, without weights."""
    problem = rollout.problem
    same = replace(
        problem,
        costs=tuple(replace(each, weight=1.0) for each in problem.costs),
        targets=tuple(replace(each, weight=1.0, tolerance=1.0) for each in problem.targets),
        constraints=tuple(replace(each, penalty=1.0, tolerance=1.0) for each in problem.constraints),
    )
    plain = replace(rollout, problem=same)
    known = rollout.once(terms_identity, lambda: identity_without_numbers(plain, problem.variables))
    return None if known is None else identity_of(known, *what)


def swept_identity(rollout: Rollout, inputs: Sequence[Variable], exact: bool) -> str | None:
    """Return a key of a rollout's program that does not depend on the numbers of ``inputs``, its last variables."""
    known = identity_without_numbers(rollout, rollout.problem.variables[: -len(inputs)])
    start = ca.Function("start", [rollout.z], [rollout.x0, rollout.given, rollout.p]).serialize()
    return None if known is None else identity_of(known, start, exact)


def identity_without_numbers(rollout: Rollout, variables: Sequence[Variable]) -> str | None:
    """Return a key of a rollout of the given variables, in which numbers that p stacks are symbols."""
    problem, parameters = rollout.problem, rollout.parameters
    ignored = IGNORED_FIELDS | {"parametric", "parameters", "variables"}
    data = {field.name: getattr(problem, field.name) for field in fields(problem) if field.name not in ignored}
    symbolic, text = {*parameters.names, *parameters.overrides()}, repr(data)
    constants = {name: value for name, value in problem.parameters.items() if name in text and name not in symbolic}
    data["parameters"] = constants  # those that formulas may read
    # what there is of ``parametric``
    world = structure(rollout.world, parameters.symbols, parameters.scheme(problem.simulation))
    given = ca.Function("given", [rollout.z], [rollout.given]).serialize()
    names = parameters.names, rollout.inputs, tuple(rollout.memory.columns)
    return identity_of(data, variables, world, given, names)


OF_STEP = ("sensors", "controllers", "forces", "references", "phases", "termination")
"""Fields of a problem on which its step depends, besides its world and its parameters."""


def step_identity(rollout: Rollout, exact: bool) -> str | None:
    """Return a key of one step: other costs, targets, limits, guesses and durations have the same.

    The duration is part of it where formulas may name it, or phases act; the time step where it is no parameter; and
    whether the duration is free, since tangents then have ``lag``.
    """
    problem, parameters, simulation = rollout.problem, rollout.parameters, rollout.problem.simulation
    world = structure(rollout.world, parameters.symbols, parameters.scheme(simulation))
    columns = [(name, each.start, each.stop) for name, each in parameters.columns.items()]
    own = [getattr(problem, name) for name in OF_STEP]
    phased = any(phase.sets for phase in problem.phases) or any(law.during for law in problem.forces)
    if phased or "duration" in repr(own):
        timed: object = simulation
    else:
        timed = None if STEP_LENGTH in parameters.columns else simulation.dt
    columns_of_x = tuple(rollout.memory.columns)
    return identity_of(world, timed, problem.free_duration, own, columns, rollout.inputs, columns_of_x, exact)
