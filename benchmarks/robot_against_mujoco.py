"""A quadruped on its four feet, here and in MuJoCo: steps and derivatives per second on one core, batches of 128.

Both engines get the same robot, MuJoCo by our exporter, the same 128 initial states and the same time step. CPU time is
taken in turns, one engine after the other, several times; ratios are within a turn, so that what else the machine does
disturbs both. MuJoCo's derivative, ``mjd_transitionFD``, gives the whole matrices of a step by state and command; ours,
the adjoint of the whole rollout, gives the gradient of one number. Run with ``make bench-robots``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import process_time

import numpy as np
from consistency import FINE, Engine, Here, distance, samples
from mujoco_robots import ThereJointed, model_of, states_of
from mujoco_runs import Runs, mujoco
from robot_consistency import BATCH, EVERY, WINDOW
from robots import HELD, JointedScene, standing
from rolling import Rolling

from symphys.model.world import Scheme
from symphys.types import Array

DT = 0.01
STEPS = 50
TURNS = 7
DERIVED = 16
"""Robots whose steps are differentiated in MuJoCo, each STEPS times."""
SWEEPS = (20, 10, 5)
Call = Callable[[], object]


@dataclass(frozen=True)
class Candidate:
    """Something that is measured.

    Attributes:
        name: in the table.
        rollout, derivative: of ``steps`` steps each.
        steps: robots times steps, of the two.
        engine: the same, for its error.
    """

    name: str
    rollout: Call
    derivative: Call
    steps: tuple[int, int]
    engine: Engine


def here(scene: JointedScene, sweeps: int, batch: int, calls: int = 1) -> Candidate:
    """This engine; ``calls``: batches, one after the other, of which at most ``DERIVED`` are differentiated."""
    world = scene.world()
    kernel = Rolling(world, Scheme(dt=DT, sweeps=sweeps, cuts=0), STEPS, rows=batch).kernel
    states = np.split(scene.states(world)[: batch * calls], calls)
    seed = np.zeros(states[0].shape[1])
    seed[0] = 1.0
    alone = (", one call" if calls == 1 else ", one robot alone") if batch == 1 else ""
    name = f"symphys, {sweeps} sweeps{alone}"
    derived = states[:DERIVED]

    def rollout() -> None:
        for each in states:
            kernel.forward(each, [0.0])

    def derivative() -> None:
        for each in derived:
            kernel.gradient(each, seed, [0.0])

    return Candidate(
        name,
        rollout,
        derivative,
        (calls * batch * STEPS, len(derived) * batch * STEPS),
        Here(name, scene, sweeps=sweeps, cuts=0),
    )


def there(scene: JointedScene, integrator: str, cone: str) -> Candidate:
    """MuJoCo, one thread."""
    runs, states = Runs(model_of(scene, DT, integrator, cone)), states_of(scene)
    name = f"MuJoCo, {integrator}, {cone}"
    return Candidate(
        name,
        partial(runs.after, states, STEPS),
        partial(differentiate, runs, states[:DERIVED]),
        (len(states) * STEPS, DERIVED * STEPS),
        ThereJointed(name, scene, integrator, cone),
    )


def differentiate(runs: Runs, states: Array) -> None:
    """Every step of these rollouts, with its matrices by one-sided differences."""
    model, data = runs.model, runs.data
    n = 2 * model.nv + model.na
    a, b = np.zeros((n, n)), np.zeros((n, model.nu))
    for state in states:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state[1 : 1 + model.nq], state[1 + model.nq :]
        for _ in range(STEPS):
            mujoco.mjd_transitionFD(model, data, 1e-6, False, a, b, None, None)
            mujoco.mj_step(model, data)


def seconds(call: Call) -> float:
    """CPU time of this process."""
    began = process_time()
    call()
    return process_time() - began


def measure(candidates: Sequence[Candidate]) -> Array:
    """(TURNS, candidates, 2) seconds of a robot's step, and of its derivative; a turn before does not count."""
    turns = [
        [[seconds(call) / n for call, n in zip((c.rollout, c.derivative), c.steps, strict=True)] for c in candidates]
        for _ in range(TURNS + 1)
    ]
    return np.array(turns[1:])


def errors_of(candidates: Sequence[Candidate]) -> list[float]:
    """[m]: as ``robot_consistency``, at DT; of ours against most sweeps at the fine step, of MuJoCo against itself."""
    exact: dict[str, Array] = {}
    errors = []
    for candidate in candidates:
        engine, kind = few(candidate.engine), candidate.name if "MuJoCo" in candidate.name else "symphys"
        if kind not in exact:  # ours begin with most sweeps
            exact[kind] = samples(engine, FINE, WINDOW, EVERY)
        errors.append(float(np.median(distance(samples(engine, DT, WINDOW, EVERY), exact[kind]))))
    return errors


def few(engine: Engine) -> Engine:
    """The engine with the first few initial states."""
    return replace(engine, scene=replace(engine.scene, start=engine.scene.start[:BATCH]))  # type: ignore[type-var]


def report(title: str, candidates: Sequence[Candidate], times: Array, errors: Sequence[float]) -> None:
    """Print a table: best and median of the turns; ratios to the last candidate, MuJoCo with our law of friction."""
    print(f"\n{title}: 1000 steps/s best (median) | times MuJoCo's | 1000 derivatives/s | times MuJoCo's | error [m]")
    ratios = times[:, -1:] / times
    for k, candidate in enumerate(candidates):
        cells = []
        for what in (0, 1):
            best, middle = times[:, k, what].min(), np.median(times[:, k, what])
            fastest = times[:, -1, what].min() / best
            cells.append(
                f"{1e-3 / best:.3g} ({1e-3 / middle:.3g}) | {fastest:.3g} ({np.median(ratios[:, k, what]):.3g})"
            )
        print(f"| {candidate.name} | {' | '.join(cells)} | {errors[k]:.1e} |", flush=True)


def main() -> None:
    """Print a table for each robot."""
    for name, (motor, integrator) in HELD.items():
        scene = standing(motor)
        ours = [here(scene, sweeps, 128) for sweeps in SWEEPS]
        theirs = [there(scene, integrator, cone) for cone in ("pyramidal", "elliptic")]
        alone = [here(scene, SWEEPS[0], 1, calls) for calls in (1, 128)]
        candidates = [*ours, *alone, *theirs]
        times, errors = measure(candidates), errors_of(candidates)
        report(f"quadruped, {name}, dt = {DT}", candidates, times, errors)


if __name__ == "__main__":
    main()
