"""How wrong are gradients through impacts, and along a walk of a thousand steps?

Three published cases with a closed form, from several heights: a ball that bounces once (Zhong, Han, Brikis 2022, task
1), one dropped with e = 0.8, a toss (DiffMJX); and a tumbling box with friction, against each engine at a 32nd of a
millisecond. The error is |J - J*| / |J*|, the median over initial states. MuJoCo has no restitution: its contact is a
spring that gives back as much speed, and its J central differences of whole rollouts.

A walk of a thousand steps: the adjoint in 16 samples of ``quadruped_walk`` against central differences along 8 random
directions, for legs that swing by so much. Where changes explode there are no differences to compare with, so lengths
of gradients are printed beside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from bench import Row
from engines import Contact, Rolling, Runs, mujoco, solids_model, solids_states
from scenes import Scene, Solid, tumbling_box

from symphys.model.state_layout import initial_state
from symphys.model.world import Scheme
from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import Transcription, transcribe
from symphys.types import Array

COLUMNS = {
    "case": "what is differentiated",
    "engine": "that differentiates",
    "step_ms": "time step [ms]",
    "error": "median relative error of the gradient",
    "low": "lower quartile",
    "high": "upper quartile",
    "worst": "largest",
    "length": "median length of the gradients of a walk",
}
FINE = 0.001 / 32
HALVINGS = 8
DIFFERENCE = 1e-6
RADIUS = 0.1
SPRINGS = (
    Contact("MuJoCo, linear spring", (-1e4, 0), (0.9999, 0.9999, 0.001)),
    Contact("MuJoCo, gradual spring", (-1e5, 0), (0.0001, 0.9999, 0.1, 0.5, 2)),
)
"""Stiffness [1/s^2] from the first touch on, and one that grows by the fifth power of the depth up to 0.1 m."""
WALK_DIFFERENCE, SAMPLES, WALK_DIRECTIONS = 1e-7, 16, 8
AMPLITUDES = (0.02, 0.05, 0.1, 0.15, 0.2)
"""Of sines and cosines of the legs [rad]."""


def rows(quick: bool = False, parts: tuple[str, ...] = ("impacts", "walk")) -> Iterator[Row]:
    """Yield errors through impacts and along a walk, as far as ``parts`` names them."""
    if "impacts" in parts:
        for case in cases(batch=2)[:1] if quick else cases():
            yield from studied(case, case.steps[:2] if quick else case.steps)
    if "walk" in parts and not quick:
        yield from along_a_walk()


@dataclass(frozen=True)
class Case:
    """Some numbers of the pose at the end, differentiated by some numbers of the initial state of one solid.

    Attributes:
        title: of the rows.
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
        """Return the steps of the study [s]."""
        return tuple(self.largest / 2**k for k in range(HALVINGS))


def here(case: Case, dt: float, time_of_impact: bool = True) -> Array:
    """Return Jacobians (batch, of, by) of this engine, by the adjoint."""
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
    """Return Jacobians (batch, of, by) of MuJoCo, by central differences of rollouts."""
    runs, columns = Runs(solids_model(case.scene, contact, dt, 0)), []
    for i in case.by:
        ends = []
        for sign in (1, -1):
            start = case.scene.start.copy()
            start[:, 0, i] += sign * DIFFERENCE
            end = runs.after(solids_states(replace(case.scene, start=start)), round(case.duration / dt))[:, -1]
            ends.append(end[:, 1:8][:, list(case.of)])
        columns.append((ends[0] - ends[1]) / (2 * DIFFERENCE))
    return np.stack(columns, axis=2)


def studied(case: Case, steps: Sequence[float], fine: float = FINE) -> Iterator[Row]:
    """Yield the errors of all engines on one case."""
    law = case.exact(case.scene.start[:, 0]) if case.exact else here(case, fine)
    ways: list[tuple[str, Callable[[float], Array], Array]] = [
        ("symphys", lambda dt: here(case, dt), law),
        ("symphys without time of impact", lambda dt: here(case, dt, False), law),
    ]
    for contact in contacts(case) if mujoco else ():
        own = law if case.exact else there(case, fine, contact)
        ways.append((contact.name, lambda dt, contact=contact: there(case, dt, contact), own))  # type: ignore[misc]
    for name, jacobian, exact in ways:
        for dt in steps:
            yield {"case": case.title, "engine": name, "step_ms": 1e3 * dt, **spread(errors_of(jacobian(dt), exact))}


def errors_of(found: Array, exact: Array) -> Array:
    """Return relative errors (batch,) of Jacobians (batch, of, by)."""
    return np.asarray(np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2)))


def spread(errors: Array) -> Row:
    """Return median, quartiles and the largest."""
    low, middle, high, worst = np.quantile(errors, [0.25, 0.5, 0.75, 1.0]).tolist()
    return {"error": middle, "low": low, "high": high, "worst": worst}


def contacts(case: Case) -> tuple[Contact, ...]:
    """Return MuJoCo's contacts: springs that give back the speed where there is an exact answer."""
    if case.exact is None:
        return Contact("MuJoCo, default contact"), Contact("MuJoCo, stiff contact", (0.004, 1.0))
    speed = np.sqrt(case.scene.start[0, 0, 9] ** 2 + 2 * case.scene.gravity * case.scene.start[:, 0, 2].mean())
    return tuple(giving_back(case.restitution, float(speed), contact) for contact in SPRINGS)


