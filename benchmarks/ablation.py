"""What each trick of the step buys: one switched off at a time, the errors that follow, and what it costs.

All runs at a step of 0.01 s. Rows are ``SCHEMES``, columns ``MEASURES``: both are lists to add to. Exact values are
closed forms where there are any, else the whole scheme at a much finer step. Run with ``make bench-contact``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca
import numpy as np
from ablation_worlds import (
    RADIUS,
    billiard,
    bouncing_box,
    inclined,
    mechanical_energy,
    resting_box,
    slabs,
    slabs_start,
    sliding_crate,
    spinning_ball,
    spinning_box,
)
from gradients import dropped
from rolling import Rolling, Walk
from scenes import Scene, Solid

from symphys.dynamics.functions import step_function
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Scheme, World
from symphys.types import Array

DT = 0.01
SCHEMES: dict[str, Mapping[str, Any]] = {
    "whole": {},
    "no time of impact": {"time_of_impact": False},
    "no cuts": {"cuts": 0},
    "1 cut": {"cuts": 1},
    "3 cuts": {"cuts": 3},
    "no cap on energy": {"energy_cap": False},
    "no load sharing": {"load_sharing": False},
    "no friction aim": {"impact_friction": False},
    "cold start": {"warm_start": False},
    "no position pass": {"position_sweeps": 0},
    "1 position sweep": {"position_sweeps": 1},
    "8 position sweeps": {"position_sweeps": 8},
    "push out 0.2": {"push_out": 0.2},
    "4 sweeps": {"sweeps": 4},
    "30 sweeps": {"sweeps": 30},
    "100 sweeps": {"sweeps": 100},
}


def dropped_ball(scheme: Scheme) -> tuple[float, float]:
    """Errors of the height [m] after one bounce with e = 0.8, and of its gradient (relative), worst of 8 heights."""
    start = np.zeros((8, 13))
    start[:, 2], start[:, 3], start[:, 9] = 1.1 + 0.02 * np.arange(8), 1, 0.5
    scene = Scene("ball", (Solid("ball", 1.0, (0.1,)),), start[:, None], 0.0)

    def begin(z: Any) -> Any:
        row = ca.vertcat(0, 0, z[0], 1, 0, 0, 0, 0, 0, z[1], 0, 0, 0)
        return initial_state(world, scene.values(row))

    world = scene.world(0.8)
    kernel = Rolling(world, scheme, round(1.2 / scheme.dt), (2, begin), lambda x: x[2]).kernel
    outputs, slopes = kernel.gradient(start[:, [2, 9]], [1.0], [0.0])
    s = np.sqrt(0.25 + 2 * 9.81 * (start[:, 2] - 0.1))
    left = 1.2 - (0.5 + s) / 9.81
    height = 0.8 * s * left - 9.81 / 2 * left**2
    exact = dropped(start)[:, 0]
    wrong = np.linalg.norm(slopes - exact, axis=1) / np.linalg.norm(exact, axis=1)
    return float(np.abs(outputs["end"][:, 0] - 0.1 - height).max()), float(wrong.max())


def cushion(scheme: Scheme) -> tuple[float, float]:
    """A rolling ball hits a cushion: jump of its place between starts within two steps [m], error of the slope."""
    world, exact = billiard(), -5 / 7 * 0.8 + 2 / 7

    def begin(z: Any) -> Any:
        motion = {"ball.velocity": [1.0, 0, 0], "ball.angular_velocity": [0, 1 / RADIUS, 0]}
        return initial_state(world, {"ball.position": ca.vertcat(z, 0, RADIUS), **motion})

    starts = np.linspace(0, 2 * scheme.dt, 41)
    kernel = Rolling(world, scheme, round(1.6 / scheme.dt), (1, begin), lambda x: x[0]).kernel
    outputs, slopes = kernel.gradient(starts[:, None], [1.0], [0.0])
    jumps = np.diff(outputs["end"][:, 0]) - exact * (starts[1] - starts[0])
    return float(np.abs(jumps).max()), float(np.abs(slopes - exact).max())


def corner(scheme: Scheme) -> float:
    """A spinning box falls on a corner, e = 0.5, mu = 0.3: rms error of its place after 0.32 s [m]."""
    return deviation(spinning_box(), scheme, 0.32)


def spin(scheme: Scheme) -> float:
    """A ball with spin bounces with friction, leaning gravity: rms error of its place after 1.2 s [m]."""
    return deviation(spinning_ball(), scheme, 1.2)


def deviation(scene: Scene, scheme: Scheme, duration: float) -> float:
    """From where the whole scheme has the bodies with a 100th of the step."""
    if scene.name not in REFERENCES:
        REFERENCES[scene.name] = centres(scene, Scheme(dt=DT / 100, sweeps=30), duration)
    return float(np.sqrt(((centres(scene, scheme, duration) - REFERENCES[scene.name]) ** 2).sum(axis=-1).mean()))


def centres(scene: Scene, scheme: Scheme, duration: float) -> Array:
    """(batch, 3) at the end."""
    world = scene.world(0.5)
    ends = Walk(world, scheme, round(duration / scheme.dt)).along(scene.states(world), 1)[0]
    return scene.places(world, ends)[:, 0]


REFERENCES: dict[str, Array] = {}
"""By scene, computed once."""


def rest(scheme: Scheme) -> float:
    """How far a box, put down flat with a small push, moves from the 2nd to the 10th second [m]."""
    world, start = resting_box()
    states = Walk(world, scheme, round(2 / scheme.dt)).along(start, 5)[:, 0]
    return float(np.linalg.norm(states[-1, :3] - states[0, :3]))


def stack(scheme: Scheme) -> tuple[float, float]:
    """Five boxes dropped on each other: largest speed after 10 s [m/s], error of the topmost's height [m]."""
    world = slabs()
    end = Walk(world, scheme, round(5 / scheme.dt)).along(slabs_start(world)[None], 2)[-1, 0]
    layout = Layout(world)
    speeds = [np.abs(end[layout[f"{body.name}.velocity"]]).max() for body in world.bodies]
    top = end[layout[f"{world.bodies[-1].name}.position"]][2]
    return float(max(speeds)), float(abs(top - 0.9))


