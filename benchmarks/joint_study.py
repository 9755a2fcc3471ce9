"""What each device of jointed motion buys: errors against sweeps and against the instructions of a step.

Joints as exact trees or as rows that sweeps visit, warm start, the position pass, cuts, the time of impact and the cap
on energy, one switch at a time, at a step of 0.01 s. Work is counted, not timed. Run with ``make bench-robots``; the
figure goes into the folder given.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from ablation_worlds import mechanical_energy
from joint_figure import Curve, joint_figure
from joint_worlds import falling_chain, falling_quadruped, given_way, parallelograms, swinging, thrown_chain
from robots import JointedScene
from rolling import Walk

from symphys.dynamics.functions import trace_step
from symphys.dynamics.observation import reading_function
from symphys.model.state_layout import Layout
from symphys.model.world import Scheme, World
from symphys.types import Array

Switches = Mapping[str, Any]
DT = 0.01
SWEEPS = (1, 2, 5, 10, 20, 50)
MANY = 500
"""Sweeps of the answer that the others are held against."""
FINER = 32
"""Of the step that places are held against."""
WHOLE: dict[str, Switches] = {"whole": {}}
COLD: dict[str, Switches] = {"cold start": {"warm_start": False}}


@dataclass(frozen=True)
class Study:
    """A scene under several switches.

    Attributes:
        title: of its rows and panels.
        scene: with its initial states.
        seconds: of the run.
        measures: by name with unit; the first is drawn.
        switches: by label, for joints as trees.
        rows: by label, for the same joints as rows.
        restitution: of all contacts.
        struck: when all have landed on a foot [s].
    """

    title: str
    scene: JointedScene
    seconds: float
    measures: Mapping[str, Callable[[Run], float]]
    switches: Mapping[str, Switches]
    rows: Mapping[str, Switches]
    restitution: float = 0.0
    struck: float = 0.0

    def variants(self) -> Iterator[tuple[str, JointedScene, Switches]]:
        """Labels, scenes and switches."""
        for label, changes in self.switches.items():
            yield label, self.scene, changes
        for label, changes in self.rows.items():
            yield f"joints as rows, {label}", given_way(self.scene), changes


class Run:
    """One scene under one scheme, a state each 0.01 s."""

    def __init__(self, study: Study, scene: JointedScene, scheme: Scheme) -> None:
        """Roll it out."""
        self.study, self.scene, self.scheme = study, scene, scheme
        self.world = scene.world(study.restitution)
        start, walk = scene.states(self.world), Walk(self.world, scheme, round(DT / scheme.dt))
        self.states = np.concatenate([start[None], walk.along(start, round(study.seconds / DT))])

    def velocities(self) -> Array:
        """(batch, 3 bodies) [m/s] right after the impact."""
        layout, state = Layout(self.world), self.states[round(self.study.struck / DT)]
        return np.concatenate([state[:, layout[f"{body.name}.velocity"]] for body in self.world.bodies], axis=-1)

    def places(self) -> Array:
        """(batch, bodies, 3) [m] at the end."""
        return self.scene.places(self.world, self.states[-1])


def answer(study: Study, scene: JointedScene, scheme: Scheme) -> Run:
    """What a run is held against, computed once."""
    key = study.title, scene.name, scheme
    if key not in ANSWERS:
        ANSWERS[key] = Run(study, scene, scheme)
    return ANSWERS[key]


ANSWERS: dict[tuple[str, str, Scheme], Run] = {}
"""By title, scene and scheme."""


def drift(run: Run) -> float:
    """Largest change of energy [J]."""
    energy = mechanical_energy(run.world, run.states)
    return float(np.abs(energy - energy[0]).max())


def gained(run: Run) -> float:
    """The most energy that a run has above what it had before [J]."""
    energy = mechanical_energy(run.world, run.states)
    return float((energy - np.minimum.accumulate(energy, axis=0)).max())


def parted(run: Run) -> float:
    """How far a joint is apart at most [mm]."""
    read = reading_function(run.world)
    rows = run.states.reshape(-1, run.states.shape[-1])
    return 1e3 * float(np.array(read.map(len(rows))(rows.T, np.zeros((0, len(rows))))[3]).max())


def jolt(run: Run) -> float:
    """Velocities right after the impact against those with 500 sweeps, rms [m/s]."""
    many = answer(run.study, run.scene, replace(run.scheme, sweeps=MANY))
    return rms(run.velocities() - many.velocities())


def strayed(run: Run) -> float:
    """Places at the end against the whole scheme with exact trees and a fine step, rms [mm]."""
    fine = answer(run.study, run.study.scene, Scheme(dt=DT / FINER, sweeps=50))
    return 1e3 * rms(run.places() - fine.places())


def rms(differences: Array) -> float:
    """Over all."""
    return float(np.sqrt((differences**2).mean()))


def instructions(world: World, scheme: Scheme) -> int:
    """Of all pieces of a step."""
    return sum(piece.function.n_instructions() for piece in trace_step(world, scheme, exact=True).calls)


def studies() -> list[Study]:
    """All of them."""
    swing = {"energy drift [J]": drift, "separation [mm]": parted}
    loop = dict(reversed(swing.items()))
    fall = {"velocity after [m/s]": jolt, "place at the end [mm]": strayed, "separation [mm]": parted}
    starts = WHOLE | COLD
    passes = {f"position sweeps: {n}": {"position_sweeps": n} for n in (0, 1, 10)}
    cuts = {f"cuts: {n}": {"cuts": n} for n in (0, 1)}
    uncut, unseen = {"cuts: 0": {"cuts": 0}}, {"no time of impact": {"time_of_impact": False}}
    capped = WHOLE | {"no cap on energy": {"energy_cap": False}}
    impacts, legs = capped | cuts | unseen, WHOLE | cuts | unseen
    return [
        Study("Two rods", swinging([1.0, 1.0]), 2.0, swing, WHOLE, starts),
        Study("Five rods, the last of 50 kg", swinging([1.0] * 4 + [50.0]), 2.0, swing, WHOLE, starts),
        Study("One loop", parallelograms(1.2), 2.0, loop, WHOLE | COLD | passes, {}),
        Study("Two loops", parallelograms(0.6, 0.3), 2.0, loop, WHOLE | COLD | passes, {}),
        Study("Chain on a foot", falling_chain(), 0.2, fall | {"gained [J]": gained}, impacts, uncut, 0.8, 0.04),
        Study("Chain thrown, e = 1", thrown_chain(), 0.3, {"gained [J]": gained}, capped, {}, 1.0),
        Study("Quadruped on a foot", falling_quadruped(), 0.3, fall, legs, {}, 0.3, 0.12),
    ]


def curves(study: Study, sweeps: Sequence[int] = SWEEPS) -> list[Curve]:
    """Every variant at these sweeps."""
    found = []
    for label, scene, changes in study.variants():
        costs, errors = [], []
        for n in sweeps:
            run = Run(study, scene, Scheme(dt=DT, sweeps=n, **changes))
            costs.append(instructions(run.world, run.scheme))
            errors.append([measure(run) for measure in study.measures.values()])
        found.append(Curve(label, tuple(sweeps), np.array(costs, float), np.array(errors)))
    return found


def report(study: Study, found: Sequence[Curve]) -> None:
    """A row of the table for each variant and measure, and for what a step costs."""
    for k, name in enumerate((*study.measures, "1000 instructions")):
        for curve in found:
            row = [f"{e:.1e}" for e in curve.errors[:, k]] if k < len(study.measures) else []
            cells = row or [f"{n / 1e3:.3g}" for n in curve.instructions]
            print(f"| {study.title}: {name} | {curve.label} |", " | ".join(cells), "|", flush=True)


def main() -> None:
    """Print the table, draw the figure."""
    print("| sweeps | |", " | ".join(map(str, SWEEPS)), "|")
    print("|---" * (len(SWEEPS) + 2) + "|")
    panels = {}
    for study in studies():
        found = curves(study)
        report(study, found)
        panels[study.title] = next(iter(study.measures)), found
    joint_figure(panels, Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "joints.svg")


if __name__ == "__main__":
    main()
