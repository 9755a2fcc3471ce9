"""How far a simulation depends on its step, and what that costs: each engine against itself at a 64th of a ms.

The measure of Erez, Tassa and Todorov (2015). Scenes: a box tumbling to rest; capsules dropped in a heap. Error:
distance of the bodies' centres from where the same engine has them at the fine step, root mean square over bodies and
samples of a window that ends before chance rules; curves are medians over initial states, bands their quartiles. The
engines differ in their law of contact, so an error says nothing of the other engine's motion. Run with
``make bench-contact``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Protocol

import numpy as np
from contact_figures import Curve, consistency_figure
from mujoco_runs import Contact, Runs, model_of, states_of
from rolling import Walk
from scenes import Scene, heap_of_capsules, tumbling_box

from symphys.model.world import Scheme, World
from symphys.types import Array

STEPS = (0.016, 0.008, 0.004, 0.002, 0.001, 0.0005, 0.00025)
FINE = 0.001 / 64
SAMPLE = 0.016
"""[s] between samples."""
REPEATS = 5
SOFT = Contact("MuJoCo, default contact")
STIFF = Contact("MuJoCo, stiff contact", (0.004, 1.0))
SOFT_RK4 = Contact("MuJoCo, default, RK4", integrator="RK4")


class Engine(Protocol):
    """An engine on a scene, with a name for figures."""

    name: str
    scene: Any

    def runner(self, dt: float, every: float = SAMPLE) -> Callable[[int, int], Array]:
        """(batch, count) -> (count, batch, n) states after each ``every`` seconds."""

    def places(self, states: Array) -> Array:
        """(..., bodies, 3) the centres in states (..., n)."""


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
        """The scene's."""
        world: World = self.scene.world(self.restitution)
        return world

    def runner(self, dt: float, every: float = SAMPLE) -> Callable[[int, int], Array]:
        """See ``Engine``."""
        walk = Walk(self.world, Scheme(dt=dt, sweeps=self.sweeps, cuts=self.cuts), round(every / dt))
        states = self.scene.states(self.world)
        return lambda batch, count: walk.along(states[:batch], count)

    def places(self, states: Array) -> Array:
        """See ``Engine``."""
        return np.asarray(self.scene.places(self.world, states))


@dataclass(frozen=True)
class There:
    """MuJoCo on a scene."""

    name: str
    scene: Scene
    contact: Contact

    def runner(self, dt: float, every: float = SAMPLE) -> Callable[[int, int], Array]:
        """See ``Engine``."""
        runs, states = Runs(model_of(self.scene, self.contact, dt)), states_of(self.scene)
        return lambda batch, count: runs.along(states[:batch], round(every / dt), count)

    def places(self, states: Array) -> Array:
        """See ``Engine``."""
        poses = states[..., 1 : 1 + 7 * len(self.scene.solids)]
        return poses.reshape(*states.shape[:-1], -1, 7)[..., :3]


def errors_of(engine: Engine, window: float, steps: Sequence[float], fine: float, every: float = SAMPLE) -> Array:
    """(steps, batch) [m]: rms distance from the run at the fine step, over bodies and samples of the window."""
    exact, runs = samples(engine, fine, window, every), (samples(engine, dt, window, every) for dt in steps)
    return np.array([distance(run, exact) for run in runs])


def samples(engine: Engine, dt: float, window: float, every: float = SAMPLE) -> Array:
    """(count, batch, bodies, 3) places at the samples of the window."""
    return engine.places(engine.runner(dt, every)(len(engine.scene.start), round(window / every)))


def distance(places: Array, exact: Array) -> Array:
    """(batch,) [m]: root mean square over samples and bodies, from (samples, batch, bodies, 3)."""
    return np.asarray(np.sqrt((np.linalg.norm(places - exact, axis=-1) ** 2).mean(axis=(0, 2))))


def study(engine: Engine, window: float, steps: Sequence[float] = STEPS, every: float = SAMPLE) -> Curve:
    """Errors, and CPU seconds for a simulated one: alone, and a share of eight side by side."""
    count, batch = round(window / every), len(engine.scene.start)
    exact, errors, costs = samples(engine, FINE, window, every), [], []
    for dt in steps:
        run = engine.runner(dt, every)
        errors.append(distance(engine.places(run(batch, count)), exact))
        costs.append([cheapest(partial(run, side, count)) / window / side for side in (1, 8)])
    return Curve(engine.name, tuple(steps), np.array(errors), *np.array(costs).T)


def cheapest(call: Callable[[], object]) -> float:
    """CPU seconds of this process, the least of REPEATS: other processes on the machine disturb that less than time."""
    times = []
    for _ in range(REPEATS):
        began = process_time()
        call()
        times.append(process_time() - began)
    return min(times)


def box(batch: int = 32) -> list[Engine]:
    """The engines on the tumbling box."""
    scene = tumbling_box(batch)
    here: list[Engine] = [Here("symphys, e = 0", scene), Here("symphys, e = 0, 50 sweeps", scene, sweeps=50)]
    here.append(Here("symphys, e = 0.5", scene, 0.5))
    return [*here, *(There(contact.name, scene, contact) for contact in (SOFT, STIFF, SOFT_RK4))]


def heap(side: int = 2, batch: int = 8) -> list[Engine]:
    """The engines on the heap of capsules."""
    scene = heap_of_capsules(side, batch)
    here = [Here("symphys, e = 0", scene), Here("symphys, e = 0.5", scene, 0.5)]
    return [*here, *(There(contact.name, scene, contact) for contact in (SOFT, STIFF, SOFT_RK4))]


def report(curve: Curve) -> None:
    """Print a table."""
    print(f"\n{curve.label}: step [ms], median error [m], quartiles, CPU ms a simulated s alone / of eight")
    for k, dt in enumerate(curve.steps):
        low, middle, high = np.quantile(curve.errors[k], [0.25, 0.5, 0.75])
        print(f"{1e3 * dt:8.3g} {middle:9.1e} ({low:.1e} to {high:.1e})", end="")
        print(f" {1e3 * curve.alone[k]:9.3g} {1e3 * curve.eight[k]:9.3g}", flush=True)


def sizes(sides: Sequence[int] = (2, 3)) -> None:
    """Print what heaps cost to build and to simulate: why there are 8 capsules, not the paper's 27."""
    for side in sides:
        scene = heap_of_capsules(side)
        world = scene.world()
        walk, states, began = Walk(world, Scheme(dt=0.002), 20), scene.states(world), perf_counter()
        walk.along(states, 1)
        built, seconds = perf_counter() - began, cheapest(partial(walk.along, states, 1))
        print(f"{side**3} capsules, {len(world.pairs)} points: {built:.0f} s to build, ", end="")
        print(f"{1e3 * seconds / 20:.2f} ms a step of eight", flush=True)


def main() -> None:
    """Print the tables, draw the figure into the folder given (default: here)."""
    panels: dict[str, list[Curve]] = {}
    for title, engines, window in (
        ("A box tumbles to rest, first 0.96 s", box(), 0.96),
        ("8 capsules fall in a heap, first 0.32 s", heap(), 0.32),
    ):
        panels[title] = []
        print(f"\n{title}, {len(engines[0].scene.start)} initial states")
        for engine in engines:
            panels[title].append(study(engine, window))
            report(panels[title][-1])
    consistency_figure(panels, Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "contact-step.svg")
    sizes()


if __name__ == "__main__":
    main()
