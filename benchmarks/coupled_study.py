"""Contacts solved one by one to the law, or by projections in turn: what each costs and how far the sweeps come.

For each scene: where the local solver of ``dynamics/contact/coupling`` works. Nowhere; where the bound of the coupling
is above ``STRONG``, as the engine has it; on all free bodies; on trees of joints too.

python benchmarks/coupled_study.py [scene ..]
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np
from scenes import Solid
from table_robot import table_problem

from symphys.dynamics.contact.coupling import STRONG, may_couple
from symphys.dynamics.functions import report_function
from symphys.model.scalar import is_zero
from symphys.model.shapes import Capsule, Plane
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Pair, Scheme, World, make_world
from symphys.transcription import symbolic_rollout
from symphys.transcription.simulation import recorder, simulate
from symphys.types import Array

HOMES = ("contact.coupling", "substep", "impact.impact")
coupling, substep, impact = (import_module(f"symphys.dynamics.{name}") for name in HOMES)
Run = tuple[float, Array, Array, Layout]
"""Instructions of a step, states (nx, steps + 1), residuals (steps,) [N s], where each quantity is."""


def everywhere(world: World, pair: Pair) -> bool:
    """On trees of joints too."""
    return may_couple(world, pair) or not (pair.law.soft or is_zero(pair.law.friction))


WHERE: dict[str, tuple[float, Callable[[World, Pair], bool]]] = {
    "nowhere": (np.inf, may_couple),
    "strong": (STRONG, may_couple),
    "free bodies": (0.0, may_couple),
    "trees too": (0.0, everywhere),
}


@contextmanager
def solving(where: str) -> Iterator[None]:
    """The local solver at these contacts."""
    strong, chooses = WHERE[where]
    coupling.STRONG, substep.may_couple, impact.may_couple = strong, chooses, chooses
    try:
        yield
    finally:
        coupling.STRONG, substep.may_couple, impact.may_couple = STRONG, may_couple, may_couple


def rolled(world: World, values: dict[str, Any], steps: int, sweeps: int, dt: float = 0.01) -> Run:
    """The scene from these values."""
    function = report_function(world, Scheme(dt=dt, sweeps=sweeps))
    layout, x = Layout(world), ca.DM(initial_state(world, values))
    states, residuals = [x], []
    for _ in range(steps):
        x, _, _, residual, *_ = function(x, ca.DM(0, 1), ca.DM(0, 1), 0)
        states.append(x)
        residuals.append(float(residual))
    return function.n_instructions(), np.array(ca.horzcat(*states)), np.array(residuals), layout


def sliding_tip(sweeps: int) -> tuple[float, float, float]:
    """A rod of 1 m and 0.1 kg whose trailing tip slides at 60 degrees, mu = 2: (instructions, residual, error of N)."""
    mass, half, mu, tilt, dt = 0.1, 0.5, 2.0, np.pi / 3, 1e-4
    moment = mass * (2 * half) ** 2 / 12
    body = Body("rod", mass, (moment, moment, 1e-6), (Capsule(1e-9, half),))
    world = make_world([body], [Plane.ground()], Law(mu))
    lean = np.pi / 2 - tilt
    start = {"rod.position": [0, 0, half * np.sin(tilt)], "rod.velocity": [3.0, 0, 0]}
    start |= {"rod.orientation": [np.cos(lean / 2), 0, np.sin(lean / 2), 0]}
    count, states, residuals, layout = rolled(world, start, 1, sweeps, dt)
    arm, across = half * np.cos(tilt), half * np.sin(tilt)
    exact = 9.81 / (1 / mass + arm * (arm + mu * across) / moment)
    force = float(states[layout["rod.velocity"]][2, -1] / dt + 9.81) * mass
    return count, residuals.max(), abs(force - exact) / exact


def tower(sweeps: int) -> tuple[float, float, float]:
    """Three cubes on each other, the lowest kicked at 0.2 m/s: (.., largest residual, sinking at the end [m])."""
    side = 0.1
    bodies = [Solid(f"c{k}", 1.0, (side,) * 3).body() for k in range(3)]
    world = make_world(bodies, [Plane.ground()], Law(0.6))
    start: dict[str, Any] = {f"c{k}.position": [0, 0, side + 2 * side * k] for k in range(3)}
    count, states, residuals, layout = rolled(world, start | {"c0.velocity": [0.2, 0, 0]}, 50, sweeps)
    sunk = 5 * side - states[layout["c2.position"]][2, -1]
    return count, residuals.max(), abs(sunk)


def heap(sweeps: int) -> tuple[float, float, float]:
    """Three crossed layers of two bars fall 5 mm: (.., median residual, kinetic energy [J]), last half second."""
    radius, half = 0.03, 0.2
    bodies = [Solid(f"b{k}", 1.0, (radius, half)).body() for k in range(6)]
    world = make_world(bodies, [Plane.ground()], Law(0.6))
    start: dict[str, Any] = {}
    for k in range(6):
        layer, side = k // 2, 0.1 * (-1) ** k
        across, lying = ([0.0, side], [1, 0, 1, 0]) if layer % 2 else ([side, 0.0], [1, 1, 0, 0])
        start |= {f"b{k}.position": [*across, radius + 2 * radius * layer + 0.005 * (layer + 1)]}
        start |= {f"b{k}.orientation": np.array(lying) / np.sqrt(2)}
    count, states, residuals, layout = rolled(world, start, 100, sweeps)
    speeds = sum((states[layout[f"b{k}.velocity"]][:, -50:] ** 2).sum(axis=0) for k in range(6))
    return count, float(np.median(residuals[-50:])), float(np.median(speeds)) / 2


def robot(sweeps: int) -> tuple[float, float, float]:
    """The table robot stands: (.., median residual, speed of its torso [m/s]), in the last of two seconds."""
    problem = table_problem([1], 200, stride=0.0, toi=True)
    problem = replace(problem, simulation=replace(problem.simulation, sweeps=sweeps))
    rollout = symbolic_rollout(problem)
    motion = simulate(rollout, recorder(rollout), np.zeros(rollout.z.numel()), 0.0).motion
    function = report_function(rollout.world, problem.simulation.scheme(), rollout.inputs, rollout.parameters.symbols)
    speeds = np.linalg.norm(motion.velocity[-100:, 0], axis=-1)
    return function.n_instructions(), float(np.median(motion.residual[-100:])), float(np.median(speeds))


SCENES = (sliding_tip, tower, heap, robot)


def main() -> None:
    """Print the table."""
    for scene in SCENES:
        if sys.argv[1:] and scene.__name__ not in sys.argv[1:]:
            continue
        print(scene.__doc__)
        for where in WHERE:
            for sweeps in (20, 40):
                with solving(where):
                    count, residual, error = scene(sweeps)
                told = f"{count:9.0f} instructions  {residual:9.1e} N s  {error:9.1e}"
                print(f"  {where:12} {sweeps:3} sweeps {told}", flush=True)


if __name__ == "__main__":
    main()
