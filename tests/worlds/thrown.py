"""A ball that is thrown and pushed, as the tables of a problem file."""

from __future__ import annotations

from typing import Any

TABLES: dict[str, Any] = {
    "simulation": {"duration": 0.5, "dt": 0.02},
    "body": [{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 0.5, "position": [0, 0, 1]}],
    "ground": {"friction": 0.4},
    "variable": [
        {"name": "throw", "sets": "ball.velocity", "guess": [1, 0, 1], "spread": 0.1},
        {"name": "push", "sets": "ball.force[0]", "knots": 3, "lower": -5, "upper": 5},
    ],
    "target": [{"name": "there", "value": "ball.position - [1, 0, 0.3]", "tolerance": 0.01}],
    "cost": [{"name": "effort", "at": "always", "squares": "push", "weight": 1e-4}],
    "output": [{"name": "height", "value": "ball.position[2]", "unit": "m"}],
    "objective": {"stop": "met"},
}
