"""The parts of an iteration of iLQR, in milliseconds of CPU time and of wall time: a quadruped, a hopper, an acrobot.

    python benchmarks/ilqr_iteration.py [--turns 9] [--threads 2]

The quadruped is the robot of ``quadruped_walk`` on its soft feet for 1 s of 100 steps: 16 servos, a knot a step each,
shall walk at 0.5 m/s, upright. Parts take turns, and the fastest turn counts. A whole iteration linearises, passes
back, searches along eight step lengths, and evaluates the point that it takes.
"""

from __future__ import annotations

import argparse
import resource
from collections.abc import Callable
from time import perf_counter, process_time
from typing import Any

import numpy as np
from table_robot import BENT, LEGS

import symphys
from symphys.problem import Problem
from symphys.solvers import solver
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, StageContext
from symphys.solvers.core.point import Incumbent
from symphys.solvers.ddp.backward_pass import backward_pass
from symphys.solvers.ddp.forward_pass import forward_pass
from symphys.solvers.methods.ilqr import LENGTHS, Ilqr
from symphys.transcription import transcribe

TURNS = 9
STEPS = 100
Call = Callable[[], Any]


def quadruped() -> Problem:
    """1 s on 16 servos with a knot a step."""
    joints = {f"{leg}_{joint}": BENT.get(joint, 0.0) for leg in LEGS for joint in ("yaw", "roll", "pitch", "elbow")}
    commands = ", ".join(f"{name}.command" for name in joints)
    stands = list(joints.values())
    costs = {
        "slow": ("torso.velocity[0] - 0.5", 1.0),
        "upright": ("[rotate(torso.orientation, [0, 0, 1])[0:2], 2 * (torso.position[2] - 0.53)]", 10.0),
        "straight": ("[torso.position[1], rotate(torso.orientation, [1, 0, 0])[1]]", 1.0),
        "calm": ("[torso.velocity[1:3], torso.angular_velocity]", 0.1),
        "pose": (f"[{commands}] - {stands}", 0.1),
    }
    return symphys.load(
        {
            "simulation": {"duration": STEPS / 100, "dt": 0.01, "sweeps": 20, "cuts": 0, "time_of_impact": False},
            "include": [{"file": "robots/table_robot.toml"}],
            "ground": {"friction": 0.8},
            "pair": [{"between": ["feet", "ground"], "frequency": 15, "damping": 1}],
            "variable": [
                {
                    "name": f"{name}_knots",
                    "sets": f"{name}.command",
                    "knots": STEPS,
                    "interpolation": "constant",
                    "guess": angle,
                    "lower": -2.0,
                    "upper": 2.0,
                    "scale": 0.1,
                }
                for name, angle in joints.items()
            ],
            "cost": [
                {"name": name, "at": "always", "squares": formula, "weight": weight}
                for name, (formula, weight) in costs.items()
            ],
        }
    )


def main() -> None:
    """A table for each robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=TURNS)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("robots", nargs="*", default=["quadruped", "hopper_jump", "acrobot"])
    given = parser.parse_args()
    for name in given.robots:
        problem = quadruped() if name == "quadruped" else symphys.load(name)
        method, start = method_of(problem, given.threads)
        staged = method.staged
        sizes = f"{staged.steps} steps, tangent {staged.tangent_size}, {staged.input_size} inputs"
        print(f"\n{name}: {sizes}, {len(start.state.z)} entries of z, {given.threads} threads")
        parts = measured(parts_of(method, start), given.turns)
        parts |= measured({"whole iteration": Going(method, start)}, given.turns)
        for part, (cpu, wall) in parts.items():
            print(f"  {part:<32} {1e3 * cpu:8.2f} ms of CPU time {1e3 * wall:8.2f} ms", flush=True)
    print(f"\nlargest memory: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


def method_of(problem: Problem, threads: int) -> tuple[Ilqr, Iteration[Any]]:
    """The method and its first iteration, from the guess."""
    shooting = transcribe(problem, threads=threads).shooting
    evaluator = CountingEvaluator(shooting, 0.0, Incumbent(False), constraints=True)
    context = StageContext(evaluator, evaluator.clip(shooting.start(0)), 0, print)
    method = Ilqr(context, solver("ilqr").Options())
    first = method.init()
    assert isinstance(first, Iteration), first
    return method, first


def parts_of(method: Ilqr, first: Iteration[Any]) -> dict[str, Call]:
    """What an iteration does, call by call."""
    state, staged, knots = first.state, method.staged, method.knots
    motion = staged.roll_out(state.z, 0.0)
    slopes = [*staged.linearize_from_end(motion)]
    costs = staged.expand(motion, state.multipliers, state.penalties)
    bounds = method._room(state.z)
    policy = backward_pass(slopes, costs, knots, staged.statics, bounds, state.damping)
    assert policy is not None
    motions = forward_pass(staged, motion, policy, method.padded, LENGTHS)
    return {
        "motion": lambda: staged.roll_out(state.z, 0.0),
        "slopes": lambda: [*staged.linearize_from_end(motion)],
        "costs": lambda: staged.expand(motion, state.multipliers, state.penalties),
        "backward pass": lambda: backward_pass(slopes, costs, knots, staged.statics, bounds, state.damping),
        "slopes and backward pass": lambda: backward_pass(
            staged.linearize_from_end(motion), costs, knots, staged.statics, bounds, state.damping
        ),
        "forward pass of 8": lambda: forward_pass(staged, motion, policy, method.padded, LENGTHS),
        "their costs": lambda: staged.measure(*motions),
        "one rollout of the evaluator": lambda: method.evaluator.value(state.z),
    }


class Going:
    """One iteration after the other: each begins the slopes of the next."""

    def __init__(self, method: Ilqr, first: Iteration[Any]) -> None:
        """From the first one."""
        self.method, self.state = method, first.state

    def __call__(self) -> None:
        """One more."""
        found = self.method.step(self.state)
        assert isinstance(found, Iteration), found
        self.state = found.state


def measured(calls: dict[str, Call], turns: int) -> dict[str, tuple[float, float]]:
    """[s] of CPU time and of wall time, the least of each."""
    best = dict.fromkeys(calls, (np.inf, np.inf))
    for _ in range(turns):
        for part, call in calls.items():
            cpu, wall = process_time(), perf_counter()
            call()
            spent = process_time() - cpu, perf_counter() - wall
            best[part] = min(best[part][0], spent[0]), min(best[part][1], spent[1])
    return best


if __name__ == "__main__":
    main()
