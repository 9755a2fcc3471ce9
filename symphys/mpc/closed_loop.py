"""The closed loop in simulated time, and its record: a controller measures a plant at every tick, plans act once ready.

A plan that is asked for at t acts from t + latency on. Until then the plan before goes on. The solver works on one plan
at a time: ticks that come while it works are missed.
"""

from __future__ import annotations

import gc
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from symphys import files
from symphys.dynamics.observation import reading_function
from symphys.errors import SymphysError
from symphys.model.state_layout import Layout
from symphys.mpc.controller import Controller
from symphys.mpc.planner import RecedingPlan
from symphys.mpc.plant import Plant
from symphys.problem import PlantSettings, Target
from symphys.records import dataclass
from symphys.results.closed_loop import ClosedLoopRecord, TargetRecord
from symphys.results.file_names import PROBLEM, SCENE, TRAJECTORY
from symphys.results.scene_of_problem import make_scene
from symphys.trajectory import Trajectory
from symphys.transcription.rollout import Rollout
from symphys.types import Array

OnTick = Callable[[float], None]
"""A function of the simulated time [s]."""
MAX_KEPT_PLANS = 12
"""Largest number of plans that are kept for pictures, at equal distances."""


@dataclass(frozen=True)
class ClosedLoop:
    """The states, inputs, plans and latencies of a closed loop.

    Attributes:
        plant: the controlled plant.
        controller: of the plant.
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


MAX_VALUES = 24
"""Largest number of recorded quantities of a plan."""


def record_of(loop: ClosedLoop) -> ClosedLoopRecord:
    """Return the record of a closed loop."""
    controller, horizon = loop.controller, loop.controller.horizon
    settings = horizon.plant
    kind = settings.latency if isinstance(settings.latency, str) else f"{settings.latency:g}"
    counted = {"measured": loop.latency, "cpu": loop.work}.get(kind, np.full(len(loop.asked), _number(kind)))
    floating = controller.reader.floating
    names, actual = quantities(loop.plant.rollout, floating, loop.x, loop.plant.p)
    model, p = controller.planner.rollout, controller.planner.p
    return ClosedLoopRecord(
        problem=controller.problem.name,
        title=controller.problem.title,
        rate=horizon.rate,
        horizon=horizon.horizon,
        dt=horizon.dt,
        plant_dt=loop.plant.dt,
        duration=float(loop.time[-1]),
        iterations=horizon.iterations,
        feedback=horizon.feedback,
        plant=differences(settings),
        latency_kind=kind,
        ticks=loop.ticks,
        in_time=loop.in_time,
        median=float(np.median(counted)) if len(counted) else np.nan,
        p99=float(np.quantile(counted, 0.99)) if len(counted) else np.nan,
        worst=float(np.max(counted, initial=0.0)),
        targets=tuple(target_record(loop, target) for target in loop.plant.problem.targets),
        evaluator=controller.planner.description,
        threads=controller.planner.threads,
        stopped=loop.stopped,
        command_names=controller.inputs,
        value_names=names,
        asked=loop.asked,
        latency=loop.latency,
        work=loop.work,
        cost=loop.cost,
        gained=loop.gained.astype(float),
        command_time=loop.time[:-1],
        command=loop.u,
        plan_time=np.array([plan.time + plan.dt * np.arange(len(plan.x)) for plan in loop.plans]),
        plan_value=np.array([quantities(model, floating, plan.x, p)[1] for plan in loop.plans]),
        plan_command=np.array([plan.v @ controller.planner.weights.T for plan in loop.plans]),
        actual_time=loop.time,
        actual=actual,
    )


def _number(kind: str) -> float:
    return np.nan if kind in ("measured", "cpu") else float(kind)


def differences(settings: PlantSettings) -> str:
    """Return the differences of the plant from the model, except for its step, in words."""
    parts = [f"masses times {settings.masses:g}"] if settings.masses != 1 else []
    parts += [f"{key} = {value}" for key, value in settings.set.items()]
    if settings.noise or settings.rate_noise:
        parts.append(f"noise {settings.noise:g} m or rad and {settings.rate_noise:g} m/s or rad/s")
    if settings.delay:
        parts.append(f"commands {settings.delay:g} s late")
    return ", ".join(parts)


def target_record(loop: ClosedLoop, target: Target) -> TargetRecord:
    """Return the error of a target at the end, and how long it has been within its tolerance."""
    rollout, count = loop.plant.rollout, len(loop.x)
    u = np.concatenate([loop.u, loop.u[-1:]])
    p, z = np.tile(loop.plant.p[:, None], count), np.zeros((int(rollout.z.shape[0]), count))
    found = np.array(rollout.compiled(target.formula).map(count)(loop.x.T, u.T, p, loop.time[None], z))
    errors = np.linalg.norm(found, axis=0)
    missed = np.flatnonzero(~(errors <= target.tolerance))
    since = 0.0 if not len(missed) else float(loop.time[missed[-1]])
    return TargetRecord(target.name, float(errors[-1]), target.tolerance, float(loop.time[-1]) - since)


def quantities(rollout: Rollout, floating: Sequence[str], x: Array, p: Array) -> tuple[tuple[str, ...], Array]:
    """Return names and values (K, q) of drawn quantities: joint coordinates, positions of floating bodies."""
    world, layout = rollout.world, Layout(rollout.world)
    read = reading_function(world, rollout.parameters.symbols).map(len(x))
    coordinates = np.array(read(x[:, : layout.size].T, np.tile(p[:, None], len(x)))[0]).T.reshape(len(x), -1)
    names = [f"{joint.name}.{each.name}" for joint in world.joints for each in joint.kind.coordinates]
    columns = [x[:, layout[f"{name}.position"]] for name in floating]
    names += [f"{name}.position.{axis}" for name in floating for axis in "xyz"]
    return tuple(names[:MAX_VALUES]), np.concatenate([coordinates, *columns], axis=1)[:, :MAX_VALUES]


def write_closed_loop(loop: ClosedLoop, folder: Path) -> tuple[ClosedLoopRecord, Trajectory]:
    """Write the files of a run folder, each atomically, the record last."""
    problem = loop.plant.problem
    motion, record = loop.plant.motion(loop.time, loop.x, loop.u), record_of(loop)
    files.make_folder(folder)
    files.write_text(folder / PROBLEM, loop.controller.problem.to_toml())
    files.write_npz(folder / TRAJECTORY, motion.arrays())
    files.write_json(folder / SCENE, make_scene(problem, {}, motion).to_json())
    record.write(folder)
    return record, motion
