"""Every feature of problem files, and what phases make of it, by every examination: each ends with numbers."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from worlds.features import FEATURES

from symphys.problem import problem_of_tables
from symphys.transcription import transcribe
from symphys.verification.examination import examine

Tables = dict[str, Any]
BALL: Tables = {
    "simulation": {"duration": 0.1, "dt": 0.02, "sweeps": 4},
    "body": [
        {
            "name": "ball",
            "shape": {"sphere": {"radius": 0.1}},
            "mass": 0.5,
            "position": [0, 0, 0.115],
            "velocity": [0.5, 0, -0.3],
        }
    ],
    "ground": {"friction": 0.4, "restitution": 0.3},
    "variable": [{"name": "throw", "sets": "ball.velocity", "guess": [0.5, 0.1, -0.3]}],
    "cost": [{"name": "place", "squares": "ball.position - [0.1, 0, 0.2]"}],
    "target": [{"name": "there", "value": "ball.position[0:2] - [0.1, 0]", "tolerance": 0.01}],
}
PENDULUM: Tables = {
    "simulation": {"duration": 0.1, "dt": 0.02, "sweeps": 4},
    "body": [{"name": "bob", "mass": 1.0, "inertia": 0.1, "position": [0, 0, -0.5]}],
    "joint": [{"name": "knee", "between": ["world", "bob"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 0]}],
    "variable": [{"name": "rate", "sets": "knee.start_rate", "guess": 0.3}],
    "cost": [{"name": "place", "squares": "knee.angle - 0.1"}],
    "target": [{"name": "there", "value": "knee.angle - 0.02", "tolerance": 0.01}],
}
COMMAND = {"name": "command", "sets": "knee.command", "knots": 2, "guess": 0.1}
RATE = PENDULUM["variable"][0]
SERVO = {"motor": {"servo": {"gain": 10, "torque": 3, "velocity": 5}}}


def ball(body: Tables | None = None, **more: Any) -> Tables:
    tables = deepcopy(BALL | more)
    tables["simulation"] = BALL["simulation"] | more.get("simulation", {})
    tables["body"][0] |= body or {}
    return tables


def pendulum(knee: Tables | None = None, **more: Any) -> Tables:
    tables = deepcopy(PENDULUM | more)
    tables["joint"][0] |= knee or {}
    return tables


def phases(first: Tables | None = None, second: Tables | None = None, **end: float) -> list[Tables]:
    """Two of them, and what each sets."""
    named: list[Tables] = [{"name": "hang", **(end or {"until": 0.06})}, {"name": "flight"}]
    for phase, sets in zip(named, (first, second), strict=True):
        if sets is not None:
            phase["sets"] = sets
    return named


DURATION = {"name": "duration", "sets": "simulation.duration", "guess": 0.1, "lower": 0.05}
OFF = {"knee.torque": 0, "knee.friction": 0}
DRAG = {"name": "drag", "on": "ball.force", "value": "-0.1 * ball.velocity"}
THROW = BALL["variable"][0]

MU = {"name": "mu", "sets": "hang.ground.friction", "guess": 0.2}
TORQUE = {"motor": {"torque": {"torque": 3}}}
AFFINE = {"motor": {"affine": {"gain": 20, "kp": 20, "kv": 2}}}
SPRING = {"spring": {"stiffness": 2, "damping": 0.1, "rest": 0.2}}
LIMITED = {"limits": [-0.01, 0.5], "armature": 0.01, "friction": 0.1}
BOTH = [RATE, COMMAND]

PHASES: dict[str, Tables] = {
    "phases": ball(phase=phases(), cost=[{"name": "c", "during": "flight", "squares": "ball.position"}]),
    "phases that set contact": ball(phase=phases({"ground.friction": 0.1}, {"gravity": [0, 0, -1]})),
    "phases with joints off": pendulum(SERVO | {"friction": 0.1}, variable=BOTH, phase=phases(OFF, {"knee.torque": 1})),
    "phases with a free duration": ball(phase=phases({"ground.friction": 0}, share=0.5), variable=[THROW, DURATION]),
    "a number of a phase": ball(phase=phases({"ground.friction": 0.1}), variable=[THROW, MU]),
    "force law in a phase": ball(phase=phases(), force=[DRAG | {"during": "hang"}]),
}
MORE: dict[str, Tables] = {
    "torque motor in a phase": pendulum(TORQUE, variable=BOTH, phase=phases({"knee.torque": 0})),
    "affine motor in a phase": pendulum(AFFINE, variable=BOTH, phase=phases({"knee.kp": 0, "knee.kv": 0})),
    "spring in a phase": pendulum(SPRING, phase=phases({"knee.stiffness": 0, "knee.damping": 0}, {"knee.rest": 0})),
    "limits and armature in a phase": pendulum(LIMITED, phase=phases({"knee.friction": 0})),
}


LONGEST = {"load on two boards", "inertia and centre of mass", "orientation", "reactions of joints"} | {
    *("a leg that lands", "loop of joints", "soft joint", "coupling", "screw", "universal joint"),
    *("anchor and start of a joint", "rolling and torsion", "velocity motor", "affine motor"),
}
"""Examined with ``make thorough``: their steps take long to build, and others are examined in the same way."""


@few(
    "name",
    [
        *PHASES,
        *(
            pytest.param(name, marks=pytest.mark.thorough if name in LONGEST else pytest.mark.slow)
            for name in MORE | FEATURES
        ),
    ],
    1,
)
def test_every_examination_ends_with_numbers(name: str) -> None:
    tables = (PHASES | MORE | FEATURES)[name]
    made = transcribe(problem_of_tables(tables), backend="casadi")
    found = examine(made, made.shooting.start(0))
    assert {"gradient", "refined", "order", "bounds"} <= set(found)
    assert len(found["gradient"]) == len(tables["variable"]) and len(found["refined"]) == 3
    assert all(np.isfinite([row["error"], row["scale"]]).all() for row in found["gradient"])
    assert all(row["error"] < 1e-4 for row in found["gradient"] if row["felt"] > 1e-9), "what has an effect"
    assert all(np.isfinite(row["objective"]) for row in found["refined"])
    assert not found.get("fault")
