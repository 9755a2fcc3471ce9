"""How far does a motion depend on the time step, at what cost, and does it agree with MuJoCo's?

The measure of Erez, Tassa and Todorov (2015): the distance of the bodies' centres from where the same engine has them
at a step of 1/64 ms, root mean square over bodies and samples of a window that ends before chance rules, median over
initial states. Scenes: a box tumbles to rest; capsules fall in a heap; a chain swings; a quadruped is pushed on its
feet, its legs held by springs (one law in both engines) or by servos (each engine's own). The engines differ in their
law of contact, so that an error of one says nothing of the other's motion.

Without contact both engines have one law. There the distance is that from MuJoCo's Runge-Kutta of fourth order at a
tenth of a millisecond after 1 s, which is exact to 1e-10 m here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from time import process_time
from typing import Any, Protocol

import numpy as np
from bench import Row, fastest
from engines import Contact, Runs, Walk, mujoco, robot_model, robot_states, solids_model, solids_states
from robots import HELD, JointedScene, Pose, Rotation, chain, quadruped, standing, state_of, swinging
from scenes import Scene, heap_of_capsules, tumbling_box

from symphys.model.joints import Spring
from symphys.model.world import Scheme, World
from symphys.types import Array

COLUMNS = {
    "scene": "what moves",
    "engine": "and its contact or integrator",
    "step_ms": "time step [ms]",
    "error": "median over initial states [m]",
    "low": "lower quartile [m]",
    "high": "upper quartile [m]",
    "alone_ms": "processor time of a simulated second [ms]",
    "of_eight_ms": "the same of one of eight side by side [ms]",
    "order": "of the error, from the last two steps",
}
STEPS = (0.016, 0.008, 0.004, 0.002, 0.001, 0.0005, 0.00025)
JOINTED_STEPS = (0.02, 0.01, 0.005, 0.0025, 0.00125)
FREE_STEPS = (0.01, 0.005, 0.0025, 0.00125)
FINE, FREE_FINE = 0.001 / 64, 1e-4
SAMPLE, JOINTED_SAMPLE = 0.016, 0.08
"""Time between samples of loose solids and of robots [s]."""
REPEATS = 5
SOFT = Contact("MuJoCo, default contact")
STIFF = Contact("MuJoCo, stiff contact", (0.004, 1.0))
SOFT_RK4 = Contact("MuJoCo, default, RK4", integrator="RK4")


class Engine(Protocol):
    """An engine on a scene."""

    name: str
    scene: Any

    def runner(self, dt: float, every: float = SAMPLE) -> Callable[[int, int], Array]:
        """Return a function (batch, count) -> (count, batch, n) of states after each ``every`` seconds."""

    def places(self, states: Array) -> Array:
        """Return the centres (..., bodies, 3) of states (..., n)."""


@dataclass(frozen=True)
class Here:
    """This engine on a scene."""

    name: str
    scene: Any
    restitution: float = 0.0
    sweeps: int = 10
    cuts: int | None = None

    @cached_property
    def world(self) -> World:
        """Return the world of the scene."""
        world: World = self.scene.world(self.restitution)
        return world

    def runner(self, dt: float, every: float = SAMPLE) -> Callable[[int, int], Array]:
        """Compile; see ``Engine``."""
        walk = Walk(self.world, Scheme(dt=dt, sweeps=self.sweeps, cuts=self.cuts), round(every / dt))
        states = self.scene.states(self.world)
        return lambda batch, count: walk.along(states[:batch], count)

    def places(self, states: Array) -> Array:
        """Return the centres; see ``Engine``."""
        return np.asarray(self.scene.places(self.world, states))


@dataclass(frozen=True)
class There:
    """MuJoCo on a scene.

    Attributes:
        name: of the rows.
        scene: of solids, or a robot.
        model: makes the model at a time step.
        states: (batch, nstate) initial states.
        bodies: names of the scene's bodies in their order.
    """

    name: str
    scene: Any
    model: Callable[[float], Any]
    states: Array
    bodies: tuple[str, ...]

    def runner(self, dt: float, every: float = SAMPLE) -> Callable[[int, int], Array]:
        """Make the model; see ``Engine``."""
        runs = Runs(self.model(dt))
        return lambda batch, count: runs.along(self.states[:batch], round(every / dt), count)

    def places(self, states: Array) -> Array:
        """Return the centres; see ``Engine``."""
        model = self.model(0.01)
        data, found = mujoco.MjData(model), []
        order = [model.body(name).id for name in self.bodies]
        for state in states.reshape(-1, states.shape[-1]):
            data.qpos[:] = state[1 : 1 + model.nq]
            mujoco.mj_kinematics(model, data)
            found.append(data.xipos[order])
        return np.array(found).reshape(*states.shape[:-1], len(order), 3)


def solids_there(scene: Scene, contact: Contact) -> There:
    """Return MuJoCo on solids with a contact."""
    names = tuple(solid.name for solid in scene.solids)
    return There(contact.name, scene, partial(solids_model, scene, contact), solids_states(scene), names)


def robot_there(scene: JointedScene, integrator: str) -> There:
    """Return MuJoCo on a robot with an integrator."""
    names = tuple(body.name for body in scene.robot.bodies)
    model = partial(robot_model, scene, integrator=integrator)
    return There(f"MuJoCo, {integrator}", scene, model, robot_states(scene), names)


def rows(quick: bool = False) -> Iterator[Row]:
    """Yield a row for each scene, engine and step."""
    if quick:
        scene = tumbling_box(2)
        yield from study(scene.name, Here("symphys", scene), 0.064, (0.016, 0.008), SAMPLE, 0.004)
        return
    for title, engines, window in (
        ("a box tumbles to rest, first 0.96 s", box(), 0.96),
        ("8 capsules fall in a heap, first 0.32 s", heap(), 0.32),
    ):
        for engine in engines:
            yield from study(title, engine, window, STEPS, SAMPLE)
    for title, engines in jointed().items():
        for engine in engines:
            yield from study(title, engine, 0.48, JOINTED_STEPS, JOINTED_SAMPLE)
    yield from agreements()


def study(
    title: str, engine: Engine, window: float, steps: Sequence[float], every: float, fine: float = FINE
) -> Iterator[Row]:
    """Yield errors and processor times of one engine on one scene."""
    count, batch = round(window / every), len(engine.scene.start)
    exact, last = samples(engine, fine, window, every), float("nan")
    for dt in steps:
        run = engine.runner(dt, every)
        low, middle, high = np.quantile(distance(engine.places(run(batch, count)), exact), [0.25, 0.5, 0.75]).tolist()
        alone, of_eight = (
            1e3 * fastest(partial(run, side, count), REPEATS, process_time) / window / side for side in (1, 8)
        )
        row = {"scene": title, "engine": engine.name, "step_ms": 1e3 * dt, "error": middle, "low": low, "high": high}
        yield row | {"alone_ms": alone, "of_eight_ms": of_eight, "order": float(np.log2(last / middle))}
        last = middle


def errors_of(engine: Engine, window: float, steps: Sequence[float], fine: float, every: float = SAMPLE) -> Array:
    """Return rms distances (steps, batch) from the run at the fine step over bodies and samples of a window [m]."""
    exact, runs = samples(engine, fine, window, every), (samples(engine, dt, window, every) for dt in steps)
    return np.array([distance(run, exact) for run in runs])


def samples(engine: Engine, dt: float, window: float, every: float = SAMPLE) -> Array:
    """Return the centres (count, batch, bodies, 3) at the samples of a window."""
    return engine.places(engine.runner(dt, every)(len(engine.scene.start), round(window / every)))


def distance(places: Array, exact: Array) -> Array:
    """Return the root mean square (batch,) over samples and bodies, from (samples, batch, bodies, 3) [m]."""
    return np.asarray(np.sqrt((np.linalg.norm(places - exact, axis=-1) ** 2).mean(axis=(0, 2))))


def box(batch: int = 32) -> list[Engine]:
    """Return the engines on the tumbling box."""
    scene = tumbling_box(batch)
    here: list[Engine] = [Here("symphys, e = 0", scene), Here("symphys, e = 0, 50 sweeps", scene, sweeps=50)]
    here.append(Here("symphys, e = 0.5", scene, 0.5))
    return [*here, *(solids_there(scene, contact) for contact in (SOFT, STIFF, SOFT_RK4))]


def heap(side: int = 2, batch: int = 8) -> list[Engine]:
    """Return the engines on the heap of capsules."""
    scene = heap_of_capsules(side, batch)
    here = [Here("symphys, e = 0", scene), Here("symphys, e = 0.5", scene, 0.5)]
    return [*here, *(solids_there(scene, contact) for contact in (SOFT, STIFF, SOFT_RK4))]


def engines(scene: JointedScene, *integrators: str) -> list[Engine]:
    """Return this engine as it is for speed, and MuJoCo with some of its integrators."""
    here = Here("symphys", scene, sweeps=20, cuts=0)
    return [here, *(robot_there(scene, integrator) for integrator in integrators)]


def jointed(batch: int = 8) -> dict[str, list[Engine]]:
    """Return the engines on robots; Runge-Kutta diverges at 10 ms with the quadruped's dampers and servos."""
    found = {"a chain of 8 swings": engines(swinging(batch=batch), "Euler", "implicitfast", "RK4")}
    for name, (motor, integrator) in HELD.items():
        implicit = dict.fromkeys((integrator, "implicitfast"))
        found[f"a quadruped is pushed, held by {name}"] = engines(standing(motor, batch), *implicit)
    return found


