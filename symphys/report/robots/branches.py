"""Kinematic branches: the bodies that joints connect, cut at a base body; bodies of a branch share a colour."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory


@dataclass(frozen=True)
class KinematicBranch:
    """Bodies that joints connect once the base body is taken away, by index; the base is a branch of its own."""

    name: str
    bodies: tuple[int, ...]
    colour: str
    is_base: bool


def linked(trajectory: Trajectory, scene: Scene) -> tuple[int, ...]:
    """Return the bodies that joints connect to a body or the world."""
    held = {name for joint in scene.joints for name in joint.bodies}
    return tuple(index for index, name in enumerate(trajectory.body_names) if name in held)


def is_large(trajectory: Trajectory, scene: Scene) -> bool:
    """Whether joints hold more bodies than there are colours."""
    return len(linked(trajectory, scene)) > len(palette.BODIES)


def colours(trajectory: Trajectory, scene: Scene) -> tuple[str, ...]:
    """Return the colour of each body: its own, or its branch's where joints connect many."""
    names = trajectory.body_names
    if not is_large(trajectory, scene):
        return tuple(palette.BODIES[index % len(palette.BODIES)] for index in range(len(names)))
    of_branch = {body: branch.colour for branch in branches(trajectory, scene) for body in branch.bodies}
    return tuple(of_branch.get(index, palette.FAINT) for index in range(len(names)))


def keys(trajectory: Trajectory, scene: Scene) -> list[tuple[str, str]]:
    """Return (name, colour) of bodies, or of branches where joints connect many; none where colours are plain."""
    if is_large(trajectory, scene):
        found = [(branch.name, branch.colour) for branch in branches(trajectory, scene)]
    else:
        found = list(zip(trajectory.body_names, colours(trajectory, scene), strict=True))
    return found if 1 < len(found) <= len(palette.BODIES) else []


def traced(trajectory: Trajectory, scene: Scene) -> tuple[str, ...]:
    """Return the bodies whose path is drawn: all, or of many that joints connect the bases and the ends of branches."""
    names = trajectory.body_names
    if not is_large(trajectory, scene):
        return names
    edges, held = edges_of(trajectory, scene), linked(trajectory, scene)
    bases = {branch.bodies[0] for branch in branches(trajectory, scene) if branch.is_base}
    ends = {body for body in held if sum(body in edge for edge in edges) == 1}
    return tuple(name for body, name in enumerate(names) if body in bases | ends or body not in held)


def branches(trajectory: Trajectory, scene: Scene) -> list[KinematicBranch]:
    """Base bodies, each followed by the branches that joints connect to it, in the order of the bodies."""
    found: list[KinematicBranch] = []
    edges = edges_of(trajectory, scene)
    for group in components(linked(trajectory, scene), edges):
        base = base_of(group, edges, trajectory, scene)
        found.append(KinematicBranch(trajectory.body_names[base], (base,), palette.BODIES[0], True))
        for number, bodies in enumerate(components([body for body in group if body != base], edges)):
            name = branch_name([trajectory.body_names[body] for body in bodies])
            found.append(KinematicBranch(name, bodies, palette.BODIES[1 + number % (len(palette.BODIES) - 1)], False))
    return found


def edges_of(trajectory: Trajectory, scene: Scene) -> set[frozenset[int]]:
    """Return the pairs of bodies that joints connect."""
    index = {name: body for body, name in enumerate(trajectory.body_names)}
    pairs = [frozenset(index[name] for name in joint.bodies if name in index) for joint in scene.joints]
    return {pair for pair in pairs if len(pair) == 2}


def components(bodies: Sequence[int], edges: set[frozenset[int]]) -> list[tuple[int, ...]]:
    """Return the connected parts of ``bodies``, in their order."""
    left, found = list(bodies), []
    while left:
        group, queue = set[int](), [left[0]]
        while queue:
            body = queue.pop()
            group.add(body)
            queue += [other for other in left if other not in group and frozenset((body, other)) in edges]
        found.append(tuple(body for body in left if body in group))
        left = [body for body in left if body not in group]
    return found


def base_of(group: Sequence[int], edges: set[frozenset[int]], trajectory: Trajectory, scene: Scene) -> int:
    """Return the body that the world holds, else the one with most joints, the first of equals."""
    grounded = {joint.first for joint in scene.joints if not joint.second}
    held = [body for body in group if trajectory.body_names[body] in grounded]
    return held[0] if held else max(group, key=lambda body: sum(body in edge for edge in edges))


def branch_name(names: Sequence[str]) -> str:
    """Return the beginning that the names of its bodies share, else the first name."""
    same = itertools.takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    return "".join(letters[0] for letters in same).rstrip("_-. ") or names[0]
