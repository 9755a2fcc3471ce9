"""Jacobians of a step by state and inputs: milliseconds of CPU time a step, one thread; MuJoCo's, and the plain way.

    python benchmarks/step_jacobians.py [--turns 9] [--crocoddyl PYTHON] [--only table]

Ours are exact, of the whole step with its controllers, in the robot's coordinates: ``LinearizedStep``. The plain way is
the gradient kernel with a lane for each row. MuJoCo's are ``mjd_transitionFD``, finite differences of the same robot by
our exporter, by positions, velocities, activations and controls. Crocoddyl's are analytic, of the same file, with every
foot held to the ground as a given contact: nothing is discovered there (``given_contacts.py`` says how to install it).
The box is that of ``against_mujoco.py``: 16 spheres, most pairs of which are too far apart to act.
Ways take turns; the fastest turn counts.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from against_mujoco import text
from measured_worlds import problem_of
from mujoco_runs import mujoco
from table_robot import table_problem

from symphys.codegen import compile_program
from symphys.export import mjcf
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.linearization import Linearization
from symphys.transcription.staged.linearized_step import LinearizedStep
from symphys.transcription.staged.step_program import StepArguments, step_program

STEPS, SETTLED, TURNS = 32, 0.3, 9
"""Steps of a call; [s] after which MuJoCo's are counted."""
Call = Callable[[], Any]
PROBLEMS: dict[str, Callable[[], Problem]] = {
    "table": lambda: table_problem([], STEPS),
    "walk": lambda: load_problem(find("quadruped_walk")),
    "box": lambda: problem_of(text("box", 0.01)),
}


def main() -> None:
    """A table for each robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=TURNS)
    parser.add_argument("--crocoddyl", type=Path, metavar="PYTHON", help="the Python of an environment that has it")
    parser.add_argument("--only", choices=PROBLEMS, help="one of the problems")
    turns, crocoddyl, only = vars(parser.parse_args()).values()
    for name in PROBLEMS if only is None else (only,):
        problem = PROBLEMS[name]()
        calls = {**ours(problem), **theirs(problem)}
        best = dict.fromkeys(calls, np.inf)
        for _ in range(turns):
            for way, call in calls.items():
                began = process_time()
                call()
                best[way] = min(best[way], (process_time() - began) / STEPS)
        for way, seconds in best.items():
            print(f"{name:<16} {way:<44} {1e3 * seconds:7.3f} ms a step", flush=True)
        if crocoddyl is not None and name != "box":
            with_contacts_given(problem, crocoddyl)


def ours(problem: Problem) -> dict[str, Call]:
    """By this engine: with a tape for all rows of a state, and with a lane for each row that computes all."""
    made = Linearization(symbolic_rollout(problem), threads=1, exact=True)
    z = np.concatenate([variable.guess for variable in problem.variables])
    x0, u, p = made.begun(z)
    states = [x0]
    for k in range(STEPS):
        states.append(made.step.step(k, states[-1][None], u[None, k], p, 0.0)[0])
    x, after = np.array(states[:-1]), np.array(states[1:])
    step = LinearizedStep(made.rollout, made.tangent, threads=1, exact=True, parameters=False)
    plain = compile_program(step_program(StepArguments(made.rollout, made.tangent, False), True, True), seeded=["off"])
    varying, given = step.rows(np.arange(STEPS), x, after, u[:STEPS], p, 0.0)
    n = made.tangent.size
    seeds = np.tile(np.eye(n), (STEPS, 1))
    rows = [np.repeat(each, n, axis=0) for each in (varying, given)]
    print(f"{problem.name}: {n} numbers of a state, {u.shape[1]} inputs; {step.description}")
    return {
        "by state and inputs": lambda: step.slopes(x, u[:STEPS], p, 0.0, after),
        "by state, inputs and static entries": lambda: made.step.slopes(x, u[:STEPS], p, 0.0, after),
        "the plain way: a gradient a row": lambda: plain.gradient(rows[0], seeds, rows[1]),
        "the steps alone": lambda: step.step(np.arange(STEPS), x, u[:STEPS], p, 0.0),
    }


def theirs(problem: Problem) -> dict[str, Call]:
    """By MuJoCo, on the ground."""
    text = mjcf(problem.world(), problem.initial, problem.simulation.dt, problem.name, approximate=True)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for _ in range(round(SETTLED / model.opt.timestep)):
        mujoco.mj_step(model, data)
    size = 2 * model.nv + model.na
    a, b = np.zeros((size, size)), np.zeros((size, model.nu))

    def differences(centred: bool) -> None:
        for _ in range(STEPS):
            mujoco.mjd_transitionFD(model, data, 1e-6, centred, a, b, None, None)

    return {
        f"MuJoCo, {size} numbers of a state, one-sided": lambda: differences(False),
        "MuJoCo, centred": lambda: differences(True),
    }


def with_contacts_given(problem: Problem, python: Path) -> None:
    """Print Crocoddyl's; see ``given_contacts.py``."""
    text = mjcf(problem.world(), problem.initial, problem.simulation.dt, problem.name, approximate=True)
    elbows = [joint.name for joint in problem.world().joints if joint.name.endswith("elbow")]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.xml"
        path.write_text(text, encoding="utf-8")
        command = [python, Path(__file__).with_name("given_contacts.py"), path, str(problem.simulation.dt)]
        done = subprocess.run([*command, *elbows], capture_output=True, text=True, check=True)
    way, _, seconds = done.stdout.strip().rpartition(";")
    print(f"{problem.name:<16} {way:<44} {1e3 * float(seconds):7.3f} ms a step", flush=True)


if __name__ == "__main__":
    main()