def agreements() -> Iterator[Row]:
    """Yield distances from MuJoCo's motion without contact."""
    robot, links = quadruped(spring=Spring(5.0, 0.2, 0.2), ground=False), chain(5, spring=Spring(0.5, 0.01, 0.3))
    for scene in (flung("quadruped", robot, 1.0), flung("chain of 5", links, 1.0)):
        last = float("nan")
        for dt, errors in zip(FREE_STEPS, differences(scene), strict=True):
            low, middle, high = np.quantile(errors, [0.25, 0.5, 0.75]).tolist()
            row: Row = {"scene": f"{scene.name} in free motion", "engine": "symphys against MuJoCo, RK4"}
            row |= {"step_ms": 1e3 * dt, "error": middle, "low": low, "high": high, "alone_ms": None}
            yield row | {"of_eight_ms": None, "order": float(np.log2(last / middle))}
            last = middle


def flung(name: str, robot: World, rate: float, batch: int = 8) -> JointedScene:
    """Return a robot with all of its coordinates off zero and moving; its trunk flies and turns, if it has one."""
    rng, names, starts = np.random.default_rng(1), [joint.name for joint in robot.joints], []
    for _ in range(batch):
        angles, rates = (dict(zip(names, rng.normal(0, s, len(names)), strict=True)) for s in (0.3, rate))
        root = Pose(Rotation.from_rotvec(rng.normal(0, 1, 3)), np.zeros(3), *rng.normal(0, 1, (2, 3)))
        starts.append(state_of(robot, angles, rates, root))
    return JointedScene(name, robot, tuple(starts))


def differences(scene: JointedScene, steps: tuple[float, ...] = FREE_STEPS, duration: float = 1.0) -> Array:
    """Return the rms distances (steps, batch) over bodies from where MuJoCo has them in the end [m]."""
    there = robot_there(scene, "RK4")
    exact = there.places(there.runner(FREE_FINE, duration)(len(scene.start), 1)[0])
    world, found = scene.world(), []
    for dt in steps:
        walk = Walk(world, Scheme(dt=dt, sweeps=20, cuts=0), round(duration / dt))
        places = scene.places(world, walk.along(scene.states(world), 1)[0])
        found.append(np.sqrt(((places - exact) ** 2).sum(axis=-1).mean(axis=-1)))
    return np.array(found)
