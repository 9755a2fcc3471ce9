"""Simulate one motion: for given values, or under the feedback of a solution."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from symphys.api.transcriptions import transcribed
from symphys.api.values import vector
from symphys.problem import Problem
from symphys.problem.problem import Source, load
from symphys.solvers.ddp.gains import Gains
from symphys.solvers.ddp.gains import follow as gains_motion
from symphys.trajectory import Trajectory
from symphys.transcription.staged.tangent import Tangent
from symphys.transcription.state_reader import StateReader


def simulate(
    problem: Source, values: Mapping[str, ArrayLike] | None = None, /, smoothing: float = 0.0, **variables: ArrayLike
) -> Trajectory:
    """Simulate a problem with its guess, or with other values of its variables.

    Args:
        problem: any argument of ``load``.
        values: values of variables by name, such as ``solution.value``: (components,), or (knots, components).
        smoothing: width of the smoothed contact laws [m/s]; 0 is the exact law.
        variables: the same as ``values``, for names that are Python words.

    Returns:
        Arrays over time, world frame, SI units: ``motion["ball.position"]`` (N + 1, 3).

    Raises:
        NotFinite: a number of the motion is not finite; names the time step and the body.
        SymphysError: there is no such variable, or the shape of its values does not fit.

    Example:
        >>> import symphys
        >>> motion = symphys.simulate("ball_throw", throw=[10, 0, 2])
        >>> motion["ball.position"].shape, motion.units["ball.position"]
        ((501, 3), 'm')
    """
    made = transcribed(load(problem), smoothing == 0, "casadi")
    return made.simulate(vector(made.shooting, {**(values or {}), **variables}), smoothing)


def follow(
    problem: Problem, gains: Gains, start: ArrayLike | Mapping[str, ArrayLike] | None, feedback: bool
) -> Trajectory:
    """Simulate from a start under the feedback gains of a solution, as ``Solution.rollout`` does.

    Args:
        problem: the problem that was solved.
        gains: the gains of its solution.
        start: quantities of the first state by name, or the whole state (nx,); None: the problem's.
        feedback: whether the gains act.
    """
    made = transcribed(problem, True, "casadi")
    assert made.shooting.staged is not None, "there are gains"
    staged, z = made.shooting.staged(), gains["z"]
    x = staged.start(z[None])[0]
    if start is not None:
        size = made.rollout.memory.size
        reader = StateReader(Tangent(made.rollout), np.array(made.rollout.parameters.nominal, float).ravel())
        whole = {**reader.values(x[:size]), **start} if isinstance(start, Mapping) else start
        x = np.concatenate([reader(whole, x[:size]), x[size:]])
    bounds = made.shooting.stacked("lower"), made.shooting.stacked("upper")
    found = gains_motion(staged, gains, x, bounds, feedback)
    return made.motion(found.z, found.x[:, : made.rollout.memory.size], found.u[:, : made.rollout.given.shape[0]])
