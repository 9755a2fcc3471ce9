"""Tosses in MuJoCo: the same bodies, with parameters of its own contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import mujoco
import mujoco.rollout
import numpy as np
from scipy.spatial.transform import Rotation
from tosses_data import BOX, CUBE, HINGE, RATE, Tossed, Tosses, angles_between, mean_errors
from tosses_search import Number
from tosses_symphys import CUBE_NUMBERS, ELBOW_NUMBERS, GRAVITY, LAW, MASS

from symphys.types import Array

SUBSTEPS, CHUNK = 4, 24
"""Time steps of a frame, and how many tosses of about the same length are simulated in one call."""
OWN = (
    Number("friction", 0.18, 0.1),
    Number("torsion", 0.003, 0.5),
    Number("rolling", 0.0005, 0.5),
    Number("timeconst", 0.008, 0.3),
    Number("dampratio", 0.7, 0.2),
    Number("dmin", 0.9, 0.03),
    Number("dmax", 0.05, 0.3),
    Number("width", 0.001, 0.5),
    Number("impratio", 1.0, 0.3),
)
"""Of contacts: geom.friction, solref, and solimp with the impedance at the surface, by how much the deepest is below 1,
and the depth [m] between them."""
BODIES = tuple(each for each in (*CUBE_NUMBERS, *ELBOW_NUMBERS) if each not in LAW and each.name != "edge")


def numbers_of(tossed: Tossed) -> tuple[Number, ...]:
    """What is fitted: those of contacts, and those of bodies that this engine has too."""
    names = [each.name for each in (CUBE_NUMBERS if tossed is CUBE else ELBOW_NUMBERS)]
    return *OWN, *[each for each in BODIES if each.name in names]


def contact_xml(values: Mapping[str, float]) -> str:
    """The attributes of each geom."""
    dmin, dmax = min(values["dmin"], 0.99), 1 - min(values["dmax"], 0.5)
    solimp = f"{min(dmin, dmax):.6g} {dmax:.6g} {values['width']:.6g}"
    friction = f"{values['friction']:.6g} {values['torsion']:.6g} {values['rolling']:.6g}"
    solref = f"{max(values['timeconst'], 2 / RATE / SUBSTEPS):.6g} {values['dampratio']:.6g}"
    return f'condim="6" friction="{friction}" solref="{solref}" solimp="{solimp}"'


def cube_xml(values: Mapping[str, float], contact: str) -> str:
    """Its frame lies in the middle, and its centre of mass beside it."""
    com, half = " ".join(f"{values[f'com{k}']:.8g}" for k in range(3)), values["size"] / 2
    m = [values[f"moment{k}"] for k in range(3)]
    moments = " ".join(f"{sum(m) - each:.8g}" for each in m)
    inertial = f'<inertial pos="{com}" mass="{MASS}" diaginertia="{moments}"/>'
    return f'<body><freejoint/>{inertial}<geom type="box" size="{half} {half} {half}" {contact}/></body>'


def elbow_xml(values: Mapping[str, float], contact: str) -> str:
    """Two boxes of the second of which the frame lies at the hinge."""
    sides, inertials = np.array([0.1, 0.05, 0.05]), []
    for share, at in ((1 - values["share"], np.zeros(3)), (values["share"], BOX)):
        mass = 2 * MASS * share
        moments = values["inertia"] * mass / 12 * (sides @ sides - sides**2)
        place, diagonal = " ".join(map(str, at)), " ".join(f"{m:.8g}" for m in moments)
        inertials.append(f'<inertial pos="{place}" mass="{mass:.8g}" diaginertia="{diagonal}"/>')
    hinge = f'frictionloss="{values["hinge_friction"]:.6g}" damping="{values["hinge_damping"]:.6g}"'
    box, hinge_at = " ".join(map(str, BOX)), " ".join(map(str, HINGE))
    return (
        f'<body name="one"><freejoint/>{inertials[0]}<geom type="box" size="0.05 0.025 0.025" {contact}/>'
        f'<body name="two" pos="{hinge_at}"><joint type="hinge" axis="0 1 0" {hinge}/>{inertials[1]}'
        f'<geom type="box" size="0.05 0.025 0.025" pos="{box}" {contact}/></body></body>'
    )


def model_of(tossed: Tossed, values: Mapping[str, float], gravity: float = GRAVITY) -> mujoco.MjModel:
    """The model with these values; the two boxes of the elbow do not touch."""
    contact = contact_xml(values)
    body = (cube_xml if tossed is CUBE else elbow_xml)(values, contact)
    apart = '<contact><exclude body1="one" body2="two"/></contact>' if tossed is not CUBE else ""
    option = (
        f'timestep="{1 / RATE / SUBSTEPS}" gravity="0 0 {-gravity}" cone="elliptic" impratio="{values["impratio"]}"'
    )
    table = f'<geom type="plane" size="5 5 0.1" pos="0 0 {values["height"]}" {contact}/>'
    return mujoco.MjModel.from_xml_string(
        f"<mujoco><option {option}/><worldbody>{table}{body}</worldbody>{apart}</mujoco>"
    )


@dataclass
class MujocoSimulator:
    """Simulates tosses, for any numbers; see ``Simulator``."""

    tossed: Tossed
    tosses: Tosses
    numbers: Sequence[Number]
    first: Mapping[str, Array]
    fixed: Mapping[str, float] = field(default_factory=dict)
    threads: int = 1

    def frames(self, values: Mapping[str, float]) -> list[tuple[Array, ...]]:
        """Of each toss the errors of its frames [m], [rad], [rad]."""
        model = model_of(
            self.tossed, {each.name: each.guess for each in self.numbers} | dict(self.fixed) | dict(values)
        )
        data = [mujoco.MjData(model) for _ in range(self.threads)]
        lengths = np.diff(self.tosses.start)
        order, initial = np.argsort(lengths), self._states(model)
        found: dict[int, tuple[Array, ...]] = {}
        for chunk in np.array_split(order, max(len(order) // CHUNK, 1)):
            steps = int(lengths[chunk].max() - 1) * SUBSTEPS
            states, _ = mujoco.rollout.rollout(model, data, initial[chunk], nstep=steps)
            for k, motion in zip(chunk, states, strict=True):
                simulated = np.concatenate([initial[k][None], motion])[::SUBSTEPS][: lengths[k]]
                found[int(k)] = self._errors(int(k), simulated[:, 1 : 1 + model.nq])
        return [found[k] for k in range(len(self.tosses))]

    def _states(self, model: mujoco.MjModel) -> Array:
        """(K, n): time, coordinates and velocities at the start; angular velocities are those of the body's axes."""
        first, K = self.first, len(self.tosses)
        turn = Rotation.from_quat(first["orientation"], scalar_first=True)
        spin = turn.inv().apply(first["angular_velocity"])
        parts = [np.zeros((K, 1)), first["position"], first["orientation"]]
        parts += [first[key].reshape(K, 1) for key in ("angle",) if key in first]
        parts += [first["velocity"], spin]
        parts += [first[key].reshape(K, 1) for key in ("rate",) if key in first]
        found = np.concatenate(parts, axis=1)
        return np.concatenate([found, np.zeros((K, mujoco.mj_stateSize(model, FULL) - found.shape[1]))], axis=1)

    def _errors(self, toss: int, simulated: Array) -> tuple[Array, ...]:
        """Not finite ones are infinitely far away."""
        rows, measured = self.tosses.rows(toss), self.tosses.columns
        n = rows.stop - rows.start
        if not np.isfinite(simulated).all():
            return (np.full(n, np.inf),) * len(self.tossed.measures)
        away = np.linalg.norm(simulated[:, :3] - measured["position"][rows], axis=1)
        parts = [away, angles_between(measured["orientation"][rows], simulated[:, 3:7])]
        if "angle" in self.tossed.measures:
            off = simulated[:, 7] - measured["angle"][rows]
            parts.append(np.abs(off - 2 * np.pi * np.round(off / 2 / np.pi)))
        return tuple(parts)

    def errors(self, values: Mapping[str, float]) -> Array:
        """(K, m) of the published measure."""
        return mean_errors(self.tossed, self.tosses, self.frames(values))


FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
