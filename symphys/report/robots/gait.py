"""Which bodies of a robot stand on what stands still, and when."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symphys.report.figures.contacts import labels, pair_of
from symphys.report.robots.branches import linked
from symphys.results.scene import Scene
from symphys.trajectory import Array, Mask, Trajectory

LOADED = 0.02
"""A body stands where it carries more than this share of the weight of all that joints hold."""


@dataclass(frozen=True)
class Stance:
    """When a body stands: ``stands`` (N,), whether it does in each step."""

    body: int
    stands: Mask

    @property
    def duty(self) -> float:
        """The share of the time."""
        return float(self.stands.mean())


def weight(trajectory: Trajectory, scene: Scene) -> float:
    """[N] of all bodies that joints hold; nan where a mass or gravity is not known."""
    names = {trajectory.body_names[body] for body in linked(trajectory, scene)}
    return scene.weight_per_mass * sum(body.mass for body in scene.bodies if body.name in names)


def stances(trajectory: Trajectory, scene: Scene) -> list[Stance]:
    """The bodies that ever stand; none where nothing is known to weigh anything."""
    least = LOADED * weight(trajectory, scene)
    if not least > 0:
        return []
    ground = [static.name for kind in (scene.planes, scene.fixtures, scene.terrain) for static in kind]
    held = set(linked(trajectory, scene))
    standing = [(label, body) for label, body, _ in labels(trajectory, scene) if body in held]
    owners = {f"{label}-{name}": body for label, body in standing for name in ground}
    loads: dict[int, Array] = {}
    for index, name in enumerate(trajectory.contact_names):
        body = owners.get(pair_of(name))
        if body is not None:
            loads[body] = loads.get(body, 0) + trajectory.contact_force[:, index]
    found = [Stance(body, np.linalg.norm(load, axis=1) > least) for body, load in sorted(loads.items())]
    return [stance for stance in found if stance.stands.any()]


def has_gait(found: list[Stance]) -> bool:
    """Whether some body comes down or leaves the ground."""
    return any(not stance.stands.all() for stance in found)
