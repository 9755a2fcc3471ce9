"""A controller: state in, command out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from symphys.errors import SymphysError
from symphys.model.state_layout import input_columns
from symphys.mpc.planner import Planner, RecedingPlan
from symphys.problem import Problem, RecedingHorizon
from symphys.problem.loading import Source, load
from symphys.transcription.feedback.state_reader import StateReader
from symphys.types import Array

State = ArrayLike | Mapping[str, ArrayLike]


class Controller:
    """Model predictive control of a problem with a table [mpc].

    Each call measures, plans and commands: the last plan is shifted to now and begins at the measured state; iterations
    of iLQR improve it; the command is what it does first. Plans keep the bounds of the variables. Costs and constraints
    count from now to the end of the horizon, targets at its end.

    Attributes:
        problem: what it controls.
        horizon: its [mpc].
        inputs: names of the commands, one for each number: ``elbow.command``, ``ball.force[2]``.
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
            problem: what ``load`` takes.
            threads: that share the steps of a plan; None: one for each processor.

        Raises:
            ProblemError: there is no [mpc], or a receding horizon makes no sense for the problem.
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
        """(nx,) the first state of the file."""
        return self._planner.start

    @property
    def planner(self) -> Planner:
        """What plans."""
        return self._planner

    def __call__(self, state: State, time: float) -> Array:
        """RecedingPlan from a measured state, and command.

        Args:
            state: (nx,) the state of this engine, or coordinates and rates by name: see ``state_names``.
            time: [s], not before that of the last call; the first call takes longer, since it plans from the guess.

        Where the model is not finite from the measured state, the plan before goes on, as far as it reaches.

        Returns:
            (m,) the inputs from now on, in the order of ``inputs``, in the units of their motors, or N and N m.

        Raises:
            SymphysError: a state that does not fit, a time that goes back, a model that does not stay finite.
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
        """(m,) what a plan commands at a time, between ticks or after its own.

        Args:
            time: [s].
            state: as measured then: the command answers it by the gains of the plan; None: as planned.
            plan: None: the last.
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
        """What a state by name has, and how many numbers each is; see ``StateReader``."""
        return dict(self.reader.sizes)

    def reset(self) -> None:
        """Forget the plan: the next call plans from the guess."""
        self.plan = None
