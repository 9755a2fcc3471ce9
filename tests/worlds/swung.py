"""A pendulum with a motor too weak to lift it at once, for tests of model predictive control: quick to compile."""

from __future__ import annotations

from typing import Any

from symphys.problem import Problem, problem_of_tables

TABLES: dict[str, Any] = {
    "simulation": {"duration": 1.0, "dt": 0.02},
    "body": [{"name": "bob", "mass": 1.0, "inertia": 0.01, "position": [0, 0, -1]}],
    "joint": [
        {
            "name": "pivot",
            "between": ["world", "bob"],
            "hinge": {"axis": [0, 1, 0]},
            "point": [0, 0, 0],
            "motor": {"torque": {"torque": 8.0}},
        }
    ],
    "variable": [
        {"name": "twist", "sets": "pivot.command", "knots": 20, "lower": -8.0, "upper": 8.0, "guess": 0.5, "scale": 2.0}
    ],
    "cost": [
        {"name": "way", "at": "always", "squares": "[pivot.angle - pi, 0.1 * pivot.rate]", "weight": 4},
        {"name": "effort", "at": "always", "squares": "pivot.command", "weight": 0.03},
        {"name": "height", "at": "always", "value": "exp(-bob.position[2])", "weight": 0.1},
    ],
    "target": [
        {"name": "upright", "value": "pivot.angle - pi", "tolerance": 0.15, "weight": 20},
        {"name": "at rest", "value": "pivot.rate", "tolerance": 0.3, "weight": 1},
    ],
    "constraint": [{"name": "not too fast", "at": "always", "value": "pivot.rate", "upper": 9.0, "penalty": 10.0}],
    "mpc": {"rate": 50, "horizon": 1.6, "dt": 0.08, "duration": 5.0, "plant": {"latency": 0.0}},
}


def pendulum(**mpc: Any) -> Problem:
    """The pendulum, with other values of [mpc]."""
    return problem_of_tables({**TABLES, "mpc": {**TABLES["mpc"], **mpc}}, "pendulum")
