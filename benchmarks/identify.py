"""Do 95 % intervals of estimates cover the truth, and is what recordings cannot tell named?

Two balls are thrown with spin onto the ground and bounce; their positions are recorded at 100 Hz with 2 mm of noise.
Friction and restitution are fitted, and how each was thrown. The rows count in how many draws of the noise an interval
covers the truth, and how wide intervals are against the bound of Cramér and Rao. Then a mass that has no effect, and a
drag and a mass that appear only as a ratio, are given to the same fit, which has to say so in the same words each time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from bench import Row

import symphys
from symphys.prediction.residuals import residuals_of
from symphys.results.identification import Identification
from symphys.types import Array

Tables = dict[str, Any]
COLUMNS = {
    "what": "a fitted number, how fits end, or what they call open",
    "count": "draws in which the interval covers the truth, or the fit ends or says so",
    "draws": "of the noise",
    "widest": "widest half of an interval by that of the bound of Cramér and Rao",
}
NOISE, RATE = 0.002, 100
"""[m], [Hz]."""
TRUTH = {"friction": 0.12, "bounce": 0.7}
THROWS = ((5.0, 0.0, 0.0), (4.0, 0.5, -30.0))
"""Velocities along x and z [m/s], and spin about y [rad/s]."""
DURATION = 1.0
DRAG, MASS = 0.4, 0.5


@dataclass(frozen=True)
class Case:
    """A problem that is simulated, recorded and fitted.

    Attributes:
        tables: the problem without recordings, from a throw of ``THROWS``.
        variables: the fitted ones.
        truth: values of the shared ones, by name.
    """

    tables: Callable[[tuple[float, float, float]], Tables]
    variables: list[Tables]
    truth: dict[str, float]


def bouncing(throw: tuple[float, float, float]) -> Tables:
    """Return a ball that is thrown onto the ground, at the truth."""
    x, z, spin = throw
    body = {"name": "ball", "shape": {"sphere": {"radius": 0.05}}, "mass": 0.2, "position": [0, 0, 0.35]}
    start = {"velocity": [x, 0, z], "angular_velocity": [0, spin, 0]}
    ground = {"friction": TRUTH["friction"], "restitution": TRUTH["bounce"]}
    return {"simulation": {"duration": DURATION, "dt": 0.01}, "body": [body | start], "ground": ground}


def dragged(throw: tuple[float, float, float]) -> Tables:
    """Return a ball with drag far above the ground."""
    tables = bouncing(throw)
    tables["body"][0] |= {"position": [0, 0, 50.0], "mass": MASS}
    law = {"name": "air", "on": "ball.force", "value": "-air.c * ball.velocity", "numbers": {"c": DRAG}}
    return tables | {"force": [law]}


FRICTION = {"name": "friction", "sets": "ground.friction", "guess": 0.08, "lower": 0.01, "upper": 2.0}
BOUNCE = {"name": "bounce", "sets": "ground.restitution", "guess": 0.5, "lower": 0.0, "upper": 0.98}
THROWN = {"name": "thrown", "sets": "ball.velocity", "each": "recording", "guess": [1.5, 0, 1.5]}
SPUN = {"name": "spun", "sets": "ball.angular_velocity[1]", "each": "recording", "guess": 0.0, "scale": 10.0}
WEIGHT = {"name": "mass", "sets": "ball.mass", "guess": 0.3, "lower": 0.05, "upper": 3.0}
AIR = {"name": "drag", "sets": "air.c", "guess": 0.3, "lower": 0.01, "upper": 5.0}

BOUNCES = Case(bouncing, [FRICTION, BOUNCE, THROWN, SPUN], TRUTH)
NO_EFFECT = Case(bouncing, [FRICTION, BOUNCE, WEIGHT, THROWN, SPUN], TRUTH)
A_RATIO = Case(dragged, [AIR, WEIGHT, THROWN], {})


def recorded(case: Case, seed: int) -> symphys.Problem:
    """Return the problem of a draw of the noise; its guesses are not the truth."""
    random, recordings = np.random.default_rng(seed), []
    for k, throw in enumerate(THROWS):
        motion = symphys.simulate(symphys.load(case.tables(throw)))
        places = motion["ball.position"] + NOISE * random.standard_normal(motion["ball.position"].shape)
        measured = [{"value": "ball.position", "columns": "p", "noise": NOISE}]
        start = {"ball.velocity": "v", "ball.angular_velocity": "w"}
        first = {"v": [[throw[0] + 0.1, 0, throw[1] - 0.1]] * len(places), "w": [[0, throw[2] + 2, 0]] * len(places)}
        table = {"p": places[:-1].tolist()} | {key: rows[:-1] for key, rows in first.items()}
        recordings.append({"name": f"throw{k}", "rate": RATE, "table": table, "measured": measured, "start": start})
    return symphys.load(case.tables(THROWS[0]) | {"variable": case.variables, "recording": recordings})


def least_errors(problem: symphys.Problem, found: Identification) -> Array:
    """Return the standard errors (s,) of Cramér and Rao of the shared numbers at the estimates, own ones unknown."""
    residuals = residuals_of(problem, 1)
    shared = np.array([each.value for each in found.parameters])
    which = np.arange(len(residuals.recordings))
    information = np.zeros((len(shared), len(shared)))
    for _, by_shared, by_own in residuals.jacobian(shared, found.own, which):
        left = by_shared - by_own @ np.linalg.lstsq(by_own, by_shared, rcond=None)[0]
        information += left.T @ left
    return np.sqrt(np.diag(np.linalg.inv(information)))


def covered(draws: int, case: Case = BOUNCES) -> tuple[dict[str, tuple[int, float]], Counter[str]]:
    """Count coverage.

    Returns:
        By number in how many draws the interval covers the truth, and its widest half by that of the bound; and how
        the fits ended.
    """
    inside, widest, ended = Counter[str](), dict.fromkeys(case.truth, 0.0), Counter[str]()
    for seed in range(draws):
        problem = recorded(case, seed)
        found = symphys.identify(problem, threads=1)
        ended[found.status] += 1
        for each, least in zip(found.parameters, least_errors(problem, found), strict=True):
            inside[each.name] += bool(each.lower <= case.truth[each.name] <= each.upper)
            widest[each.name] = max(widest[each.name], (each.upper - each.lower) / 2 / (1.96 * float(least)))
    return {name: (inside[name], widest[name]) for name in case.truth}, ended


def named(case: Case, draws: int) -> Counter[str]:
    """Count what is said of directions that are not determined."""
    found = Counter[str]()
    for seed in range(draws):
        found["; ".join(each.text for each in symphys.identify(recorded(case, seed), threads=1).open)] += 1
    return found


def rows(quick: bool = False, draws: int = 100, open: int = 20) -> Iterator[Row]:
    """Yield coverage, how fits end, and what is called open.

    Args:
        quick: one draw.
        draws: of coverage.
        open: draws of each case with numbers that recordings cannot tell.
    """
    draws, open = (1, 1) if quick else (draws, open)
    numbers, ended = covered(draws)
    for name, (count, widest) in numbers.items():
        yield {"what": f"{name} covered", "count": count, "draws": draws, "widest": widest}
    for status, count in ended.most_common():
        yield {"what": f"fits: {status}", "count": count, "draws": draws, "widest": None}
    for case in (NO_EFFECT, A_RATIO):
        for text, count in named(case, open).most_common():
            yield {"what": text or "nothing is said to be open", "count": count, "draws": open, "widest": None}
