"""The same scenes in MuJoCo: models with a contact of one's choice, and rollouts by its own C loop, one thread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenes import Scene

from symphys.types import Array

try:
    import mujoco
    from mujoco import rollout
except ImportError:  # what is measured of this engine alone goes without
    mujoco = rollout = None


@dataclass(frozen=True)
class Contact:
    """How hard MuJoCo's contact is.

    Attributes:
        name: in figures.
        solref: (time constant [s], damping ratio), or (-stiffness, -damping) [1/s^2, 1/s].
        solimp: impedance; close to 1 is close to a hard constraint.
        integrator: "Euler" is MuJoCo's default.
    """

    name: str
    solref: tuple[float, float] = (0.02, 1.0)
    solimp: tuple[float, ...] = (0.9, 0.95, 0.001)
    integrator: str = "Euler"

    def attributes(self, friction: float) -> str:
        """Of a geom."""
        ref, imp = (" ".join(f"{number:.12g}" for number in numbers) for numbers in (self.solref, self.solimp))
        return f'friction="{friction} 0 0" condim="3" solref="{ref}" solimp="{imp}"'


def model_of(scene: Scene, contact: Contact, dt: float, tolerance: float = 1e-8) -> mujoco.MjModel:
    """The scene's model; friction cones are elliptic, as here. 1e-8 is the default tolerance of its solver."""
    attributes = contact.attributes(scene.friction)
    bodies = "".join(solid.xml(attributes) for solid in scene.solids)
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><size memory="64M"/><option timestep="{dt!r}" gravity="0 0 {-scene.gravity}" cone="elliptic" '
        f'integrator="{contact.integrator}" tolerance="{tolerance}"/><worldbody>'
        f'<geom type="plane" size="50 50 1" {attributes}/>{bodies}</worldbody></mujoco>'
    )


def states_of(scene: Scene) -> Array:
    """(batch, nstate) time, positions and velocities; MuJoCo's angular velocities are in the body's frame."""
    rows = []
    for start in scene.start:
        velocity = [np.concatenate([body[7:10], rotated_back(body[3:7], body[10:])]) for body in start]
        rows.append(np.concatenate([[0.0], start[:, :7].ravel(), *velocity]))
    return np.array(rows)


def rotated_back(q: Array, v: Array) -> Array:
    """A vector of the world, in the frame of a body."""
    result, inverse = np.zeros(3), np.zeros(4)
    mujoco.mju_negQuat(inverse, q)
    mujoco.mju_rotVecQuat(result, v, inverse)
    return result


class Runs:
    """Rollouts of one model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """With data of its own."""
        self.model, self.data = model, mujoco.MjData(model)

    def after(self, states: Array, steps: int) -> Array:
        """(batch, steps, nstate) the states after each step."""
        return np.array(rollout.rollout(self.model, self.data, np.ascontiguousarray(states), nstep=steps)[0])

    def last(self, states: Array, steps: int, most: int = 5000) -> Array:
        """(batch, nstate) the states after all steps, without those between in memory."""
        while steps:
            some = min(steps, most)
            states, steps = self.after(states, some)[:, -1], steps - some
        return states

    def along(self, states: Array, interval: int, count: int) -> Array:
        """(count, batch, nstate) after every ``interval`` steps; one rollout, so that warm starts go on."""
        return np.moveaxis(self.after(states, interval * count)[:, interval - 1 :: interval], 0, 1)
