"""A guessed motion: the quantities that it may name, how they move between known times, and one from a recording."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import casadi as ca
import numpy as np

from symphys.dynamics.observation import joint_turn
from symphys.maths import rotation
from symphys.model.joints import Joint, Link, kinematic_trees
from symphys.model.world import World
from symphys.records import dataclass
from symphys.types import Array

ORIENTATION = "orientation"
"""The field of quantities that are unit quaternions w x y z; their rates are ``angular_velocity``."""
OF_BODIES = {"position": 3, ORIENTATION: 4, "velocity": 3, "angular_velocity": 3}
OF_BALLS = {ORIENTATION: 4, "angular_velocity": 3}
RATES = {ORIENTATION: "angular_velocity", "angle": "rate"}
SPEEDS = {"velocity", "rate", *RATES.values()}
"""Fields of quantities that are rates."""


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


@dataclass(frozen=True)
class GuessedMotion:
    """A guessed motion: quantities at known times.

    Numbers move on straight lines between the times at which they are known. Orientations turn on the shortest way,
    the geodesic, at constant angular velocity (Shoemake 1985). Before the first and after the last time all stay.

    Attributes:
        columns: times (K,) [s], ascending, and values (K, components) there, by names such as ``knee.angle``,
            ``knee.rate``, ``torso.position``; ``torso.orientation`` and those of ball joints are unit quaternions
            w x y z, and no two that follow each other are half a turn apart.
    """

    columns: Mapping[str, tuple[Array, Array]]

    def at(self, name: str, times: Array) -> Array:
        """(M, components) at times (M,) [s]."""
        known, values = self.columns[name]
        if not is_orientation(name):
            return np.stack([np.interp(times, known, column) for column in values.T], axis=1)
        place = np.interp(times, known, np.arange(len(known)))
        before = np.minimum(place.astype(int), max(len(known) - 2, 0))
        after = np.minimum(before + 1, len(known) - 1)
        found = turned_by_share()(values[before].T, values[after].T, (place - before)[None])
        return np.asarray(found).T

    def rate(self, name: str, times: Array, dt: float) -> Array:
        """(M, components) the slope over dt [s] about the times, as far as something is known there.

        Of an orientation the angular velocity (M, 3) [rad/s], in the axes that it is told in.
        """
        known = self.columns[name][0]
        before, after = (np.clip(times + side * dt / 2, known[0], known[-1]) for side in (-1, 1))
        apart, (first, last) = after - before, (self.at(name, each) for each in (before, after))
        rise = turn_between(first, last) if is_orientation(name) else last - first
        return np.where(apart[:, None] > 0, rise / np.where(apart > 0, apart, 1.0)[:, None], 0.0)


def is_orientation(name: str) -> bool:
    """Whether a quantity is a unit quaternion."""
    return name.rpartition(".")[2] == ORIENTATION


def turn_between(first: Array, last: Array) -> Array:
    """(M, 3) rotation vectors [rad] that turn orientations (M, 4) into others."""
    return np.asarray(rotation_between()(first.T, last.T)).T


@cache
def rotation_between() -> ca.Function:
    """(p, q) -> the rotation vector that turns p into q."""
    p, q = ca.SX.sym("p", 4), ca.SX.sym("q", 4)
    return ca.Function("between", [p, q], [rotation.between(p, q)])


@cache
def turned_by_share() -> ca.Function:
    """(p, q, share) -> the orientation on the way from p to q."""
    p, q, share = ca.SX.sym("p", 4), ca.SX.sym("q", 4), ca.SX.sym("share")
    return ca.Function("turned", [p, q, share], [rotation.turn(p, share * rotation.between(p, q))])


def recorded_guess(world: World, times: Array, recorded: Mapping[str, Array], pace: float = 1.0) -> GuessedMotion:
    """The motion through what was recorded; its columns are what the world and the recording both have.

    Args:
        world: of the problem that is guessed.
        times: (K,) [s] of the guess, ascending.
        recorded: quantities of bodies and joints at these times by their names, (K,) or (K, components).
        pace: rates are so many times what was recorded, as where the same way takes another time.
    """
    found = {**recorded}
    for joint in ball_joints(world):
        bodies = [world.bodies[i].name for i in joint.bodies]
        names = [f"{body}.{field}" for field in ("orientation", "angular_velocity") for body in bodies]
        if all(name in recorded for name in names):
            turn, spin = turns_of(joint)(*(np.asarray(recorded[name], float).T for name in names))
            found |= {f"{joint.name}.orientation": np.array(turn).T, f"{joint.name}.angular_velocity": np.array(spin).T}
    columns = {}
    for name, size in guessable(world).items():
        if name not in found:
            continue
        values, field = np.asarray(found[name], float).reshape(len(times), -1), name.rpartition(".")[2]
        if values.shape[1] != size or not np.isfinite(values).all():
            continue
        if field == "angle":
            values = np.unwrap(values, axis=0)
        columns[name] = times, values * pace if field in SPEEDS else values
    return GuessedMotion(columns)


def turns_of(joint: Joint) -> ca.Function:
    """(orientations of the bodies..., angular velocities...) -> ``joint_turn``, the numbers as columns of time."""
    count = len(joint.bodies)
    q, w = ([ca.SX.sym(f"{letter}{k}", size) for k in range(count)] for letter, size in (("q", 4), ("w", 3)))
    return ca.Function("turns", [*q, *w], list(joint_turn(joint, tuple(q), tuple(w))))
