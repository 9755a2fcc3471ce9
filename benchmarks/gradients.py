"""Errors of gradients through impacts against the step: with the time of impact, without it, and MuJoCo's.

Three published cases with a closed form, from several heights: a ball that bounces once (Zhong, Han, Brikis 2022, task
1), one dropped with e = 0.8, a toss (DiffMJX); and a tumbling box with friction, against each engine at a 32nd of a
millisecond. Error: |J - J*| / |J*|; curves are medians over initial states, bands their quartiles. MuJoCo has no
restitution: its contact is a spring that gives back as much speed, and its J central differences of whole rollouts, its
solver at full accuracy. Run with ``make bench-contact``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from contact_figures import Curve, gradient_figure
from mujoco_runs import Contact, Runs, model_of, states_of
from rolling import Rolling
from scenes import Scene, Solid, tumbling_box

from symphys.model.state_layout import initial_state
from symphys.model.world import Scheme
from symphys.types import Array

FINE = 0.001 / 32
HALVINGS = 8
DIFFERENCE = 1e-6
RADIUS = 0.1
SPRINGS = (
    Contact("MuJoCo, linear spring", (-1e4, 0), (0.9999, 0.9999, 0.001)),
    Contact("MuJoCo, gradual spring", (-1e5, 0), (0.0001, 0.9999, 0.1, 0.5, 2)),
)
"""[1/s^2] hard from the first touch on, and one whose force grows by the fifth power of the depth, up to 0.1 m."""


@dataclass(frozen=True)
class Case:
    """What is differentiated: some of the pose at the end, by some numbers of the initial state of one solid.

    Attributes:
        title: of the panel.
        scene: the solid and its initial states.
        by: indices of position, orientation, velocity, angular velocity (13).
        of: indices of position and orientation (7).
        duration: [s].
        largest: step [s].
        restitution: e.
        exact: (batch, of, by) from the scene's (batch, 13); None: each engine at the finest step.
    """

    title: str
    scene: Scene
    by: tuple[int, ...]
    of: tuple[int, ...]
    duration: float
    largest: float
    restitution: float
    exact: Callable[[Array], Array] | None = None

    @property
    def steps(self) -> tuple[float, ...]:
        """Of the study [s]."""
        return tuple(self.largest / 2**k for k in range(HALVINGS))


def here(case: Case, dt: float, time_of_impact: bool = True) -> Array:
    """(batch, of, by) of this engine, by the adjoint."""
    world, rows, by = case.scene.world(case.restitution), case.scene.start[:, 0], list(case.by)

    def start(z: Any) -> Any:
        row = ca.vertcat(*(z[13 + i] if i not in by else z[by.index(i)] for i in range(13)))
        return initial_state(world, case.scene.values(row))

    scheme = Scheme(dt=dt, time_of_impact=time_of_impact)
    rolling = Rolling(world, scheme, round(case.duration / dt), (26, start), lambda x: x[list(case.of)])
    Z = np.hstack([rows[:, by], np.zeros((len(rows), 13 - len(by))), rows])
    seeds = np.eye(len(case.of))
    return np.stack([rolling.kernel.gradient(Z, seed, [0.0])[1][:, : len(by)] for seed in seeds], axis=1)


def there(case: Case, dt: float, contact: Contact) -> Array:
    """(batch, of, by) of MuJoCo, by central differences of rollouts."""
    runs, columns = Runs(model_of(case.scene, contact, dt, 0)), []
    for i in case.by:
        ends = []
        for sign in (1, -1):
            start = case.scene.start.copy()
            start[:, 0, i] += sign * DIFFERENCE
            end = runs.after(states_of(replace(case.scene, start=start)), round(case.duration / dt))[:, -1]
            ends.append(end[:, 1:8][:, list(case.of)])
        columns.append((ends[0] - ends[1]) / (2 * DIFFERENCE))
    return np.stack(columns, axis=2)


def study(case: Case, label: str, jacobian: Callable[[float], Array], steps: Sequence[float], exact: Array) -> Curve:
    """Relative errors (steps, batch)."""
    size = np.linalg.norm(exact, axis=(1, 2))
    errors = np.array([np.linalg.norm(jacobian(dt) - exact, axis=(1, 2)) / size for dt in steps])
    return Curve(label, tuple(steps), np.maximum(errors, 1e-16), np.zeros(0), np.zeros(0))


def curves(case: Case, steps: Sequence[float], fine: float = FINE) -> list[Curve]:
    """All engines on one case."""
    law = case.exact(case.scene.start[:, 0]) if case.exact else here(case, fine)
    found = [study(case, "symphys", lambda dt: here(case, dt), steps, law)]
    found.append(study(case, "symphys without time of impact", lambda dt: here(case, dt, False), steps, law))
    for contact in contacts(case):
        own = law if case.exact else there(case, fine, contact)
        found.append(study(case, contact.name, lambda dt, c=contact: there(case, dt, c), steps, own))
    return found


def contacts(case: Case) -> tuple[Contact, ...]:
    """MuJoCo's contacts: springs that give back the speed where there is an exact answer."""
    if case.exact is None:
        return Contact("MuJoCo, default contact"), Contact("MuJoCo, stiff contact", (0.004, 1.0))
    speed = np.sqrt(case.scene.start[0, 0, 9] ** 2 + 2 * case.scene.gravity * case.scene.start[:, 0, 2].mean())
    return tuple(giving_back(case.restitution, float(speed), contact) for contact in SPRINGS)