def cone(scheme: Scheme) -> tuple[float, float]:
    """A box on a slope of 0.99 of the cone: place [m] after 2 s, where it should stay; 1.01: error of its speed."""
    inside, outside = (_slid(inclined(share), scheme) for share in (0.99, 1.01))
    angle = np.arctan(1.01 * 0.6)
    return float(np.linalg.norm(inside[:2])), abs(outside[7] - 2 * 9.81 * (np.sin(angle) - 0.6 * np.cos(angle)))


def _slid(made: tuple[World, Array], scheme: Scheme) -> Array:
    world, start = made
    return Walk(world, scheme, round(2 / scheme.dt)).along(start, 1)[0, 0]


def turning(scheme: Scheme) -> float:
    """A crate slides, turns and stops: error of its angle [rad], against linear loads at a 100th of the step."""
    return abs(_angle(scheme) - _angle(Scheme(dt=DT / 100)))


def _angle(scheme: Scheme) -> float:
    world, start = sliding_crate()
    q = Walk(world, scheme, round(1.5 / scheme.dt)).along(start, 1)[0, 0][Layout(world)["box.orientation"]]
    return float(2 * np.arctan2(q[3], q[0]))


def gained(scheme: Scheme) -> float:
    """A box tumbles with e = 1 and friction, which takes energy: the most that it ever has above what it had [J]."""
    scene = bouncing_box()
    world = scene.world(1.0)
    states = Walk(world, scheme, 1).along(scene.states(world), round(1 / scheme.dt))
    energy = mechanical_energy(world, states)
    return float((energy - np.minimum.accumulate(energy, axis=0)).max())


def instructions(scheme: Scheme) -> float:
    """Of one step of a box on the ground."""
    return float(step_function(resting_box()[0], scheme).n_instructions())


MEASURES: dict[tuple[str, ...], Callable[[Scheme], Any]] = {
    ("dropped ball: height [m]", "its gradient"): dropped_ball,
    ("cushion: jump [m]", "slope"): cushion,
    ("spinning ball [m]",): spin,
    ("corner [m]",): corner,
    ("rest [m]",): rest,
    ("stack: speed [m/s]", "height [m]"): stack,
    ("cone: inside [m]", "outside [m/s]"): cone,
    ("turning [rad]",): turning,
    ("gained [J]",): gained,
    ("instructions",): instructions,
}


def row(scheme: Scheme) -> list[float]:
    """All measures of one scheme."""
    found: list[float] = []
    for measure in MEASURES.values():
        result = measure(scheme)
        found += result if isinstance(result, tuple) else (result,)
    return found


def main() -> None:
    """Print the table, in the form of docs/results/contact.md."""
    names = [name for names in MEASURES for name in names]
    print("| |", " | ".join(names), "|")
    print("|---" * (len(names) + 1) + "|")
    for name, changes in SCHEMES.items():
        cells = [f"{value:.0f}" if value > 1000 else f"{value:.1e}" for value in row(Scheme(dt=DT, **changes))]
        print(f"| {name} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
