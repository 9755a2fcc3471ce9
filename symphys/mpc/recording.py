"""The record of a closed loop, the motion of the plant, and the files of its run folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from symphys import files
from symphys.dynamics.observation import reading_function
from symphys.model.state_layout import Layout
from symphys.mpc.closed_loop import ClosedLoop
from symphys.problem import PlantSettings, Target
from symphys.results.closed_loop import ClosedLoopRecord, TargetRecord
from symphys.results.file_names import PROBLEM, SCENE, TRAJECTORY
from symphys.results.scene_of_problem import make_scene
from symphys.trajectory import Trajectory
from symphys.transcription.rollout import Rollout
from symphys.types import Array

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
