"""What do Jacobians of a step and each part of an iteration of iLQR take?

Jacobians of a step by state and inputs: ours are exact, of the whole step with its controllers; the plain way is the
gradient kernel with a lane for each row; MuJoCo's are ``mjd_transitionFD``, finite differences of the same robot by our
exporter. Iterations: the robot of ``quadruped_walk`` on its soft feet for 1 s of 100 steps, 16 servos with a knot a
step; a hopper; an acrobot. An iteration linearises, passes back, searches along eight step lengths, and evaluates the
point that it takes. Ways take turns; the fastest turn counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from time import perf_counter, process_time
from typing import Any

import numpy as np
from bench import Call, Row, in_turns
from engines import mujoco
from measured_worlds import BENT, LEGS, balls_in_a_box, guess_of, table_problem

import symphys
from symphys.codegen import compile_program
from symphys.export import mjcf
from symphys.problem import Problem
from symphys.solvers import solver
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, StageContext
from symphys.solvers.core.point import Incumbent
from symphys.solvers.ddp.backward_pass import Bounds, backward_pass
from symphys.solvers.ddp.forward_pass import forward_pass
from symphys.solvers.ddp.iteration import LONG, STEP_LENGTHS
from symphys.solvers.methods.ilqr import Ilqr
from symphys.transcription import transcribe
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.linearization import Linearization
from symphys.transcription.staged.linearized_step import LinearizedStep
from symphys.transcription.staged.step_program import StepArguments, step_program

COLUMNS = {
    "problem": "and its size: n numbers of a state, inputs",
    "part": "what is computed",
    "cpu_ms": "milliseconds of processor time; of Jacobians for one step",
    "wall_ms": "milliseconds of the clock",
}
STEPS, WALK_STEPS = 32, 100
SETTLED = 0.3
"""MuJoCo's steps are differentiated after so long [s]."""
JACOBIANS: dict[str, Callable[[], Problem]] = {
    "table robot": lambda: table_problem([], STEPS),
    "quadruped_walk": lambda: symphys.load("quadruped_walk"),
    "16 spheres in a box": balls_in_a_box,
}
ITERATIONS = ("quadruped", "hopper_jump", "acrobot")


def rows(quick: bool = False, turns: int = 9, threads: int = 2) -> Iterator[Row]:
    """Yield Jacobians of a step, then the parts of iterations.

    Args:
        quick: the iteration of the acrobot.
        turns: calls of which the fastest counts.
        threads: of iterations; Jacobians take one.
    """
    for name, make in {} if quick else JACOBIANS.items():
        problem = make()
        size, calls = jacobians(problem)
        calls |= jacobians_there(problem) if mujoco else {}
        for row in measured(f"{name}: {size}", calls, turns):
            yield row | {key: row[key] / STEPS for key in ("cpu_ms", "wall_ms")}
    for name in ITERATIONS[-1:] if quick else ITERATIONS:
        method, first = method_of(quadruped() if name == "quadruped" else symphys.load(name), threads)
        title = f"{name}: {method.staged.steps} steps, n = {method.staged.tangent_size}, "
        title += f"{method.staged.input_size} inputs, {threads} threads"
        yield from measured(title, parts_of(method, first), turns)
        yield from measured(title, {"whole iteration": Iterations(method, first)}, turns)


def measured(problem: str, calls: dict[str, Call], turns: int) -> Iterator[Row]:
    """Yield the least processor time and the least time of the clock of each call."""
    worked = in_turns(calls, turns, process_time)
    waited = in_turns(calls, turns, perf_counter)
    for part in calls:
        yield {"problem": problem, "part": part, "cpu_ms": 1e3 * worked[part], "wall_ms": 1e3 * waited[part]}


def jacobians(problem: Problem) -> tuple[str, dict[str, Call]]:
    """Return the size of a problem and calls that take the Jacobians of STEPS steps."""
    made = Linearization(symbolic_rollout(problem), threads=1, exact=True)
    x0, u, p = made.start(guess_of(problem))
    states = [x0]
    for k in range(STEPS):
        states.append(made.step.step(k, states[-1][None], u[None, k], p, 0.0)[0])
    x, after = np.array(states[:-1]), np.array(states[1:])
    step = LinearizedStep(made.rollout, made.tangent, threads=1, exact=True, parameters=False)
    plain = compile_program(step_program(StepArguments(made.rollout, made.tangent, False), True, True), seeded=["off"])
    varying, given = step.rows(np.arange(STEPS), x, after, u[:STEPS], p, 0.0)
    n = made.tangent.size
    seeds = np.tile(np.eye(n), (STEPS, 1))
    lanes = [np.repeat(each, n, axis=0) for each in (varying, given)]
    return f"n = {n}, {u.shape[1]} inputs", {
        "Jacobians by state and inputs": lambda: step.slopes(x, u[:STEPS], p, 0.0, after),
        "Jacobians by state, inputs and static entries": lambda: made.step.slopes(x, u[:STEPS], p, 0.0, after),
        "the plain way: a gradient a row": lambda: plain.gradient(lanes[0], seeds, lanes[1]),
        "the steps without Jacobians": lambda: step.step(np.arange(STEPS), x, u[:STEPS], p, 0.0),
    }