def giving_back(e: float, speed: float, contact: Contact) -> Contact:
    """The spring with the damper that leaves e of the speed, found by bisection of its damping ratio."""
    low, high, stiffness = 0.0, 1.0 if e < 1 else 0.0, -contact.solref[0]
    for _ in range(20):
        ratio = (low + high) / 2
        damped = replace(contact, solref=(-stiffness, -2 * ratio * np.sqrt(stiffness)))
        low, high = (ratio, high) if returned(damped, speed) > e else (low, ratio)
    return damped


def returned(contact: Contact, speed: float) -> float:
    """The share of its speed that a ball keeps at a 100,000th of a second."""
    scene = ball(np.array([0.01 * speed]), -speed, 0)
    end = Runs(model_of(scene, contact, 1e-5, 0)).after(states_of(scene), 20_000)[0, -1]
    return float(end[1 + 7 + 2]) / speed


def ball(heights: Array, speed: float, gravity: float, along: float = 0.0) -> Scene:
    """A frictionless ball above the ground, from several heights of its lowest point."""
    start = np.zeros((len(heights), 1, 13))
    start[:, 0, 0], start[:, 0, 2], start[:, 0, 3] = -along, heights + RADIUS, 1
    start[:, 0, 7], start[:, 0, 9] = 2 * along, speed
    return Scene("ball", (Solid("ball", 1.0, (RADIUS,)),), start, 0.0, gravity)


def elastic(duration: float) -> Callable[[Array], Array]:
    """Without gravity, e = 1: height(T) = -(h + v T)."""
    return lambda rows: np.tile([[-1.0, -duration]], (len(rows), 1, 1))


def dropped(rows: Array, e: float = 0.8, g: float = 9.81, duration: float = 1.2) -> Array:
    """One parabola, v' = -e v, another parabola: slopes of its height by first height and velocity."""
    h, v = rows[:, 2] - RADIUS, rows[:, 9]
    s = np.sqrt(v**2 + 2 * g * h)
    left = duration - (v + s) / g
    slopes = [(g / s, 1 / s), (v / s, (1 + v / s) / g)]  # of impact speed and instant, by h and by v
    return np.stack([e * ds * left + (g * left - e * s) * dt for ds, dt in slopes], axis=1)[:, None]


def cases(batch: int = 16) -> list[Case]:
    """The four."""
    share = np.random.default_rng(3).uniform(size=batch)
    once, drop, toss = ball(0.9 + 0.2 * share, -2, 0, 1), ball(1 + 0.2 * share, 0.5, 9.81), ball(1.5 * share, -1, 0)
    height = {"by": (2, 9), "of": (2,)}
    return [
        Case("A ball bounces once, e = 1", once, **height, duration=1, largest=1 / 30, restitution=1, exact=elastic(1)),
        Case("A dropped ball, e = 0.8", drop, **height, duration=1.2, largest=0.04, restitution=0.8, exact=dropped),
        Case("A toss, e = 1", toss, **height, duration=2, largest=0.1, restitution=1, exact=elastic(2)),
        Case("A tumbling box, e = 0.5", tumbling_box(batch), (*range(7, 13),), (*range(7),), 0.48, 0.016, 0.5),
    ]


def report(curve: Curve) -> None:
    """Print a line."""
    middles = " ".join(f"{1e3 * dt:.3g}:{np.median(e):.1e}" for dt, e in zip(curve.steps, curve.errors, strict=True))
    print(f"   {curve.label:32} {middles}", flush=True)


def main() -> None:
    """Print the tables, draw the figure into the folder given (default: here)."""
    panels = {}
    for case in cases():
        print(f"{case.title}, {len(case.scene.start)} initial states; step [ms]: median relative error")
        panels[case.title] = curves(case, case.steps)
        for curve in panels[case.title]:
            report(curve)
    gradient_figure(panels, Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "contact-gradients.svg")


if __name__ == "__main__":
    main()
