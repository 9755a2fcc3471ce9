"""The simulated plant of a controller: the problem with other time step, masses and values."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import casadi as ca
import numpy as np

from symphys.codegen import KernelUnavailable, ProcessorKernel, compile_program
from symphys.mpc.model import horizon_of, receding_model
from symphys.problem import Problem
from symphys.trajectory import Trajectory
from symphys.transcription.rollout import call, symbolic_rollout
from symphys.transcription.simulation import motion_of
from symphys.transcription.staged.step_program import StepArguments, step_program
from symphys.transcription.staged.tangent import Tangent
from symphys.types import Array


class Plant:
    """A simulated robot.

    Attributes:
        problem: with the plant's numbers.
        dt: [s] its time step.
        substeps: how many a tick has.
        start: (nx,) its first state.
    """

    def __init__(self, problem: Problem) -> None:
        """Compile its step; ProblemError for invalid settings in [mpc.plant]."""
        horizon = horizon_of(problem)
        self.substeps = max(math.ceil(horizon.tick / horizon.plant.dt - 1e-9), 1)
        self.dt = horizon.tick / self.substeps
        self.problem = plant_problem(problem, self.dt)
        self.rollout = symbolic_rollout(self.problem)
        arguments = StepArguments(self.rollout, Tangent(self.rollout), parameters=False)
        nx, n, m, _ = arguments.sizes
        begun = ca.Function("start", [self.rollout.z], [ca.densify(self.rollout.x0), ca.densify(self.rollout.p)])
        self.start, self.p = (np.array(part).ravel() for part in begun.call([np.zeros(int(self.rollout.z.shape[0]))]))
        self._varying = np.zeros((1, n + m + nx))
        self._inputs = slice(n, n + m)
        self._given = np.concatenate([np.zeros(2 * nx + 1), self.p, [0.0]])
        self._state, self._time = slice(0, nx), 2 * nx
        self._kernel: ProcessorKernel | None = None
        with suppress(KernelUnavailable):
            self._kernel = compile_program(step_program(arguments, True, False), threads=1, rows=1)

    def step(self, x: Array, u: Array, time: float) -> Array:
        """Return the state (nx,) a step after x (nx,), with the inputs u (m,) at a time [s]."""
        if self._kernel is None:
            put = u if self.rollout.feedback is None else np.append(u, time)
            return np.array(call(self.rollout.closed, x, put, self.p, 0.0)[0]).ravel()
        self._varying[0, self._inputs] = u
        self._given[self._state], self._given[self._time] = x, time
        return np.array(self._kernel.forward(self._varying, self._given)["after"][0])

    def motion(self, time: Array, x: Array, u: Array) -> Trajectory:
        """Return the recorded motion of states (K + 1, nx) and inputs (K, m) at times (K + 1,)."""
        return motion_of(self.rollout, time, x, u, self.p)


def plant_problem(problem: Problem, dt: float) -> Problem:
    """Return the problem of the plant, over one of its steps."""
    settings = horizon_of(problem).plant
    changed = problem.set(dict(settings.set)) if settings.set else problem
    if settings.masses != 1:
        bodies = tuple(body.heavier(settings.masses) for body in changed.parametric.bodies)
        parametric = replace(changed.parametric, bodies=bodies)
        changed = replace(changed, parametric=parametric, parameters=parametric.parameters())
    short = replace(horizon_of(changed), horizon=dt, dt=dt, smoothing=0.0)
    return receding_model(replace(changed, mpc=short))
