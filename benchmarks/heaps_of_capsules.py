"""Heaps of capsules in a pen: what they take to build and to compile, and a step beside MuJoCo's.

    python benchmarks/heaps_of_capsules.py COUNT [build | near]

Each capsule has six points in a pair with another, so that pairs are many: 27 have 1,917 points. ``build`` stops
before the compiler. ``near`` lists no pairs: each step finds those that are near; also at shorter steps, with errors.
Seconds are those of processors, of compilers too; a step is timed by the clock, on one thread.
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
from measured_worlds import problem_of
from numpy.typing import NDArray

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
from worlds.heaps import heap

STEPS, BATCH, DT = 20, 64, 0.01
PARTS, FINEST = (1, 2, 4, 8), 64
"""Of DT: the steps that are timed, and the finest, by which errors are told."""
BODY = 19
"""Numbers of a body in a state."""
Array = NDArray[np.float64]
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


def run(model: mujoco.MjModel, data: mujoco.MjData, velocities: Array, steps: int = STEPS) -> None:
    """From the start to the end."""
    mujoco.mj_resetData(model, data)
    data.qvel.reshape(-1, 6)[:, :3] = velocities
    for _ in range(steps):
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


class Thrown:
    """The heap here, of which each step of ``dt`` [s] finds the pairs that are near."""

    def __init__(self, count: int, dt: float, cache: Cache) -> None:
        """Build and compile it."""
        bodies = [
            Body.capsule(f"b{i}", radius=0.06, length=0.2, mass=1.0, position=tuple(place))
            for i, place in enumerate(places(count))
        ]
        planes = Plane.ground(), Plane("left", (1, 0, 0), -0.3), Plane("right", (-1, 0, 0), -0.3)
        law, scheme = Law(friction=0.4, restitution=0.5), Scheme(dt=dt, sweeps=6)
        began = process_time()
        crowd = crowd_of(World(tuple(bodies), planes), law, scheme, exact=True)
        middle = process_time()
        crowd_plan(crowd)
        self.built, self.planned, before = middle - began, process_time() - middle, children()
        self.kernel = compile_crowd(crowd, lanes=1, threads=1, cache=cache)
        self.compiled, self.steps = children() - before, round(STEPS * DT / dt)

    def starts(self, velocities: Array) -> Array:
        """(B, numbers of a state) of velocities (B, bodies, 3)."""
        found = np.zeros((*velocities.shape[:2], BODY))
        found[:, :, :3], found[:, :, 3], found[:, :, 7:10] = places(velocities.shape[1]), 1, velocities
        return np.append(found.reshape(len(found), -1), np.zeros((len(found), 1)), axis=1)

    def rollouts(self, velocities: Array) -> Array:
        """All states."""
        return self.kernel.rollouts(self.starts(velocities), self.given(velocities), self.steps)

    def gradients(self, velocities: Array) -> Array:
        """Of the sum of all states."""
        starts = self.starts(velocities)
        return self.kernel.adjoints(
            starts, self.given(velocities), np.ones((len(starts), self.steps + 1, starts.shape[1]))
        )[1]

    def given(self, velocities: Array) -> Array:
        """(B, given)."""
        return np.zeros((len(velocities), self.kernel.crowd.given))

    def ends(self, velocities: Array) -> Array:
        """(bodies, 3) [m]."""
        return self.rollouts(velocities[None])[0, -1, :-1].reshape(-1, BODY)[:, :3]


def found_anew(count: int) -> None:
    """Steps that find their pairs beside MuJoCo's, at several lengths, with errors against the finest of each."""
    random = np.random.default_rng(count)
    velocities = random.uniform(-1.5, 1.5, (count, 3)).round(3)
    many = velocities + 0.3 * np.random.default_rng(1).standard_normal((BATCH, count, 3))
    model = there(count)
    data = mujoco.MjData(model)

    def ends(dt: float) -> Array:
        model.opt.timestep = dt
        run(model, data, velocities, round(STEPS * DT / dt))
        return data.xpos[1:].copy()

    with tempfile.TemporaryDirectory() as folder:
        finest = Thrown(count, DT / FINEST, Cache(Path(folder))).ends(velocities), ends(DT / FINEST)
        for part in PARTS:
            dt = DT / part
            thrown = Thrown(count, dt, Cache(Path(folder)))
            took = f"built in {thrown.built:.1f} s, planned in {thrown.planned:.1f} s, "
            print(f"{count} capsules, dt {dt:g} s\n  {took}compiled in {thrown.compiled:.1f} s of processors")
            errors = [rms(one - finest[k]) for k, one in enumerate((thrown.ends(velocities), ends(dt)))]
            alone = fastest(partial(thrown.rollouts, velocities[None])), fastest(partial(ends, dt))
            batch = fastest(partial(thrown.rollouts, many)) / BATCH
            batch_there = fastest(lambda: [run(model, data, row, thrown.steps) for row in many]) / BATCH  # noqa: B023
            gradient = fastest(partial(thrown.gradients, velocities[None])) / thrown.steps
            for what, (us, them) in {"alone": alone, f"one of {BATCH}": (batch, batch_there)}.items():
                us, them = 1e6 * us / thrown.steps, 1e6 * them / thrown.steps
                print(f"  a step {what}: {us:.0f} us, MuJoCo {them:.0f} us, ratio {us / them:.1f}")
            print(f"  errors {errors[0]:.1e} m, MuJoCo {errors[1]:.1e} m; {STEPS * DT:g} s alone take ", end="")
            print(f"{1e3 * alone[0]:.2f} ms, MuJoCo {1e3 * alone[1]:.2f} ms; with gradient {1e6 * gradient:.0f} us")
            print(f"  peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB", flush=True)


def rms(apart: Array) -> float:
    """Of distances (bodies, 3) [m]."""
    return float(np.sqrt((apart**2).sum(axis=1).mean()))


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
