"""The closed loop in simulated time: a controller measures a plant at every tick, and plans act once computed.

A plan that is asked for at t acts from t + latency on. Until then the plan before goes on. The solver works on one plan
at a time: ticks that come while it works are missed.
"""

from __future__ import annotations

import gc
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.mpc.controller import Controller
from symphys.mpc.planner import RecedingPlan
from symphys.mpc.plant import Plant
from symphys.types import Array

OnTick = Callable[[float], None]
"""A function of the simulated time [s]."""
MAX_KEPT_PLANS = 12
"""Largest number of plans that are kept for pictures, at equal distances."""


@dataclass(frozen=True)
class ClosedLoop:
    """The states, inputs, plans and latencies of a closed loop.

    Attributes:
        plant: that was controlled.
        controller: that did.
        time: (K + 1,) [s] of the plant's states.
        x: (K + 1, nx) states of the plant.
        u: (K, m) inputs that acted.
        asked: (T,) [s] ticks at which a plan was asked for; those that were missed are not among them.
        latency: (T,) [s] of wall time until the plan was ready.
        work: (T,) [s] of processor time, of all threads together.
        cost: (T,) of the plans.
        gained: (T,) whether the iterations lowered it.
        ticks: how many there were, with those missed.
        in_time: of how many the plan was ready before the next tick.
        plans: a few of them.
        stopped: why it ended before its time; empty.
    """

    plant: Plant
    controller: Controller
    time: Array
    x: Array
    u: Array
    asked: Array
    latency: Array
    work: Array
    cost: Array
    gained: NDArray[np.bool_]
    ticks: int
    in_time: int
    plans: tuple[RecedingPlan, ...]
    stopped: str = ""

    @property
    def share(self) -> float:
        """The share of ticks whose plan was ready before the next tick."""
        return self.in_time / max(self.ticks, 1)


class Loop:
    """A closed loop, tick by tick."""

    def __init__(self, controller: Controller, plant: Plant) -> None:
        """Plan once from the first state, before time begins."""
        self.controller, self.plant = controller, plant
        self.horizon, self.settings = controller.horizon, controller.horizon.plant
        self._rng = np.random.default_rng([self.settings.seed, 1])
        self.x, self.steps = plant.start, 0
        controller.reset()
        controller(self._measured(), 0.0)
        plan = controller.plan
        assert plan is not None
        self.acting, self.pending, self.ready = plan, plan, 0.0
        self.log: dict[str, list[float]] = {key: [] for key in ("asked", "latency", "work", "cost", "gained")}
        self.in_time, self.plans = 0, list[RecedingPlan]()
        waiting = round(self.settings.delay / plant.dt)
        self._queue: deque[Array] = deque([np.zeros(len(controller.inputs))] * waiting)
        self.states, self.inputs = [self.x], list[Array]()

    def tick(self, number: int, keep: bool) -> None:
        """Advance by one tick: request a plan unless the solver is busy, then simulate to the next tick."""
        now = number * self.horizon.tick
        if now >= self.ready - 1e-12:
            self._ask(now, keep)
        for _ in range(self.plant.substeps):
            time = self.steps * self.plant.dt
            if time >= self.ready - 1e-12:
                self.acting = self.pending
            measured = self._measured() if self.horizon.feedback else None
            self._queue.append(self.controller.command(time, measured, self.acting))
            u = self._queue.popleft()
            self.x = self.plant.step(self.x, u, time)
            self.steps += 1
            self.states.append(self.x)
            self.inputs.append(u)
            if not np.isfinite(self.x).all():
                raise SymphysError(f"the plant is not finite at {self.steps * self.plant.dt:g} s")

    def _ask(self, now: float, keep: bool) -> None:
        measured = self._measured()
        self.acting = self.pending
        began, worked = perf_counter(), process_time()
        self.controller(measured, now)
        spent, used = perf_counter() - began, process_time() - worked
        plan = self.controller.plan
        assert plan is not None
        latency = self.settings.latency
        counted = spent if latency == "measured" else used if latency == "cpu" else float(latency)
        self.pending, self.ready = plan, now + counted
        self.in_time += counted <= self.horizon.tick
        row = {"asked": now, "latency": spent, "work": used, "cost": plan.cost, "gained": plan.gained}
        for key, value in row.items():
            self.log[key].append(float(value))
        if keep:
            self.plans.append(plan)

    def _measured(self) -> Array:
        settings = self.settings
        if settings.noise == 0 and settings.rate_noise == 0:
            return self.x
        return self.controller.reader.noisy(self.x, settings.noise, settings.rate_noise, self._rng)

    def result(self, ticks: int, stopped: str) -> ClosedLoop:
        """Return the closed loop after so many ticks."""
        columns = {key: np.array(values, float) for key, values in self.log.items()}
        gained = columns.pop("gained") > 0
        return ClosedLoop(
            self.plant,
            self.controller,
            np.asarray(np.arange(len(self.states)) * self.plant.dt, float),
            np.array(self.states),
            np.array(self.inputs).reshape(len(self.inputs), -1),
            **columns,
            gained=gained,
            ticks=ticks,
            in_time=self.in_time,
            plans=tuple(self.plans),
            stopped=stopped,
        )


def close_loop(
    controller: Controller,
    plant: Plant,
    tell: OnTick = lambda time: None,
    stop: Callable[[], bool] = lambda: False,
) -> ClosedLoop:
    """Run the closed loop for the duration of [mpc].

    The collector of garbage rests meanwhile, as it should where latencies count.

    Args:
        controller: of the problem.
        plant: likewise.
        tell: is called with the simulated time [s] at every tick.
        stop: whether to end now: what happened until then is returned.
    """
    loop = Loop(controller, plant)
    count = max(round(controller.horizon.duration * controller.horizon.rate), 1)
    keep = set(np.linspace(0, count, MAX_KEPT_PLANS, endpoint=False).round().astype(int).tolist())
    resting = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        for number in range(count):
            if stop():
                return loop.result(number, "interrupted")
            try:
                loop.tick(number, number in keep)
            except SymphysError as error:
                return loop.result(number + 1, str(error))
            tell((number + 1) * controller.horizon.tick)
    finally:
        if resting:
            gc.enable()
    return loop.result(count, "")