def giving_back(e: float, speed: float, contact: Contact) -> Contact:
    """Return the spring with the damper that leaves e of the speed, by bisection of its damping ratio."""
    low, high, stiffness = 0.0, 1.0 if e < 1 else 0.0, -contact.solref[0]
    for _ in range(20):
        ratio = (low + high) / 2
        damped = replace(contact, solref=(-stiffness, -2 * ratio * np.sqrt(stiffness)))
        low, high = (ratio, high) if returned(damped, speed) > e else (low, ratio)
    return damped


def returned(contact: Contact, speed: float) -> float:
    """Return the share of its speed that a ball keeps, at a step of 1e-5 s."""
    scene = ball(np.array([0.01 * speed]), -speed, 0)
    end = Runs(solids_model(scene, contact, 1e-5, 0)).after(solids_states(scene), 20_000)[0, -1]
    return float(end[1 + 7 + 2]) / speed


def ball(heights: Array, speed: float, gravity: float, along: float = 0.0) -> Scene:
    """Return a frictionless ball above the ground, from several heights of its lowest point."""
    start = np.zeros((len(heights), 1, 13))
    start[:, 0, 0], start[:, 0, 2], start[:, 0, 3] = -along, heights + RADIUS, 1
    start[:, 0, 7], start[:, 0, 9] = 2 * along, speed
    return Scene("ball", (Solid("ball", 1.0, (RADIUS,)),), start, 0.0, gravity)


def elastic(duration: float) -> Callable[[Array], Array]:
    """Return the slopes without gravity and with e = 1, where height(T) = -(h + v T)."""
    return lambda rows: np.tile([[-1.0, -duration]], (len(rows), 1, 1))


def dropped(rows: Array, e: float = 0.8, g: float = 9.81, duration: float = 1.2) -> Array:
    """Return the slopes of the height by first height and velocity: a parabola, v' = -e v, another parabola."""
    h, v = rows[:, 2] - RADIUS, rows[:, 9]
    s = np.sqrt(v**2 + 2 * g * h)
    left = duration - (v + s) / g
    slopes = [(g / s, 1 / s), (v / s, (1 + v / s) / g)]  # of impact speed and instant, by h and by v
    return np.stack([e * ds * left + (g * left - e * s) * dt for ds, dt in slopes], axis=1)[:, None]


def cases(batch: int = 16) -> list[Case]:
    """Return the four cases."""
    share = np.random.default_rng(3).uniform(size=batch)
    once, drop, toss = ball(0.9 + 0.2 * share, -2, 0, 1), ball(1 + 0.2 * share, 0.5, 9.81), ball(1.5 * share, -1, 0)
    height = {"by": (2, 9), "of": (2,)}
    return [
        Case("A ball bounces once, e = 1", once, **height, duration=1, largest=1 / 30, restitution=1, exact=elastic(1)),
        Case("A dropped ball, e = 0.8", drop, **height, duration=1.2, largest=0.04, restitution=0.8, exact=dropped),
        Case("A toss, e = 1", toss, **height, duration=2, largest=0.1, restitution=1, exact=elastic(2)),
        Case("A tumbling box, e = 0.5", tumbling_box(batch), (*range(7, 13),), (*range(7),), 0.48, 0.016, 0.5),
    ]


def along_a_walk() -> Iterator[Row]:
    """Yield errors of the adjoint of a walk against central differences."""
    made = transcribe(load_problem(find("quadruped_walk")), exact=True)
    for amplitude in AMPLITUDES:
        z = gait(made, amplitude)
        errors, lengths = compared(made, z)
        speed = made.judge(z).outputs["speed [m/s]"]
        row: Row = {"case": f"a walk, legs swing by {amplitude:g} rad, {speed:.2f} m/s", "engine": "symphys"}
        yield row | {"step_ms": 10.0, **spread(errors), "length": float(np.median(lengths))}


def gait(made: Transcription, amplitude: float) -> Array:
    """Return the start with sines and cosines of this size."""
    shooting = made.shooting
    blocks = shooting.by_block(shooting.start(0))
    for name in ("sines", "cosines"):
        blocks[name] = np.sign(blocks[name]) * amplitude
    return shooting.from_blocks(blocks)


def compared(made: Transcription, z: Array) -> tuple[Array, Array]:
    """Return relative errors (samples * directions,) of slopes, and lengths (samples,) of gradients."""
    scenario = made.shooting.scenario
    assert scenario is not None
    rng = np.random.default_rng(0)
    drawn = scenario.draw(rng, SAMPLES)
    slopes = scenario.gradient(z[None], drawn, 0.0).gradient
    assert slopes is not None
    errors = []
    for _ in range(WALK_DIRECTIONS):
        along = rng.standard_normal(z.size)
        along /= np.linalg.norm(along)
        high, low = (scenario.value((z + sign * WALK_DIFFERENCE * along)[None], drawn, 0.0).merit for sign in (1, -1))
        difference, slope = (high - low) / (2 * WALK_DIFFERENCE), slopes @ along
        errors.append(np.abs(slope - difference) / np.abs(difference))
    return np.concatenate(errors), np.linalg.norm(slopes, axis=1)
