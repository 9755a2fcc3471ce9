"""A cart on a rail that a controller drives below a falling ball, as the tables of a problem file."""

from __future__ import annotations

from typing import Any

TABLES: dict[str, Any] = {
    "simulation": {"duration": 0.4, "dt": 0.02},
    "body": [
        {"name": "cart", "shape": {"sphere": {"radius": 0.1}}, "mass": 1, "position": [0, 0, 0.5]},
        {"name": "ball", "shape": {"sphere": {"radius": 0.05}}, "mass": 0.2, "position": [0.05, 0, 0.645]},
    ],
    "ground": {"friction": 0.4},
    "joint": [
        {
            "name": "rail",
            "between": ["world", "cart"],
            "slider": {"axis": [1, 0, 0]},
            "motor": {"torque": {"torque": 20}},
        }
    ],
    "sensor": [{"name": "place", "reads": ["rail.position", "rail.rate", "ball.position[2]", "sin(time)"]}],
    "controller": [
        {"name": "hand", "drives": ["rail.command"], "senses": ["place"], "scale": 2, "linear": {}},
        {"name": "drift", "drives": ["ball.force[0]"], "periodic": {"frequency": 1, "sines": [0.3]}},
    ],
    "variable": [
        {"name": "gains", "sets": "hand.gains", "guess": [-4, -1, 2, 0.5]},
        {"name": "throw", "sets": "ball.velocity", "guess": [0.1, 0.1, -0.5]},
        {"name": "lift", "sets": "ball.force[2]", "knots": 4, "guess": [1, 0, 0.5, 0]},
    ],
    "cost": [
        {"name": "effort", "at": "always", "squares": "rail.command", "weight": 0.01},
        {"name": "away", "at": "always", "value": "(rail.position - 0.3) ** 2"},
        {"name": "half-way", "at": 0.2, "value": "rail.rate + 0.1 * rail.command"},
        {"name": "soft", "at": "end", "squares": "lift[0]", "weight": 0.2},
    ],
    "target": [{"name": "there", "value": "rail.position - 0.3", "tolerance": 0.01}],
}
"""The ball falls on the cart, which moves below it."""
