"""Gaits of Gymnasium's models: the problems take the models as their package has them."""

from __future__ import annotations

import numpy as np
import pytest
from tools.repeats import few

import symphys
from symphys.importing.packages import model_file

pytest.importorskip("gymnasium")
mujoco = pytest.importorskip("mujoco")
MODELS = {"half_cheetah_run": "half_cheetah", "hopper_run": "hopper", "walker2d_walk": "walker2d_v5", "ant_walk": "ant"}


@pytest.mark.slow
@few("name", MODELS, 1)
def test_the_model_is_untouched(name: str) -> None:
    """Masses, motors and friction are those of the file, and every motor is driven by both controllers."""
    problem = symphys.load(name)
    model = mujoco.MjModel.from_xml_path(str(model_file(f"package://gymnasium/envs/mujoco/assets/{MODELS[name]}.xml")))
    world = problem.world()
    assert sum(float(body.mass) for body in world.bodies) == pytest.approx(model.body_mass.sum(), rel=1e-12)
    motors = [joint for joint in world.joints if joint.motor is not None]
    gears = sorted(float(joint.motor.gear) for joint in motors)
    assert gears == pytest.approx(sorted(model.actuator_gear[:, 0]))
    assert sorted(float(j.armature) for j in motors) == pytest.approx(
        sorted(model.dof_armature[model.jnt_dofadr[model.actuator_trnid[:, 0]]])
    )
    driven = {f"{joint.name}.command" for joint in motors}
    assert [{drive for drive, _ in each.drives} for each in problem.controllers] == [driven, driven]
    grounded = {pair.law.friction for pair in world.pairs if pair.second.body is None}
    solid = model.geom_conaffinity.astype(bool) | model.geom_contype.astype(bool)
    assert grounded <= set(np.maximum(model.geom_friction[solid, 0], model.geom_friction[0, 0]).tolist())
