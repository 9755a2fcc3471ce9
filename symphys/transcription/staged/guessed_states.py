"""States where a motion is guessed to pass: those of the guess's rollout, moved to what is named."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.dynamics.observation import joint_quantities
from symphys.model.state_layout import Layout
from symphys.problem import GuessedMotion
from symphys.transcription.staged.columns import ByColumns
from symphys.transcription.staged.staged_problem import RolloutStages

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def guessed_states(stages: RolloutStages, guess: GuessedMotion, z: Array, ticks: Indices, smoothing: float) -> Array:
    """(M, nx) at the ticks (M,), each at least 1.

    What is named, and its rate, is moved along the tangent, so that joints stay closed; all else is that of the rollout
    of z (n,), of its first step from where on it is not finite.
    """
    moved, dt = stages.roll_out(z, smoothing).x, stages.rollout.dt
    states, times = moved[ticks], np.asarray(ticks * dt, float)
    states[~np.isfinite(states).all(axis=1)] = moved[1]
    off, names = np.zeros((len(ticks), stages.tangent_size)), list(stages.tangent.names)
    now = _quantities(stages, guess, states, z)
    for name in guess.columns:
        owner, _, field = name.rpartition(".")
        ahead = guess.at(name, times) - now[name]
        for k, column in enumerate(ahead.T):
            off[:, names.index(f"{owner}.{_field(field, names, owner)}[{k}]")] = column
        rate = f"{owner}.{'velocity' if field == 'position' and f'{owner}.velocity' in now else 'rate'}"
        if field in ("angle", "position") and rate not in guess.columns:
            for k, column in enumerate((guess.rate(name, times, dt) - now[rate]).T):
                off[:, names.index(f"{rate}[{k}]")] = column
    return stages.retract(states, off)


def _field(field: str, names: list[str], owner: str) -> str:
    """What the tangent calls a quantity."""
    return "coordinate" if field in ("angle", "position") and f"{owner}.coordinate[0]" in names else field


def _quantities(stages: RolloutStages, guess: GuessedMotion, states: Array, z: Array) -> dict[str, Array]:
    """(M, components) of all quantities of the owners of what is guessed."""
    rollout = stages.rollout
    layout = Layout(rollout.world)
    x, p = ca.SX.sym("x", layout.size), ca.SX.sym("p", int(rollout.p.shape[0]))
    owners = {name.rpartition(".")[0] for name in guess.columns}
    found = {name: x[layout[name]] for name in layout.names() if name.rpartition(".")[0] in owners}
    found |= {n: v for n, v in joint_quantities(rollout.world, x).items() if n.rpartition(".")[0] in owners}
    symbols = ca.vertcat(ca.SX(0, 1), *rollout.parameters.symbols)
    values = [ca.densify(ca.substitute(ca.SX(value), symbols, p)) for value in found.values()]
    function = ByColumns(ca.Function("named", [x, p], values))
    parameters = np.tile(stages.parameters(z[None]), (len(states), 1))
    rows = function(states[:, : layout.size].T, parameters.T)
    return {name: row.T for name, row in zip(found, rows, strict=True)}
