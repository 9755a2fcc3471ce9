"""One time step of a problem, compiled for batches, with the commands given from outside."""

from __future__ import annotations

from collections.abc import Sequence

from symphys.api.loading import Source, load
from symphys.api.transcriptions import stepped
from symphys.codegen.backends import NAMES, require_backend
from symphys.transcription.open_step import CompiledStep as CompiledStep


def compile_step(
    problem: Source,
    controllers: Sequence[str] | None = None,
    *,
    sensors: Sequence[str] | None = None,
    smoothing: float = 0.0,
    backend: str = "auto",
    threads: int | None = None,
) -> CompiledStep:
    """One time step of a problem, with actions in place of its controllers.

    An action is what the controllers would give, before their ``scale``: commands of motors, or forces. Other
    controllers, and what variables set over time, act besides. Observations are what the sensors read.

    Args:
        problem: what ``load`` takes.
        controllers: names of those that are left open. None: those whose numbers a variable sets, or else all; without
            any, the inputs that variables set over time; without these, the commands of all motors.
        sensors: names of those that are observed. None: those of these controllers, or else all; without any, the
            positions, orientations and velocities of all bodies are observed.
        smoothing: of the contacts [m/s]; 0 is the exact contact law.
        backend: what evaluates: "auto", "simd", "simd32", "cuda", "cuda32" or "casadi". The first adjoints of a step in
            single precision are compared with double precision; those of a chain of steps are not, and may be far off.
        threads: that share a batch; None: one for each processor.

    Raises:
        SymphysError: there is no such controller, sensor or backend, or nothing that could act.
        ProblemError: a cost looks at the numbers of a controller that is left open.

    Example:
        >>> import numpy as np, symphys
        >>> step = symphys.compile_step("cart_pole", backend="casadi")
        >>> state, observation, inputs = step.start(4)
        >>> state, observation, cost = step(state, np.ones((4, step.action_size)))
        >>> step.actions, cost.shape
        (('rail.command',), (4,))
    """
    require_backend(backend, [name for name in NAMES if name != "c"])
    named, read = (None if names is None else tuple(names) for names in (controllers, sensors))
    return stepped(load(problem), named, read, smoothing, backend, threads)
