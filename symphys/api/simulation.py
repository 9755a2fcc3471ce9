"""One motion."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from symphys.api.transcriptions import transcribed
from symphys.api.values import vector
from symphys.problem.loading import Source, load
from symphys.trajectory import Trajectory


def simulate(
    problem: Source, values: Mapping[str, ArrayLike] | None = None, /, smoothing: float = 0.0, **variables: ArrayLike
) -> Trajectory:
    """The motion of a problem, from its guess, or with other values of its variables.

    Args:
        problem: what ``load`` takes.
        values: of variables by name, such as ``solution.value``.
        smoothing: of the contacts [m/s]; 0 is the exact contact law.
        variables: the same as ``values``, for names that are words.

    Returns:
        Arrays over time, world frame, SI units; ``motion["ball.position"]`` (N + 1, 3).

    Raises:
        NotFinite: names the time step and the body where numbers stop being finite.
        SymphysError: no such variable, or numbers that do not fit.

    Example:
        >>> import symphys
        >>> motion = symphys.simulate("ball_throw", throw=[10, 0, 2])
        >>> motion["ball.position"].shape, motion.units["ball.position"]
        ((501, 3), 'm')
    """
    made = transcribed(load(problem), smoothing == 0, "casadi")
    return made.simulate(vector(made.shooting, {**(values or {}), **variables}), smoothing)
