"""Measured tosses as MuJoCo predicts them, with its own parameters: friction, solver impedance, size, inertia."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np
from mujoco.rollout import Rollout
from numpy.typing import NDArray
from tosses_data import Toss, conjugate, product

Array = NDArray[np.float64]
SUBSTEPS = 4
"""Steps of MuJoCo in one frame of 6.8 ms; its contacts are not stable for stiff impedances in one."""

CUBE = """
<mujoco>
  <option timestep="{dt}" cone="elliptic" impratio="{impratio}" gravity="0 0 -9.81"/>
  <default><geom friction="{friction} {torsion} {rolling}" solref="{timeconst} {dampratio}"
    solimp="{dmin} {dmax} {width}" condim="{condim}"/></default>
  <worldbody>
    <geom name="table" type="plane" size="5 5 1" pos="0 0 {height}"/>
    <body><freejoint/><inertial pos="0 0 0" mass="0.37" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom type="box" size="{half} {half} {half}"/></body>
  </worldbody>
</mujoco>
"""
ELBOW = """
<mujoco>
  <option timestep="{dt}" cone="elliptic" impratio="{impratio}" gravity="0 0 -9.81"/>
  <default><geom friction="{friction} {torsion} {rolling}" solref="{timeconst} {dampratio}"
    solimp="{dmin} {dmax} {width}" condim="{condim}"/></default>
  <worldbody>
    <geom name="table" type="plane" size="5 5 1" pos="0 0 {height}"/>
    <body name="first"><freejoint/><inertial pos="0 0 0" mass="0.37" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom type="box" size="{long} {half} {half}"/>
      <body name="second" pos="-0.035 0.06 0">
        <joint type="hinge" axis="0 1 0" frictionloss="{dry}" damping="{damping}"/>
        <inertial pos="0.035 0 0" mass="0.37" diaginertia="{inertia} {inertia} {inertia}"/>
        <geom type="box" size="{long} {half} {half}" pos="0.035 0 0"/>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="first" body2="second"/></contact>
</mujoco>
"""


@dataclass(frozen=True)
class Parameter:
    """A number of the model: where a search begins, how far it goes at first, and what it means in the XML."""

    begin: float
    spread: float
    log: bool = False

    def value(self, y: float) -> float:
        """From the coordinate of the search."""
        return self.begin * float(np.exp(self.spread * y)) if self.log else self.begin + self.spread * y


SHARED = {
    "friction": Parameter(0.18, 0.1, log=True),
    "torsion": Parameter(1e-4, 1.0, log=True),
    "rolling": Parameter(1e-4, 1.0, log=True),
    "timeconst": Parameter(0.01, 0.4, log=True),
    "dampratio": Parameter(0.6, 0.4, log=True),
    "width": Parameter(1e-3, 0.7, log=True),
    "impratio": Parameter(5.0, 0.7, log=True),
    "height": Parameter(0.0, 5e-4),
    "half": Parameter(0.0524, 0.02, log=True),
    "inertia": Parameter(8.1e-4, 0.15, log=True),
}
SEARCHED: dict[str, dict[str, Parameter]] = {
    "cube": SHARED,
    "elbow": {
        **SHARED,
        "half": Parameter(0.025, 0.02, log=True),
        "long": Parameter(0.05, 0.02, log=True),
        "inertia": Parameter(6.167e-4, 0.15, log=True),
        "dry": Parameter(0.01, 0.7, log=True),
        "damping": Parameter(1e-3, 0.7, log=True),
    },
}
FIXED = {"dmin": 0.9, "dmax": 0.95, "condim": 6, "dt": 1 / 148 / SUBSTEPS}


def parameters(name: str, y: Sequence[float]) -> dict[str, float]:
    """By name, from the coordinates of a search."""
    return {key: each.value(float(v)) for (key, each), v in zip(SEARCHED[name].items(), y, strict=True)}


def predictor(name: str, tosses: Sequence[Toss], threads: int = 2) -> Callable[[Mapping[str, float]], list[Array]]:
    """From parameters to what each toss is at its frames: (n, 7) or, with the hinge, (n, 8)."""
    pool = Rollout(nthread=threads)
    order = np.argsort([-len(toss.position) for toss in tosses])
    return partial(_predicted, name, tosses, order, pool)


def _predicted(
    name: str, tosses: Sequence[Toss], order: NDArray[np.int64], pool: Rollout, values: Mapping[str, float]
) -> list[Array]:
    model = mujoco.MjModel.from_xml_string((CUBE if name == "cube" else ELBOW).format(**FIXED, **values))
    datas = [mujoco.MjData(model) for _ in range(pool.nthread)]
    found: list[Array] = [np.empty(0)] * len(tosses)
    for group in np.array_split(order, max(1, len(order) // 32)):
        frames = max(len(tosses[k].position) for k in group)
        begin = np.array([_state(model, tosses[k]) for k in group])
        states, _ = pool.rollout(model, datas, begin, nstep=SUBSTEPS * (frames - 1))
        width = model.nq
        for k, start, motion in zip(group, begin, states, strict=True):
            whole = np.vstack([start, motion[SUBSTEPS - 1 :: SUBSTEPS]])[: len(tosses[k].position)]
            found[k] = whole[:, 1 : 1 + width]
    return found


def _state(model: mujoco.MjModel, toss: Toss) -> Array:
    """Time, positions and velocities at the first frame; MuJoCo has the angular velocity in the body's frame."""
    q = toss.orientation[0]
    body = product(conjugate(q), product(np.array([0, *toss.angular_velocity[0]]), q))[1:]
    hinge = ([], []) if toss.angle is None or toss.rate is None else ([toss.angle[0]], [toss.rate[0]])
    qpos = [*toss.position[0], *q, *hinge[0]]
    qvel = [*toss.velocity[0], *body, *hinge[1]]
    state = np.concatenate([[0.0], qpos, qvel])
    return np.pad(state, (0, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS) - len(state)))
