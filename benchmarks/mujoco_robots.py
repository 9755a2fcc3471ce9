"""Robots in MuJoCo: models that our exporter writes, their initial states, rollouts of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from consistency import SAMPLE
from mujoco_runs import Runs, mujoco
from robots import JointedScene

from symphys.export import mjcf
from symphys.types import Array


def model_of(scene: JointedScene, dt: float, integrator: str, cone: str = "elliptic", index: int = 0) -> mujoco.MjModel:
    """The robot as exported, with an integrator and a cone of one's choice; the keyframe is one initial state."""
    text = mjcf(scene.robot, scene.start[index], dt, scene.name)
    return mujoco.MjModel.from_xml_string(text.replace("implicitfast", integrator).replace("elliptic", cone))


def states_of(scene: JointedScene) -> Array:
    """(batch, nstate) time, coordinates, rates: those of the keyframes; nothing else has a state."""
    models = [model_of(scene, 0.01, "Euler", index=k) for k in range(len(scene.start))]
    return np.array([np.concatenate([[0.0], model.key_qpos[0], model.key_qvel[0]]) for model in models])


@dataclass(frozen=True)
class ThereJointed:
    """MuJoCo on a robot; see ``consistency.Engine``."""

    name: str
    scene: JointedScene
    integrator: str
    cone: str = "elliptic"

    def runner(self, dt: float, every: float = SAMPLE) -> Callable[[int, int], Array]:
        """(batch, count) -> (count, batch, nstate) states at the samples."""
        runs, states = Runs(model_of(self.scene, dt, self.integrator, self.cone)), states_of(self.scene)
        return lambda batch, count: runs.along(states[:batch], round(every / dt), count)

    def places(self, states: Array) -> Array:
        """(..., bodies, 3) the centres, in the order of the scene's bodies."""
        model = model_of(self.scene, 0.01, self.integrator)
        data, found = mujoco.MjData(model), []
        order = [model.body(body.name).id for body in self.scene.robot.bodies]
        for state in states.reshape(-1, states.shape[-1]):
            data.qpos[:] = state[1 : 1 + model.nq]
            mujoco.mj_kinematics(model, data)
            found.append(data.xipos[order])
        return np.array(found).reshape(*states.shape[:-1], len(order), 3)
