"""What is asked of a motion leaves the programs of its step, and their key; a change of the step does not."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

import symphys
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.linearization import Linearization
from symphys.transcription.staged.policy_rollout import PolicyRollout, PolicySizes
from symphys.transcription.staged.step_program import step_program

Tables = dict[str, Any]
SWING: Tables = {
    "simulation": {"duration": 0.4, "dt": 0.02, "sweeps": 3},
    "body": [{"name": "bob", "mass": 1.0, "inertia": 0.1, "position": [0, 0, -0.5]}],
    "joint": [{"name": "knee", "between": ["world", "bob"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 0]}],
    "variable": [{"name": "push", "sets": "bob.torque[1]", "knots": 20, "guess": 0.1}],
    "cost": [{"name": "effort", "at": "always", "squares": "push"}],
    "target": [{"name": "up", "value": "bob.position[2] - 0.1", "tolerance": 0.01}],
}
DRAG = {"name": "drag", "on": "bob.force", "value": "-drag.c * bob.velocity", "numbers": {"c": 0.1}}
LEFT = {
    "duration": ("simulation", "duration", 0.6),
    "weight": ("cost", "weight", 3.0),
    "cost": ("cost", "squares", "bob.torque[1]"),
    "aim": ("target", "value", "bob.position[2] + 0.2"),
    "tolerance": ("target", "tolerance", 0.5),
    "guess": ("variable", "guess", 0.3),
    "bounds": ("variable", "upper", 2.0),
    "knots": ("variable", "knots", 10),
    "component": ("variable", "sets", "bob.torque[0]"),
}
CHANGED = {
    "time step": ("simulation", "dt", 0.01),
    "sweeps": ("simulation", "sweeps", 4),
    "mass": ("body", "mass", 2.0),
    "axis": ("joint", "hinge", {"axis": [1, 0, 0]}),
    "another input": ("variable", "sets", "bob.force[1]"),
}


def changed(table: str, key: str, value: Any) -> Linearization:
    tables = deepcopy(SWING)
    whole = tables[table][0] if isinstance(tables[table], list) else tables[table]
    whole[key] = value
    return Linearization(symbolic_rollout(symphys.load(tables)), "casadi", 1)


NAMED = "-drag.c * bob.velocity * duration"


def keys(made: Linearization) -> list[str | None]:
    return [made.step.source(what, lambda: pytest.fail("is not made")).identity for what in ("step", "slopes")]


def texts(made: Linearization) -> list[str]:
    """The functions of the step and of its slopes, in order, with the places of their arguments."""
    found = []
    for tangent in (False, True):
        program = step_program(made.step.arguments, True, tangent)
        for call in (*program.prologue, *program.body, *program.epilogue):
            found.append(f"{call.function.serialize()} {call.inputs} {call.outputs}")
    return found


ORIGINAL = ("simulation", "duration", 0.4)


@pytest.mark.parametrize("name", LEFT)
def test_what_is_asked_of_a_motion_leaves_its_step(name: str) -> None:
    made, other = changed(*ORIGINAL), changed(*LEFT[name])
    assert keys(made) == keys(other) and None not in keys(made)
    assert texts(made) == texts(other)


@pytest.mark.parametrize("name", CHANGED)
def test_what_changes_the_step_has_a_key_of_its_own(name: str) -> None:
    made, other = changed(*ORIGINAL), changed(*CHANGED[name])
    assert not set(keys(made)) & set(keys(other))


def test_laws_have_a_key_of_their_own() -> None:
    """With the duration in it where a formula names it."""
    found = []
    for value, seconds in ((None, 0.4), (DRAG["value"], 0.4), (NAMED, 0.4), (NAMED, 0.6)):
        tables = deepcopy(SWING) | ({} if value is None else {"force": [DRAG | {"value": value}]})
        tables["simulation"]["duration"] = seconds
        found.append(tuple(keys(Linearization(symbolic_rollout(symphys.load(tables)), "casadi", 1))))
    assert len(set(found)) == 4


def test_a_time_step_that_is_a_parameter_is_no_part_of_the_key() -> None:
    """Then steps half as long are those of the same kernel, to rounding."""
    made = []
    for dt in (0.01, 0.005):
        tables = deepcopy(SWING)
        tables["simulation"]["dt"] = dt
        made.append(Linearization(symbolic_rollout(symphys.load(tables), timed=True), "casadi", 1))
    coarse, fine = made
    assert keys(coarse) == keys(fine) and None not in keys(coarse)
    z = np.zeros(int(fine.rollout.z.shape[0])) + 0.3
    shared, own = fine.sharing(coarse.step).motion(z, 0.0), fine.motion(z, 0.0)
    assert len(shared.x) == 2 * len(coarse.motion(z, 0.0).x) - 1
    assert np.array_equal(shared.x, own.x)


def test_what_is_varied_has_a_key_of_its_own() -> None:
    """A number that a variable sets is an argument of the step."""
    made = changed(*ORIGINAL)
    tables = deepcopy(SWING)
    tables["variable"] += [{"name": "heavy", "sets": "bob.mass", "guess": 1.0}]
    heavy = Linearization(symbolic_rollout(symphys.load(tables)), "casadi", 1)
    tables["variable"][1] = {"name": "lasts", "sets": "simulation.duration", "guess": 0.4}
    timed = Linearization(symbolic_rollout(symphys.load(tables)), "casadi", 1)
    longer = deepcopy(tables)
    longer["simulation"]["duration"] = 0.6
    steps = Linearization(symbolic_rollout(symphys.load(longer)), "casadi", 1)
    found = [tuple(keys(each)) for each in (made, heavy, timed, steps)]
    assert len(set(found[:3])) == 3
    assert found[3] == found[2], "with a free duration the time step is a number of the step"
    z = np.append(np.zeros(int(steps.rollout.z.shape[0]) - 1) + 0.3, 0.5)
    assert np.array_equal(steps.sharing(timed.step).motion(z, 0.0).x, steps.motion(z, 0.0).x)


def policy_key(made: Linearization) -> str | None:
    return PolicyRollout(made.step, PolicySizes(0, 1, 1)).source.identity


@pytest.mark.parametrize("name", LEFT)
def test_of_the_horizon_a_policy_knows_the_number_of_steps(name: str) -> None:
    made, other = policy_key(changed(*ORIGINAL)), policy_key(changed(*LEFT[name]))
    assert None not in (made, other) and (made == other) == (name != "duration")
