"""Model predictive control: a measured state in, a command out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from symphys.errors import SymphysError
from symphys.model.state_layout import input_columns
from symphys.mpc.planner import Planner, RecedingPlan
from symphys.problem import Problem, RecedingHorizon
from symphys.problem.problem import Source, load
from symphys.transcription.state_reader import StateReader
from symphys.types import Array

State = ArrayLike | Mapping[str, ArrayLike]
"""A measured state: (nx,), or quantities by name."""


class Controller:
    """Model predictive control of a problem with a table [mpc].

    Each call takes a measured state and returns a command. It shifts the last plan to the current time and to this
    state, improves it by iterations of iLQR, and returns its first inputs. Plans respect the bounds of the variables.
    Costs and constraints count from the current time to the end of the horizon, targets at its end.

    Attributes:
        problem: the problem that is controlled.
        horizon: its table [mpc].
        inputs: the name of each entry of a command: ``elbow.command``, ``ball.force[2]``.
        plan: the last plan; None before the first call.

    Example:
        >>> import symphys
        >>> controller = symphys.Controller("acrobot")
        >>> state = {"shoulder.angle": 0.1, "elbow.angle": 0, "shoulder.rate": 0, "elbow.rate": 0}
        >>> command = controller(state, time=0.0)
        >>> controller.inputs, command.shape
        (('elbow.command',), (1,))
    """

    def __init__(self, problem: Source, threads: int | None = None) -> None:
        """Compile the model.

        Args:
            problem: any argument of ``load``.
            threads: number of threads that share the steps of a plan; None: one for each processor.

        Raises:
            ProblemError: there is no [mpc], or the problem cannot have a receding horizon.
        """
        self.problem: Problem = load(problem)
        self._planner = Planner(self.problem, threads)
        self.horizon: RecedingHorizon = self._planner.horizon
        rollout = self._planner.rollout
        self.reader = StateReader(self._planner.tangent, self._planner.p)
        columns = input_columns(rollout.world, rollout.inputs)
        self.inputs: tuple[str, ...] = tuple(
            name if part.stop - part.start == 1 else f"{name}[{k}]"
            for name, part in columns.items()
            for k in range(part.stop - part.start)
        )
        self.plan: RecedingPlan | None = None

    @property
    def start(self) -> Array:
        """The first state (nx,) of the problem."""
        return self._planner.start

    @property
    def planner(self) -> Planner:
        """The planner, which optimises over the horizon."""
        return self._planner

    def __call__(self, state: State, time: float) -> Array:
        """Plan from a measured state and return the command (m,).

        If the model is not finite from the measured state, the previous plan is used until its horizon ends.

        Args:
            state: the state vector (nx,), or coordinates and rates by name, as ``state_names`` lists them.
            time: the time of the measurement [s], not before that of the last call. The first call takes longer, since
                it plans from the guess.

        Returns:
            The inputs (m,) in the order of ``inputs``, in the units of their motors, or N and N m, world frame.

        Raises:
            SymphysError: the state does not fit, the time decreases, or no plan is finite.
        """
        plan = self.plan
        if plan is not None and time < plan.time:
            raise SymphysError(f"the time {time:g} s is before that of the last plan, {plan.time:g} s; call reset()")
        x = self.reader(state, self.start if plan is None else plan.x[plan.step(time)])
        made = self._planner.first(x, time) if plan is None else self._planner.next(plan, x, time)
        if np.isfinite(made.v).all() and np.isfinite(made.x).all():
            self.plan = made
        elif plan is not None and time < plan.time + self.horizon.horizon:
            self.plan = replace(plan, gained=False)
        else:
            raise SymphysError(f"the plan at {time:g} s is not finite: the model does not bear the measured state")
        return self.command(time)

    def command(self, time: float, state: State | None = None, plan: RecedingPlan | None = None) -> Array:
        """Return the command (m,) of a plan at a time between two calls.

        Args:
            time: the time [s].
            state: the state measured at this time, to whose deviation the gains of the plan respond; None: as planned.
            plan: the plan; None: the last.

        Raises:
            SymphysError: there is no plan yet.
        """
        plan = self.plan if plan is None else plan
        if plan is None:
            raise SymphysError("there is no plan yet; call the controller with a state and a time first")
        k = plan.step(time)
        v = plan.v[k]
        if state is not None:
            share = min(max((time - plan.time) / plan.dt - k, 0.0), 1.0)
            about = (1 - share) * plan.x[k] + share * plan.x[k + 1]
            x = self.reader(state, about)
            off = self._planner.tangent.difference(about[None], x[None], self._planner.p)[0]
            v = np.clip(v + plan.back[k] @ off, self._planner.lower, self._planner.upper)
        return np.asarray(self._planner.weights @ v)

    @property
    def state_names(self) -> dict[str, int]:
        """The quantities of a state by name, and the number of entries of each."""
        return dict(self.reader.sizes)

    def reset(self) -> None:
        """Discard the plan: the next call plans from the guess."""
        self.plan = None
