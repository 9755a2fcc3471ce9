"""Kinematic trees: bodies that rigid joints connect, whose velocities are those of the joints' coordinates.

Joints that close a loop or are soft are no part of a tree; sweeps project them as they project contacts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from symphys.model.joints.joint import Joint
from symphys.records import dataclass

FLOATING = 6
"""Coordinates of a root that nothing holds: velocity and angular velocity."""


@dataclass(frozen=True)
class Link:
    """A body of a tree.

    Attributes:
        body: its index.
        joint: index of the joint that holds it to its parent; None for a root that floats.
        parent: index of a body; None: the world, or nothing.
        sign: 1 if the body is the joint's first side, so that it moves as coordinates grow, else -1.
        start, count: its coordinates among those of the tree.
    """

    body: int
    joint: int | None
    parent: int | None
    sign: int
    start: int
    count: int

    @property
    def coordinates(self) -> range:
        """Its coordinates among those of the tree."""
        return range(self.start, self.start + self.count)


@dataclass(frozen=True)
class KinematicTree:
    """A tree of two bodies or more, or of one that is held by the world; parents come before children."""

    links: tuple[Link, ...]

    @property
    def root(self) -> int:
        """The body that the sweeps keep the tree's velocities at."""
        return self.links[0].body

    @property
    def bodies(self) -> tuple[int, ...]:
        """Return the bodies in the order of the links."""
        return tuple(link.body for link in self.links)

    @property
    def size(self) -> int:
        """Return the number of coordinates."""
        return self.links[-1].start + self.links[-1].count


def kinematic_trees(joints: Sequence[Joint]) -> tuple[KinematicTree, ...]:
    """The trees of a world with these joints."""
    seen: set[int] = set()
    found = []
    for root in _roots(joints):
        if root not in seen:
            links = tuple(_grown(joints, root))
            seen |= {link.body for link in links}
            found.append(KinematicTree(links))
    return tuple(found)


def tree_joints(joints: Sequence[Joint]) -> frozenset[int]:
    """The indices of joints that trees hold exactly."""
    return frozenset(link.joint for tree in kinematic_trees(joints) for link in tree.links if link.joint is not None)


def carriers(count: int, joints: Sequence[Joint]) -> tuple[int, ...]:
    """Return for each of ``count`` bodies the carrier of its velocities: the root of its tree, or itself."""
    found = list(range(count))
    for tree in kinematic_trees(joints):
        for body in tree.bodies:
            found[body] = tree.root
    return tuple(found)


def _roots(joints: Sequence[Joint]) -> list[int]:
    """Bodies that rigid joints hold: first those that the world holds, then those with most joints."""
    rigid = [joint for joint in joints if not joint.soft]
    grounded = dict.fromkeys(joint.first for joint in rigid if joint.second is None)
    degree: dict[int, int] = {}
    for joint in rigid:
        for body in joint.bodies:
            degree[body] = degree.get(body, 0) + 1
    return [*grounded, *sorted(degree, key=lambda body: (-degree[body], body))]


def _grown(joints: Sequence[Joint], root: int) -> Iterator[Link]:
    """The links of the tree of a root, breadth first."""
    rigid = [(k, joint) for k, joint in enumerate(joints) if not joint.soft]
    held = next(((k, joint) for k, joint in rigid if joint.second is None and joint.first == root), None)
    count = FLOATING if held is None else held[1].kind.free
    yield Link(root, None if held is None else held[0], None, 1, 0, count)
    seen, queue, start = {root}, [root], count
    while queue:
        parent = queue.pop(0)
        for k, joint in rigid:
            if joint.second is None or parent not in joint.bodies:
                continue
            body = joint.second if joint.first == parent else joint.first
            if body in seen:
                continue
            free = joint.kind.free
            yield Link(body, k, parent, 1 if joint.first == body else -1, start, free)
            start += free
            seen.add(body)
            queue.append(body)
