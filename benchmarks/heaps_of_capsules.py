"""Heaps of capsules in a pen: what they take to build and to compile, and a step beside MuJoCo's.

    python benchmarks/heaps_of_capsules.py COUNT [build | near]

Each capsule has six points in a pair with another, so that pairs are many: 27 have 1,917 points. ``build`` stops
before the compiler. ``near`` lists no pairs: each step finds those that are near. Seconds are those of processors, of
compilers too; a step is timed by the clock, on one thread.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from functools import partial
from pathlib import Path
from time import process_time

import mujoco
import numpy as np
from against_mujoco import fastest
from numpy.typing import NDArray
from worlds import problem_of

from symphys import Body, Law, Plane, Scheme
from symphys.codegen import Cache, Program, compile_program
from symphys.codegen.emit.plan import plan
from symphys.codegen.neighbours.kernel import compile_crowd
from symphys.codegen.neighbours.plan import crowd_plan
from symphys.codegen.program.collection import uncollected
from symphys.model.world import World
from symphys.problem import Problem
from symphys.transcription import rollout_program
from symphys.transcription.neighbours.program import crowd_of
from symphys.transcription.rollout import symbolic_rollout

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from heaps import heap

STEPS, BATCH = 20, 64
CONTACT = 'friction="0.4 0 0" solref="-20000 -45" priority="0"'


def there(count: int) -> mujoco.MjModel:
    """The heap for MuJoCo with its own defaults."""
    walls = "".join(
        f'<geom type="plane" size="2 2 .1" pos="{x} 0 0" euler="0 {turn} 0" {CONTACT}/>'
        for x, turn in ((-0.3, 90), (0.3, -90))
    )
    bodies = "".join(
        f'<body pos="{" ".join(map(str, place))}"><freejoint/>'
        f'<geom type="capsule" size="0.06 0.1" mass="1" {CONTACT}/></body>'
        for place in places(count)
    )
    return mujoco.MjModel.from_xml_string(
        '<mujoco><compiler angle="degree"/><option timestep="0.01"/><worldbody>'
        f'<geom type="plane" size="5 5 .1" {CONTACT}/>{walls}{bodies}</worldbody></mujoco>'
    )


def places(count: int) -> list[list[float]]:
    """Where the bodies begin; see ``heap``."""
    return [[0.24 * (i % 2) - 0.12, 0.24 * (i // 2 % 2), 0.2 + 0.4 * (i // 4)] for i in range(count)]


def run(model: mujoco.MjModel, data: mujoco.MjData, velocities: NDArray[np.float64]) -> None:
    """From the start to the end."""
    mujoco.mj_resetData(model, data)
    data.qvel.reshape(-1, 6)[:, :3] = velocities
    for _ in range(STEPS):
        mujoco.mj_step(model, data)


def built(problem: Problem) -> Program:
    """The program, with what building and planning took."""
    began = process_time()
    rollout = symbolic_rollout(problem)
    program = rollout_program(rollout, exact=True)
    middle = process_time()
    with uncollected():
        plan(program, ("merit",))
    planned, peak = process_time() - middle, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"  {len(rollout.world.pairs):,} points, {len(program.body):,} calls", end="")
    print(f"; built in {middle - began:.1f} s, planned in {planned:.1f} s; peak {peak:.2f} GiB", flush=True)
    return program


def found_anew(count: int) -> None:
    """The same heap, of which each step finds the pairs that are near."""
    bodies = [
        Body.capsule(f"b{i}", radius=0.06, length=0.2, mass=1.0, position=tuple(place))
        for i, place in enumerate(places(count))
    ]
    planes = Plane.ground(), Plane("left", (1, 0, 0), -0.3), Plane("right", (-1, 0, 0), -0.3)
    began = process_time()
    law, scheme = Law(friction=0.4, restitution=0.5), Scheme(dt=0.01, sweeps=6)
    crowd = crowd_of(World(tuple(bodies), planes), law, scheme, exact=True)
    middle = process_time()
    crowd_plan(crowd)
    print(f"{count} capsules\n  built in {middle - began:.1f} s, planned in {process_time() - middle:.1f} s", end="")
    with tempfile.TemporaryDirectory() as folder:
        before = children()
        kernel = compile_crowd(crowd, lanes=1, threads=1, cache=Cache(Path(folder)))
        print(f", compiled in {children() - before:.1f} s of processors by {kernel.report.compiler}", flush=True)
    random, start = np.random.default_rng(count), np.zeros((count, 19))
    start[:, :3], start[:, 3] = places(count), 1
    start[:, 7:10] = velocities = np.array([random.uniform(-1.5, 1.5, 3).round(3) for _ in range(count)])
    state, given = np.append(start, 0.0)[None], np.zeros((1, crowd.given))
    ours = fastest(partial(kernel.rollouts, state, given, STEPS)) / STEPS
    weights = np.ones((1, STEPS + 1, state.shape[1]))
    gradient = fastest(partial(kernel.adjoints, state, given, weights)) / STEPS
    model = there(count)
    theirs = fastest(partial(run, model, mujoco.MjData(model), velocities)) / STEPS
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"  a step alone: {1e6 * ours:.0f} us, MuJoCo {1e6 * theirs:.0f} us, ratio {ours / theirs:.1f}", end="")
    print(f"; with gradient {1e6 * gradient:.0f} us; peak {peak:.2f} GiB", flush=True)


def main() -> None:
    """A heap."""
    count = int(sys.argv[1])
    if "near" in sys.argv:
        found_anew(count)
        return
    problem = problem_of(heap(["capsule"] * count))
    print(f"{count} capsules", flush=True)
    program = built(problem)
    if "build" in sys.argv:
        return
    z = np.concatenate([np.array(variable.guess, float).ravel() for variable in problem.variables])
    with tempfile.TemporaryDirectory() as folder:
        before = children()
        kernel = compile_program(program, seeded=("merit",), threads=1, cache=Cache(Path(folder)), lanes="auto")
        print(f"  compiled in {children() - before:.1f} s of processors by {kernel.report.compiler}", flush=True)
        alone = compile_program(program, seeded=("merit",), threads=1, cache=Cache(Path(folder)), rows=1)
    Z = z + 0.3 * np.random.default_rng(1).standard_normal((BATCH, len(z)))
    model = there(count)
    data, rows = mujoco.MjData(model), Z.reshape(BATCH, -1, 3)
    ours = fastest(partial(alone.forward, z, [0.0])) / STEPS, fastest(partial(kernel.forward, Z, [0.0])) / STEPS / BATCH
    theirs = [fastest(partial(run, model, data, z.reshape(-1, 3))) / STEPS]
    theirs.append(fastest(lambda: [run(model, data, row) for row in rows]) / STEPS / BATCH)
    for what, us, them in zip(("alone", f"one of {BATCH}"), ours, theirs, strict=True):
        print(f"  a step {what}: {1e6 * us:.0f} us, MuJoCo {1e6 * them:.0f} us, ratio {us / them:.1f}", flush=True)


def children() -> float:
    """[s] of processors that ended children took."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
