"""What a guess of a motion may name, and which quantity is the rate of which."""

from __future__ import annotations

from symphys.model.joints import Joint, Link, kinematic_trees
from symphys.model.world import World

ORIENTATION = "orientation"
"""The field of quantities that are unit quaternions w x y z; their rates are ``angular_velocity``."""
OF_BODIES = {"position": 3, ORIENTATION: 4, "velocity": 3, "angular_velocity": 3}
OF_BALLS = {ORIENTATION: 4, "angular_velocity": 3}
RATES = {ORIENTATION: "angular_velocity", "angle": "rate"}


def guessable(world: World) -> dict[str, int]:
    """Return what a guess may name, with the size of each.

    Of bodies that no joint of a tree holds position, orientation and the velocities, world frame. Of trees' joints the
    coordinates and their rates. Of their ball joints, which have no coordinates, the orientation of the second body
    against the first, 1 as the bodies lie in the file, and the angular velocity against it, in axes of the first.
    """
    jointed = tree_joints_of(world)
    held = {link.body for link, _ in jointed}
    found = {f"{b.name}.{f}": n for i, b in enumerate(world.bodies) if i not in held for f, n in OF_BODIES.items()}
    for link, joint in jointed:
        if is_ball(link, joint):
            found |= {f"{joint.name}.{field}": size for field, size in OF_BALLS.items()}
        elif joint.kind.coordinates:
            found |= {f"{joint.name}.{field}": len(joint.kind.coordinates) for field in (joint.kind.quantity, "rate")}
    return found


def tree_joints_of(world: World) -> list[tuple[Link, Joint]]:
    """The links that joints of trees hold, each with its joint."""
    links = [link for tree in kinematic_trees(world.joints) for link in tree.links]
    return [(link, world.joints[link.joint]) for link in links if link.joint is not None]


def is_ball(link: Link, joint: Joint) -> bool:
    """Whether a joint of a tree leaves turns free that have no coordinates."""
    return bool(link.count) and not joint.kind.coordinates


def ball_joints(world: World) -> list[Joint]:
    """Return the joints of the trees."""
    return [joint for link, joint in tree_joints_of(world) if is_ball(link, joint)]


def rate_of(name: str, sizes: dict[str, int]) -> str | None:
    """The rate of a quantity, by the names of ``guessable``; None for a rate."""
    owner, _, field = name.rpartition(".")
    if field == "position":
        return f"{owner}.velocity" if f"{owner}.velocity" in sizes else f"{owner}.rate"
    return f"{owner}.{RATES[field]}" if field in RATES else None