def jacobians_there(problem: Problem) -> dict[str, Call]:
    """Return calls that take MuJoCo's, on the ground."""
    text = mjcf(problem.world(), problem.initial, problem.simulation.dt, problem.name, approximate=True)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(SETTLED / model.opt.timestep))
    size = 2 * model.nv + model.na
    a, b = np.zeros((size, size)), np.zeros((size, model.nu))

    def differences(centred: bool) -> None:
        for _ in range(STEPS):
            mujoco.mjd_transitionFD(model, data, 1e-6, centred, a, b, None, None)

    one_sided = f"MuJoCo, one-sided differences, n = {size}"
    return {one_sided: partial(differences, False), "MuJoCo, centred differences": partial(differences, True)}


def quadruped() -> Problem:
    """Return the quadruped for 1 s on 16 servos with a knot a step; it shall walk at 0.5 m/s, upright."""
    joints = {f"{leg}_{joint}": BENT.get(joint, 0.0) for leg in LEGS for joint in ("yaw", "roll", "pitch", "elbow")}
    commands = ", ".join(f"{name}.command" for name in joints)
    terms = {
        "slow": ("torso.velocity[0] - 0.5", 1.0),
        "upright": ("[rotate(torso.orientation, [0, 0, 1])[0:2], 2 * (torso.position[2] - 0.53)]", 10.0),
        "straight": ("[torso.position[1], rotate(torso.orientation, [1, 0, 0])[1]]", 1.0),
        "calm": ("[torso.velocity[1:3], torso.angular_velocity]", 0.1),
        "pose": (f"[{commands}] - {list(joints.values())}", 0.1),
    }
    knots = {"knots": WALK_STEPS, "interpolation": "constant", "lower": -2.0, "upper": 2.0, "scale": 0.1}
    simulation = {"duration": WALK_STEPS / 100, "dt": 0.01, "sweeps": 20, "cuts": 0, "time_of_impact": False}
    return symphys.load(
        {
            "simulation": simulation,
            "include": [{"file": "robots/table_robot.toml"}],
            "ground": {"friction": 0.8},
            "pair": [{"between": ["feet", "ground"], "frequency": 15, "damping": 1}],
            "variable": [
                {"name": f"{name}_knots", "sets": f"{name}.command", "guess": angle} | knots
                for name, angle in joints.items()
            ],
            "cost": [
                {"name": name, "at": "always", "squares": formula, "weight": weight}
                for name, (formula, weight) in terms.items()
            ],
        }
    )


def method_of(problem: Problem, threads: int) -> tuple[Ilqr, Iteration[Any]]:
    """Return the method and its first iteration, from the guess."""
    shooting = transcribe(problem, threads=threads).shooting
    evaluator = CountingEvaluator(shooting, 0.0, Incumbent(False), constraints=True)
    context = StageContext(evaluator, evaluator.clip(shooting.start(0)), 0, print)
    method = Ilqr(context, solver("ilqr").Options())
    first = method.init()
    assert isinstance(first, Iteration), first
    return method, first


def parts_of(method: Ilqr, first: Iteration[Any]) -> dict[str, Call]:
    """Return the calls of an iteration."""
    state, staged, knots = first.state, method.staged, method.knots
    motion = staged.roll_out(state.z, 0.0)
    slopes = [*staged.linearize_from_end(motion)]
    expanded = staged.expand(motion, state.multipliers, state.penalties)
    bounds = Bounds(knots.lower[:-1] - state.z, knots.upper[:-1] - state.z, method.evaluator.scale)
    policy = backward_pass(
        slopes, expanded, knots.steps, staged.statics, bounds, state.damping, compiled=staged.recursion
    )
    assert policy is not None
    lengths = STEP_LENGTHS[:LONG]
    motions = forward_pass(staged, motion, policy, knots, lengths)
    return {
        "motion": lambda: staged.roll_out(state.z, 0.0),
        "Jacobians": lambda: [*staged.linearize_from_end(motion)],
        "slopes and curvature of costs": lambda: staged.expand(motion, state.multipliers, state.penalties),
        "backward pass": lambda: backward_pass(
            slopes, expanded, knots.steps, staged.statics, bounds, state.damping, compiled=staged.recursion
        ),
        "Jacobians and backward pass": lambda: backward_pass(
            staged.linearize_from_end(motion),
            expanded,
            knots.steps,
            staged.statics,
            bounds,
            state.damping,
            compiled=staged.recursion,
        ),
        f"forward pass of {LONG}": lambda: forward_pass(staged, motion, policy, knots, lengths),
        f"costs of {LONG} motions": lambda: staged.measure(*motions[:3]),
        "one rollout of the evaluator": lambda: method.evaluator.value(state.z),
    }


class Iterations:
    """Iterations one after the other; each begins the Jacobians of the next."""

    def __init__(self, method: Ilqr, first: Iteration[Any]) -> None:
        """Begin at the first iteration."""
        self.method, self.state = method, first.state

    def __call__(self) -> None:
        """Do the next iteration."""
        found = self.method.step(self.state)
        assert isinstance(found, Iteration), found
        self.state = found.state
