"""Run folders that no engine has made: motions from simple formulas, results from made-up numbers."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.walker import SCENE, write_walker

from symphys.results.scene import Scene, read_scene
from symphys.results.trajectories import read_trajectory
from symphys.trajectory import Trajectory

Arrays = dict[str, Any]
GRAVITY, BOUNCE, RADIUS = 9.81, 0.5, 0.5
VERSIONS = {"symphys": "0.1.0", "python": "3.11.7", "casadi": "3.8.2", "platform": "Linux-x86_64"}


def recorded(dt: float, names: list[str], position: Any, velocity: Any, spin: Any, **more: Any) -> Arrays:
    """The arrays of trajectory.npz; orientations follow from angular velocities about a fixed axis."""
    count, bodies = position.shape[:2]
    angle = np.cumsum(np.linalg.norm(spin, axis=2), axis=0) * dt
    axis = spin / np.maximum(np.linalg.norm(spin, axis=2, keepdims=True), 1e-12)
    orientation = np.concatenate([np.cos(angle / 2)[..., None], np.sin(angle / 2)[..., None] * axis], axis=2)
    still = {"force": np.zeros((count - 1, bodies, 3)), "torque": np.zeros((count - 1, bodies, 3))}
    states = {"position": position, "orientation": orientation, "velocity": velocity, "angular_velocity": spin}
    return {"time": dt * np.arange(count), "body_names": np.array(names), **states, **still, **more}


def throw(velocity: tuple[float, float, float], spin: float, steps: int = 500, dt: float = 0.01) -> Arrays:
    """A ball thrown from 1.5 m that bounces, slips and rolls."""
    p, v, w = np.array([0, 0, 1.5]), np.array(velocity), np.array([0.0, spin, 0.0])
    rows, forces = [(p, v, w)], []
    for _ in range(steps):
        v, impulse = v - [0, 0, GRAVITY * dt], np.zeros(3)
        if p[2] + dt * v[2] < RADIUS and v[2] < 0:
            impulse[2] = -v[2] * (1 + BOUNCE * (v[2] < -0.3))
            slip = v[:2] - RADIUS * np.array([w[1], -w[0]])
            slide = min(1.0, 0.8 * impulse[2] / max(float(np.linalg.norm(slip)) * 2 / 7, 1e-12))
            impulse[:2] = -slide * slip * 2 / 7
            w = w + np.array([impulse[1], -impulse[0], 0]) / (0.4 * RADIUS)
            v = v + impulse
        p = p + dt * v
        rows.append((p, v, w))
        forces.append(impulse / dt)
    p, v, w = (np.array([row[i] for row in rows])[:, None] for i in range(3))
    gap = p[:, :, 2] - RADIUS
    contact = {"contact_names": np.array(["ball-ground"]), "contact_force": np.array(forces)[:, None]}
    return recorded(dt, ["ball"], p, v, w, **contact, contact_gap=gap)


def push(strength: float, steps: int = 480) -> Arrays:
    """Two balls in the plane without ground; a force that fades drives the first into the second."""
    dt, mass_radius = 1 / steps, 0.2
    force = strength * np.exp(-np.linspace(0, 3, steps))[:, None] * [1, 1, 0]
    p, v, rows, hits = np.array([[-2.0, -2, 0], [-1, -1, 0]]), np.zeros((2, 3)), [], []
    rows.append((p, v))
    for k in range(steps):
        v = v + dt * np.array([force[k], np.zeros(3)])
        apart, swap = p[0] - p[1], np.zeros(3)
        if np.linalg.norm(apart) < 2 * mass_radius and (v[0] - v[1]) @ apart < 0:
            swap, v = v[1] - v[0], v[::-1]
        p = p + dt * v
        rows.append((p, v))
        hits.append(swap / dt)
    p, v = (np.array([row[i] for row in rows]) for i in range(2))
    gap = np.linalg.norm(p[:, 0] - p[:, 1], axis=1)[:, None] - 2 * mass_radius
    contact = {"contact_names": np.array(["cue-eight"]), "contact_force": np.array(hits)[:, None], "contact_gap": gap}
    pushed = np.stack([force, np.zeros((steps, 3))], axis=1)
    return recorded(dt, ["cue", "eight"], p, v, np.zeros_like(p), **{**contact}) | {"force": pushed}


BALL_SCENE = {
    "bodies": [{"name": "ball", "shapes": [{"kind": "sphere", "radius": RADIUS, "centre": [0, 0, 0]}]}],
    "planes": [{"name": "ground", "normal": [0, 0, 1], "offset": 0.0}],
}
TABLE_SCENE = {
    "bodies": [
        {"name": name, "shapes": [{"kind": "sphere", "radius": 0.2, "centre": [0, 0, 0]}]} for name in ("cue", "eight")
    ],
    "planes": [],
}


def trace(iterations: int, rng: np.random.Generator, price: float, end: float) -> list[dict[str, float]]:
    """A plausible descent from 100 to about ``end``."""
    share = np.linspace(0, 1, iterations + 1)
    objective = 100 * (end / 100) ** share * np.exp(0.4 * rng.standard_normal(iterations + 1) * (1 - share))
    best = np.minimum.accumulate(objective)
    return [
        {
            "iteration": k,
            "rollouts": k + 1,
            "gradients": k + 1 if price else 0,
            "jacobians": 0,
            "hessians": 0,
            "seconds": 2e-3 * k * (1 + price),
            "objective": objective[k],
            "best": best[k],
            "miss": 30 * np.sqrt(objective[k]),
            "gradient_norm": np.sqrt(objective[k]) if price else np.nan,
            "step": 0.1 / (k + 1),
            "smoothing": 0.0,
            "equivalents": (k + 1) * (1 + price),
        }
        for k in range(iterations + 1)
    ]


def result(problem: str, title: str, solver: str, seed: int, rows: list[dict[str, float]], z: Any) -> dict[str, Any]:
    """The object of result.json for a trace."""
    last = rows[-1]
    errors = {"comes to rest at 10 m": 0.3 * last["miss"] / 30, "stands still": 0.01 * last["miss"], "no spin": 0.0}
    checks = [
        {"kind": "target", "name": name, "error": error, "tolerance": 0.01, "met": bool(error <= 0.01)}
        for name, error in errors.items()
    ]
    solved = all(check["met"] for check in checks)
    return {
        "format": 1, "problem": problem, "title": title, "solver": solver, "seed": seed, "solved": solved,
        "status": "met" if solved else "budget", "advice": "" if solved else "Give it more iterations.",
        "objective": last["best"], "costs": {"effort": 0.3}, "checks": checks, "z": z, "iterations": len(rows) - 1,
        "counts": {key: int(last[key]) for key in ("rollouts", "gradients", "jacobians", "hessians")},
        "price": {"gradient": 3.1, "jacobian": 4.0, "hessian": 12.0}, "equivalents": last["equivalents"],
        "seconds": {"build": 0.41, "compile": 0.0, "solve": last["seconds"]},
        "trust": {
            "gradient": [{"variable": name, "error": 3.2e-8, "scale": 0.2, "step": 1e-6} for name in z],
            "refined": [
                {"what": "dt / 2", "objective": 1.31e-5, "worst": 0.31},
                {"what": "sweeps x 2", "objective": 1.2e-5, "worst": 1.4},
            ],
            "residual": 1e-9, "impulse": 0.5, "deepest": 1e-5, "size": 0.3, "multiple_impacts": 2, "steps": 500,
        },
        "versions": VERSIONS, "when": "2026-11-21T12:00:00+00:00", "command": f"symphys solve {problem}.toml --seeds 5",
        "backend": {
            "name": "simd", "lanes": 8, "threads": 2, "precision": "double", "compiler": "gcc 12.2", "compiled": "warm",
            "note": "",
        },
    }  # fmt: skip


def write_run(folder: Path, found: dict[str, Any], scene: Any, motion: Arrays | None, guess: Arrays, rows: Any) -> None:
    """Write the files of a run folder."""
    folder.mkdir(parents=True)
    text = f'title = "{found["title"]}"\ndescription = "Thrown so that it stops dead."\n'
    (folder / "problem.toml").write_text(text, encoding="utf-8")
    config = {"problem": found["problem"], "solver": found["solver"], "seed": found["seed"], "key": "0" * 64}
    (folder / "config.json").write_text(json.dumps({**config, "settings": {}, "options": {"iterations": 200}}))
    (folder / "result.json").write_text(json.dumps(found))
    (folder / "scene.json").write_text(json.dumps(scene))
    (folder / "log.txt").write_text("iteration 0\niteration 1\n")
    np.savez_compressed(folder / "guess.npz", **guess)
    if motion is not None:
        np.savez_compressed(folder / "trajectory.npz", **motion)
    with (folder / "trace.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def block(sets: str, value: Any, guess: Any, bound: float | None) -> dict[str, Any]:
    """One entry of "z"; ``value`` and ``guess`` are (components, knots)."""
    value = np.asarray(value, float)
    bounds = {"lower": [None if bound is None else -bound] * value.size, "upper": [bound] * value.size}
    flat = {"value": value.T.ravel().tolist(), "guess": np.broadcast_to(guess, value.shape).T.ravel().tolist()}
    return {"sets": [sets], "shape": list(value.shape), **flat, **bounds}


def write_throw(root: Path, solver: str, seed: int, iterations: int, price: float, end: float = 8e-4) -> None:
    """A run of the thrown ball."""
    rng = np.random.default_rng([seed, iterations])
    rows = trace(iterations, rng, price, end * np.exp(0.2 * rng.standard_normal()))
    speed = 4.0 + 0.1 * seed
    z = {
        "throw": block("ball.velocity", [[speed], [0], [3.2]], 0.0, 20.0),
        "spin": block("ball.angular_velocity", [[0], [-12], [0]], 0.0, None),
    }
    found = result("ball_throw", "Throw a giant soccer ball", solver, seed, rows, z)
    motion = throw((speed, 0.0, 3.2), -12.0)
    write_run(root / "ball_throw" / f"{solver}-seed{seed}", found, BALL_SCENE, motion, throw((1, 0, 0), 0), rows)


def write_failed(root: Path) -> None:
    """A run without a motion, whose numbers are not finite."""
    rows = trace(3, np.random.default_rng(0), 3.1, 50.0)
    rows[-1].update(objective=float("nan"), miss=float("inf"))
    found = result("ball_throw", "Throw a giant soccer ball", "ipopt", 0, rows, {})
    missed = {"kind": "target", "name": "comes to rest at 10 m", "error": "nan", "tolerance": 0.01, "met": False}
    found |= {"solved": False, "status": "not_finite", "objective": "nan", "checks": [missed], "trust": None}
    found |= {"advice": "The simulation broke at step 12 (ball): start from a slower throw.", "equivalents": None}
    write_run(root / "ball_throw" / "ipopt-seed0", found, BALL_SCENE, None, throw((1, 0, 0), 0), rows)


def write_push(root: Path, solver: str, seed: int) -> None:
    """A run of the two balls, with 480 knots."""
    rows = trace(60, np.random.default_rng(seed), 3.1, 1e-3)
    rows = [{**row, "objective": row["objective"] + 1.39, "best": row["best"] + 1.39} for row in rows]
    force = push(8.0)["force"][:, 0, :2].T
    found = result("two_balls", "Two balls, one push", solver, seed, rows, {"push": block("cue.force", force, 3.0, 12)})
    write_run(root / "two_balls" / f"{solver}-seed{seed}", found, TABLE_SCENE, push(8.0), push(3.0), rows)


def write_batch(root: Path) -> None:
    """Four solvers and a failure on one problem, two on another, a half-written folder and a foreign one."""
    for seed in range(5):
        write_throw(root, "gradient", seed, 44 + 5 * seed, 3.1)
        write_throw(root, "cma", seed, 500 + 150 * seed, 0.0)
    write_throw(root, "least_squares", 0, 9, 4.0)
    write_throw(root, "nelder_mead", 0, 300, 0.0, end=0.5)
    write_failed(root)
    write_push(root, "gradient", 0)
    write_push(root, "ipopt", 1)
    half = root / "two_balls" / "cma-seed0"
    half.mkdir()
    (half / "config.json").write_text('{"problem": "two_balls", "solver": "cma", "seed": 0}')
    (half / "problem.toml").write_text('title = "Two balls, one push"\n')
    (half / "result.json").write_text('{"format": 1, "problem": "two_ba')
    (root / "elsewhere").mkdir()
    (root / "elsewhere" / "result.json").write_text('["another tool"]')


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch folder, to be read only."""
    root = tmp_path_factory.mktemp("made") / "batch"
    write_batch(root)
    return root


@pytest.fixture
def batch(made: Path, tmp_path: Path) -> Path:
    """A batch folder of the test's own."""
    return Path(shutil.copytree(made, tmp_path / "batch"))


@pytest.fixture
def run_dir(made: Path, tmp_path: Path) -> Path:
    """A run folder of the test's own: the thrown ball, solved."""
    return Path(shutil.copytree(made / "ball_throw" / "gradient-seed0", tmp_path / "gradient-seed0"))


@pytest.fixture
def edit() -> Callable[..., None]:
    """Change fields of a JSON file."""

    def change(path: Path, **fields: Any) -> None:
        path.write_text(json.dumps({**json.loads(path.read_text()), **fields}))

    return change


Load = Callable[..., tuple[Trajectory, Scene]]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Write arrays and scene, and read them."""

    def do(arrays: dict[str, Any], scene: dict[str, Any] = SCENE) -> tuple[Trajectory, Scene]:
        folder = write_walker(tmp_path, arrays, scene)
        return read_trajectory(folder / "trajectory.npz"), read_scene(folder / "scene.json")

    return do
