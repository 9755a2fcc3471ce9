"""V13: jointed robots without contact, here and in MuJoCo from the same state: how far apart after 1 s.

MuJoCo's own Runge-Kutta of fourth order at a tenth of a millisecond is exact to 1e-10 m here. The robots are those of
``robots``, with springs and dampers along their joints, all joints and the trunk moving. Run with
``make bench-robots``.
"""

from __future__ import annotations

import numpy as np
from mujoco_robots import ThereJointed, model_of, states_of
from mujoco_runs import Runs
from robots import JointedScene, Pose, Rotation, chain, quadruped, state_of
from rolling import Walk

from symphys.model.joints import Spring
from symphys.model.world import Scheme, World
from symphys.types import Array

STEPS = (0.01, 0.005, 0.0025, 0.00125)
FINE = 1e-4
DURATION = 1.0


def flung(name: str, robot: World, rate: float, batch: int = 8) -> JointedScene:
    """A robot with all of its coordinates off zero and moving; its trunk flies and turns, if it has one."""
    rng, names, starts = np.random.default_rng(1), [joint.name for joint in robot.joints], []
    for _ in range(batch):
        angles, rates = (dict(zip(names, rng.normal(0, s, len(names)), strict=True)) for s in (0.3, rate))
        root = Pose(Rotation.from_rotvec(rng.normal(0, 1, 3)), np.zeros(3), *rng.normal(0, 1, (2, 3)))
        starts.append(state_of(robot, angles, rates, root))
    return JointedScene(name, robot, tuple(starts))


def differences(scene: JointedScene, steps: tuple[float, ...] = STEPS, fine: float = FINE) -> Array:
    """(steps, batch) [m]: rms over bodies of the distance from where MuJoCo has them after DURATION."""
    there, runs = ThereJointed("MuJoCo", scene, "RK4"), Runs(model_of(scene, fine, "RK4"))
    exact = there.places(runs.after(states_of(scene), round(DURATION / fine))[:, -1])
    world, found = scene.world(), []
    for dt in steps:
        walk = Walk(world, Scheme(dt=dt, sweeps=20, cuts=0), round(DURATION / dt))
        places = scene.places(world, walk.along(scene.states(world), 1)[0])
        found.append(np.sqrt(((places - exact) ** 2).sum(axis=-1).mean(axis=-1)))
    return np.array(found)


def scenes() -> list[JointedScene]:
    """A quadruped in flight and a hanging chain of five."""
    robot, links = quadruped(spring=Spring(5.0, 0.2, 0.2), ground=False), chain(5, spring=Spring(0.5, 0.01, 0.3))
    return [flung("quadruped", robot, 1.0), flung("chain of 5", links, 1.0)]


def main() -> None:
    """Print the table, in the form of docs/results/mujoco.md."""
    print("| step [ms] |", " | ".join(f"{1e3 * dt:g}" for dt in STEPS), "| order |")
    print("|---" * (len(STEPS) + 2) + "|")
    for scene in scenes():
        middle = np.median(differences(scene), axis=1)
        order = np.log2(middle[-2] / middle[-1])
        print(f"| {scene.name} |", " | ".join(f"{x:.1e}" for x in middle), f"| {order:.2f} |", flush=True)


if __name__ == "__main__":
    main()
