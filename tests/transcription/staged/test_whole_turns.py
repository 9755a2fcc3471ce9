"""States of joints that turn far: tangents and solvers over states count whole turns."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few

import symphys
from symphys.dynamics.observation import reading_function
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.linearization import Linearization
from symphys.transcription.state_reader import StateReader

FAR = 20.0
"""[rad]: more than three turns."""


def wheel(**joint: Any) -> dict[str, Any]:
    """Tables of a wheel that a motor turns by ``FAR`` in a second, from and to rest, against a spring."""
    return {
        "simulation": {"duration": 1.0, "dt": 0.1},
        "world": {"gravity": [0, 0, 0]},
        "body": [{"name": "wheel", "shape": {"sphere": {"radius": 0.15}}, "mass": 1.0, "inertia": 0.01}],
        "joint": [
            {
                "name": "axle",
                "between": ["world", "wheel"],
                "hinge": {"axis": [0, 1, 0]},
                "point": [0, 0, 0],
                "motor": {"torque": {"torque": 10}},
                "spring": {"stiffness": 0.01, "rest": -4},
                **joint,
            }
        ],
        "variable": [{"name": "twist", "sets": "axle.command", "knots": 10, "guess": 0.0, "scale": 0.5}],
        "cost": [{"name": "effort", "at": "always", "squares": "axle.command"}],
        "target": [{"name": "there", "value": f"[axle.angle - {FAR}, axle.rate]", "tolerance": 0.2}],
    }


@few("joint", [{}, {"frequency": 30.0}], ids=["tree", "soft"], count=1)
def test_tangents_go_through_whole_turns(joint: dict[str, Any]) -> None:
    """A state that is d away has an angle that is d more, and the difference of states of a rollout leads there."""
    problem = symphys.load(wheel(**joint))
    made = Linearization(symbolic_rollout(problem), "casadi")
    tangent, p = made.tangent, made.start(np.zeros(10))[2]
    read = reading_function(problem.world())

    def angle(x: np.ndarray) -> float:
        return float(ca.DM(read(x, p)[0]))

    x0, u, _ = made.start(np.full(10, 3.0))
    states = [x0]
    for k in range(10):
        states.append(made.step.step(k, states[-1][None], u[None, k], p, 0.0)[0])
    assert angle(states[-1]) > 2 * FAR
    first, last = states[3][None], states[-1][None]
    there = tangent.retract(first, tangent.difference(first, last, p), p)
    assert angle(there[0]) == pytest.approx(angle(states[-1]), abs=1e-12)
    after = [made.step.step(0, x, u[None, 0], p, 0.0)[0] for x in (there, last)]
    assert angle(after[0]) == pytest.approx(angle(after[1]), abs=1e-12)
    if not joint:
        d = np.zeros((1, tangent.size))
        d[0, tangent.names.index("axle.coordinate[0]")] = -FAR
        assert angle(tangent.retract(first, d, p)[0]) == pytest.approx(angle(states[3]) - FAR, abs=1e-12)


def test_measured_angles_count_turns() -> None:
    made = Linearization(symbolic_rollout(symphys.load(wheel())), "casadi")
    x0, _, p = made.start(np.zeros(10))
    reader = StateReader(made.tangent, p)
    for angle in (FAR, -FAR, 4.0):
        measured = reader({"axle.angle": angle, "axle.rate": 1.0}, x0)
        assert reader.values(measured)["axle.angle"] == pytest.approx(angle, abs=1e-12)


@few("solver", ["ilqr", "multiple_shooting"], 1)
def test_solvers_over_states_swing_through_turns(solver: str) -> None:
    """The optimum of a linear system: that of least squares, which knows nothing of states."""
    solution = symphys.solve(wheel(), solver=solver, backend="casadi")
    assert solution.solved
    angle, command = (solution.trajectory[f"axle.{name}"].ravel() for name in ("angle", "command"))
    assert angle[-1] == pytest.approx(19.9796, abs=1e-3)
    assert command[:3] == pytest.approx([1.10497, 0.904398, 0.694805], abs=1e-4)
