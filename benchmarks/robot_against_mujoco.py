"""A quadruped on its four feet, here and in MuJoCo: steps and derivatives per second on one core, batches of 128.

Both engines get the same robot, MuJoCo by our exporter, the same 128 initial states and the same time step. CPU time is
taken in turns, one engine after the other, several times; ratios are within a turn, so that what else the machine does
disturbs both. MuJoCo's derivative, ``mjd_transitionFD``, gives the whole matrices of a step by state and command; ours,
the adjoint of the whole rollout, gives the gradient of one number. Run with ``make bench-robots``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np
from mujoco_robots import model_of, states_of
from mujoco_runs import Runs, mujoco
from numpy.typing import NDArray
from robots import JointedScene, standing
from rolling import Rolling

from symphys.joints import Motor, Servo
from symphys.world import Scheme

Array = NDArray[np.float64]
DT = 0.01
STEPS = 50
TURNS = 7
DERIVED = 16
"""Robots whose steps are differentiated in MuJoCo, each STEPS times."""
SERVO = Servo(20.0, 30.0, 8.0)
SWEEPS = (20, 10, 5)
ROBOTS: dict[str, tuple[Motor | None, str]] = {"springs": (None, "Euler"), "servos": (SERVO, "implicitfast")}
"""What holds the legs, and MuJoCo's fastest integrator that is stable with it."""
Call = Callable[[], object]


@dataclass(frozen=True)
class Candidate:
    """Something that is measured.

    Attributes:
        name: in the table.
        rollout, derivative: of ``steps`` steps each.
        steps: robots times steps, of the two.
    """

    name: str
    rollout: Call
    derivative: Call
    steps: tuple[int, int]


def here(scene: JointedScene, sweeps: int, batch: int) -> Candidate:
    """This engine."""
    world = scene.world()
    kernel = Rolling(world, Scheme(dt=DT, sweeps=sweeps, cuts=0), STEPS).kernel
    states = scene.states(world)[:batch]
    seed = np.zeros(states.shape[1])
    seed[0] = 1.0
    name = f"symphys, {sweeps} sweeps" + (", one robot alone" if batch == 1 else "")
    return Candidate(
        name,
        partial(kernel.forward, states, [0.0]),
        partial(kernel.gradient, states, seed, [0.0]),
        (batch * STEPS, batch * STEPS),
    )


def there(scene: JointedScene, integrator: str, cone: str) -> Candidate:
    """MuJoCo, one thread."""
    runs, states = Runs(model_of(scene, DT, integrator, cone)), states_of(scene)
    return Candidate(
        f"MuJoCo, {integrator}, {cone}",
        partial(runs.after, states, STEPS),
        partial(differentiate, runs, states[:DERIVED]),
        (len(states) * STEPS, DERIVED * STEPS),
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


def report(title: str, candidates: Sequence[Candidate], times: Array) -> None:
    """Print a table: best and median of the turns; ratios to the last candidate, MuJoCo with our law of friction."""
    print(f"\n{title}: 1000 steps/s best (median), times MuJoCo's; 1000 derivatives/s, times MuJoCo's")
    ratios = times[:, -1:] / times
    for k, candidate in enumerate(candidates):
        cells = []
        for what in (0, 1):
            best, middle = times[:, k, what].min(), np.median(times[:, k, what])
            fastest = times[:, -1, what].min() / best
            cells.append(
                f"{1e-3 / best:8.4g} ({1e-3 / middle:.4g}) | {fastest:.3g} ({np.median(ratios[:, k, what]):.3g})"
            )
        print(f"| {candidate.name} | {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Print a table for each robot."""
    for name, (motor, integrator) in ROBOTS.items():
        scene = standing(motor)
        ours = [here(scene, sweeps, 128) for sweeps in SWEEPS]
        theirs = [there(scene, integrator, cone) for cone in ("pyramidal", "elliptic")]
        candidates = [*ours, here(scene, SWEEPS[0], 1), *theirs]
        report(f"quadruped, {name}, dt = {DT}", candidates, measure(candidates))


if __name__ == "__main__":
    main()
