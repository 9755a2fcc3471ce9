"""V12: how far a robot's motion depends on the step, and what that costs: each engine against itself at 1/64 ms.

As ``consistency`` for loose bodies (Erez, Tassa and Todorov 2015), for a chain that swings, and for a quadruped on its
feet that is pushed, its legs held by springs (one law in both engines) or by servos (each engine's own). MuJoCo has the
robots from our exporter. Run with ``make bench-robots``; the figure goes into the folder given.
"""

from __future__ import annotations

import sys
from pathlib import Path

from consistency import Engine, Here, report, study
from contact_figures import Curve, consistency_figure
from mujoco_robots import ThereJointed
from robots import HELD, JointedScene, standing, swinging

STEPS = (0.02, 0.01, 0.005, 0.0025, 0.00125)
EVERY = 0.08
"""[s] between samples."""
WINDOW = 0.48
BATCH = 8


def engines(scene: JointedScene, *integrators: str) -> list[Engine]:
    """This engine as it is for speed, and MuJoCo with some of its integrators."""
    there = [ThereJointed(f"MuJoCo, {integrator}", scene, integrator) for integrator in integrators]
    return [Here("symphys", scene, sweeps=20, cuts=0), *there]


def panels() -> dict[str, list[Engine]]:
    """By title. Runge-Kutta is explicit: with the quadruped's dampers and servos it diverges at 10 ms."""
    found = {"A chain of 8 swings": engines(swinging(batch=BATCH), "Euler", "implicitfast", "RK4")}
    for name, (motor, integrator) in HELD.items():
        title = f"A quadruped is pushed, held by {name}"
        implicit = dict.fromkeys((integrator, "implicitfast"))
        found[title] = engines(standing(motor, BATCH), *implicit)
    return found


def main() -> None:
    """Print the tables, draw the figure."""
    curves: dict[str, list[Curve]] = {}
    for title, tried in panels().items():
        print(f"\n{title}, {BATCH} initial states, {WINDOW} s")
        curves[title] = []
        for engine in tried:
            curves[title].append(study(engine, WINDOW, STEPS, EVERY))
            report(curves[title][-1])
    consistency_figure(curves, Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "robots-step.svg")


if __name__ == "__main__":
    main()
