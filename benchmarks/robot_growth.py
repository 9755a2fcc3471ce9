"""How the adjoint of a robot that trots on the spot grows, by how instants of touch are taken.

    python benchmarks/robot_growth.py

Sixteen random gradients with respect to the torso's place and velocity at the end go back through all steps, context as
long as one after each; the growth is the product of what the longest gained in each, in decades. 10 ms, 20 sweeps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from table_robot import table_problem

from symphys.codegen import Kernel, compile_program
from symphys.model.state_layout import Layout
from symphys.transcription import symbolic_rollout
from symphys.transcription.network_rollout.context import RolloutObjectives, start_function
from symphys.transcription.rollout import Rollout
from symphys.types import Array

STEPS = 300
DIRECTIONS = 16
STEEP = 10.0
"""Steps in which the adjoint grows more than tenfold are counted."""


def main() -> None:
    """One line for each motion."""
    for toi, cuts, stride in ((False, 0, 0.1), (True, 0, 0.1), (True, 1, 0.1), (False, 0, 0.0), (True, 0, 0.0)):
        growth = np.log10(grown(*rollout_of(toi, cuts, stride)))
        motion = (
            f"instants of touch {'exact' if toi else 'ignored'}, {cuts} cuts, {'trotting' if stride else 'standing'}"
        )
        steep = f"{np.sum(growth > np.log10(STEEP))} steps of {STEPS} more than tenfold"
        print(f"{motion:<50} 10^{growth.sum():5.1f}; {steep}, at most {10 ** growth.max():.0f}", flush=True)


def rollout_of(toi: bool, cuts: int, stride: float) -> tuple[Rollout, Kernel]:
    """The robot, its net without effect, and the kernel of one step."""
    problem = table_problem([], STEPS, stride=stride, toi=toi)
    simulation = replace(problem.simulation, cuts=cuts)
    rollout = symbolic_rollout(replace(problem, simulation=simulation))
    program = RolloutObjectives(rollout).stage(rollout, []).program(exact=False)
    return rollout, compile_program(program, seeded=["after"], threads=1)


def grown(rollout: Rollout, kernel: Kernel) -> Array:
    """(steps,): by how much the longest of the adjoints grows in each step, the last step first."""
    rows, layout = visited(rollout, kernel), Layout(rollout.world)
    adjoints = np.zeros((DIRECTIONS, int(rollout.x0.shape[0])))
    ends = np.r_[layout["torso.position"], layout["torso.velocity"]]
    adjoints[:, ends] = np.random.default_rng(0).normal(size=(DIRECTIONS, len(ends)))
    adjoints /= np.linalg.norm(adjoints, 2)
    found = np.empty(len(rows))
    for k, row in enumerate(reversed(rows)):
        before = kernel.gradient(np.tile(row, (DIRECTIONS, 1)), adjoints, [0.0])[1][:, : adjoints.shape[1]]
        found[k] = np.linalg.norm(before, 2)
        adjoints = before / found[k]
    return found


def visited(rollout: Rollout, kernel: Kernel) -> list[Array]:
    """What each step starts from, weights zero, the torso pushed a little."""
    z = np.concatenate([0 * rollout.problem.variables[0].guess, [0.02, -0.01, 0.03]])
    x, _, p, _ = (part.full().ravel() for part in start_function(rollout, [])(z))
    rows, still = list[Array](), np.zeros(int(rollout.given.shape[0]))
    for k in range(STEPS):
        times = np.array([k, k + 1]) * rollout.dt
        rows.append(np.concatenate([x, still, p, times, z]))
        x = kernel.forward(rows[-1], [0.0])["after"][0]
    return rows


if __name__ == "__main__":
    main()
