"""Heaps of spheres in a box: what a step of many bodies takes against the contacts there are, beside MuJoCo's.

    python benchmarks/many_spheres.py [COUNT ..]

Spheres of 10 cm fall into a box as wide as they need to lie about ten deep. Once they rest, 20 steps of 5 ms are timed
on one thread, with 10 sweeps, with the time of impact; of MuJoCo's two solvers for many bodies, Newton and CG, the
faster counts, each with its own defaults.
"""

from __future__ import annotations

import resource
import sys
from functools import partial
from time import perf_counter, process_time

import mujoco
import numpy as np
from against_mujoco import fastest
from numpy.typing import NDArray

from symphys import Body, Law, Plane, Scheme
from symphys.codegen.neighbours.kernel import CrowdKernel, compile_crowd
from symphys.model.world import World
from symphys.transcription.neighbours.program import crowd_of

Array = NDArray[np.float64]
RADIUS, DT, STEPS, SETTLING, DEEP = 0.05, 0.005, 20, 600, 10
COUNTS = (32, 64, 125, 250, 500)
NORMALS = {"ground": (0, 0, 1), "left": (1, 0, 0), "right": (-1, 0, 0), "front": (0, 1, 0), "back": (0, -1, 0)}
BODY = 19
"""Numbers of a body in a state."""


def spheres(count: int) -> World:
    """On a grid above the ground, each a little beside its place."""
    side = max(2, round((count / DEEP) ** 0.5) + 1)
    random, width = np.random.default_rng(0), 2.2 * RADIUS
    bodies = []
    for i in range(count):
        place = np.array([i % side - (side - 1) / 2, i // side % side - (side - 1) / 2, i // side**2 + 0.6]) * width
        place[:2] += random.uniform(-1, 1, 2) * 0.05 * RADIUS
        bodies.append(Body.ball(f"ball{i}", radius=RADIUS, mass=1.0, position=tuple(place)))
    half = side * width / 2
    planes = [Plane(name, normal, 0.0 if name == "ground" else -half) for name, normal in NORMALS.items()]
    return World(tuple(bodies), tuple(planes))


def start_of(world: World) -> Array:
    """(1, numbers of a state)."""
    found = np.zeros((len(world.bodies), BODY))
    found[:, :3] = [body.start["position"] for body in world.bodies]
    found[:, 3] = 1
    return np.append(found, 0.0)[None]


def touching(world: World, state: Array) -> int:
    """Contacts of a state."""
    places = state[:-1].reshape(-1, BODY)[:, :3]
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    pairs = int((apart[np.triu_indices(len(places), 1)] < 2 * RADIUS + 1e-4).sum())
    planes = [plane for plane in world.statics if isinstance(plane, Plane)]
    heights = [places @ np.array(plane.normal, float) - float(plane.offset) for plane in planes]
    return pairs + int((np.array(heights) < RADIUS + 1e-4).sum())


def there(world: World, places: Array, solver: str) -> mujoco.MjModel:
    """The same spheres for MuJoCo."""
    contact = 'friction="0.4 0 0" priority="0"'
    angle = {"left": "0 90 0", "right": "0 -90 0", "front": "-90 0 0", "back": "90 0 0", "ground": "0 0 0"}
    statics = "".join(
        f'<geom type="plane" size="9 9 .1" pos="{" ".join(str(float(plane.offset) * n) for n in plane.normal)}" '
        f'euler="{angle[plane.name]}" {contact}/>'
        for plane in world.statics
        if isinstance(plane, Plane)
    )
    bodies = "".join(
        f'<body pos="{x} {y} {z}"><freejoint/><geom type="sphere" size="{RADIUS}" mass="1" {contact}/></body>'
        for x, y, z in places
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="degree"/><option timestep="{DT}" solver="{solver}"/><size memory="200M"/>'
        f"<worldbody>{statics}{bodies}</worldbody></mujoco>"
    )


def run(model: mujoco.MjModel, data: mujoco.MjData, state: Array) -> None:
    """Some steps from a state of MuJoCo's."""
    mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    for _ in range(STEPS):
        mujoco.mj_step(model, data)


def theirs_of(world: World, state: Array, solver: str) -> float:
    """[s] of a step of MuJoCo's, half a second after this state."""
    model = there(world, state[:-1].reshape(-1, BODY)[:, :3], solver)
    data = mujoco.MjData(model)
    for _ in range(100):
        mujoco.mj_step(model, data)
    kept = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, kept, mujoco.mjtState.mjSTATE_INTEGRATION)
    return fastest(partial(run, model, data, kept)) / STEPS


def settled(kernel: CrowdKernel, start: Array) -> Array:
    """The state at rest."""
    state = start
    for _ in range(SETTLING // STEPS):
        state = kernel.rollouts(state, np.zeros((1, kernel.crowd.given)), STEPS)[:, -1]
        state[:, -1] = 0
    return state


def main() -> None:
    """A line for each count, then how straight the line is."""
    found = []
    for count in map(int, sys.argv[1:]) if sys.argv[1:] else COUNTS:
        began, world = process_time(), spheres(count)
        crowd = crowd_of(world, Law(friction=0.4, restitution=0.0), Scheme(dt=DT, sweeps=10), exact=True)
        built, began = process_time() - began, perf_counter()
        kernel = compile_crowd(crowd, lanes=1, threads=1)
        compiled = perf_counter() - began
        state, given = settled(kernel, start_of(world)), np.zeros((1, crowd.given))
        ours = fastest(partial(kernel.rollouts, state, given, STEPS)) / STEPS
        weights = np.zeros((1, STEPS + 1, state.shape[1]))
        weights[:, -1, 2] = 1
        gradient = fastest(partial(kernel.adjoints, state, given, weights)) / STEPS
        theirs, solver = min((theirs_of(world, state[0], solver), solver) for solver in ("Newton", "CG"))
        contacts = touching(world, state[0])
        found.append((contacts, 1e6 * ours))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
        print(
            f"{count} spheres, {contacts} contacts: built in {built:.1f} s, compiled in "
            f"{compiled:.1f} s; a step {1e6 * ours:.0f} us, {1e6 * ours / contacts:.2f} a contact, with "
            f"gradient {1e6 * gradient:.0f}, MuJoCo {1e6 * theirs:.0f} by {solver}, ratio {ours / theirs:.2f}; "
            f"peak {peak:.0f} MiB",
            flush=True,
        )
    if len(found) > 2:
        x, y = np.array(found).T
        slope = np.exp(np.log(y / x).mean())
        print(f"a step takes {slope:.2f} us a contact; at most {np.abs(y / (slope * x) - 1).max():.0%} off that line")


if __name__ == "__main__":
    main()
