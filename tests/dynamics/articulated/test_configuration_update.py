"""A step of a free chain keeps its joints closed and its momentum, whatever it starts the iteration from."""

from __future__ import annotations

import numpy as np
import pytest
from tools.laboratory import Lab
from worlds.linkage import chain, hanging, momenta, separations

from symphys.model.world import Scheme, World


@pytest.mark.slow
@pytest.mark.parametrize("warm_start", [True, False])
def test_joints_stay_closed_and_momentum_stays(warm_start: bool) -> None:
    made = chain(3, free=True)
    world = World(made.bodies, joints=made.joints, gravity=(0.0, 0.0, 0.0))
    values = hanging(3, [0.3, -0.5, 0.2])
    values |= {f"b{k}.angular_velocity": [0.0, rate, 0.0] for k, rate in enumerate((2.0, -1.0, 3.0))}
    states = Lab(world, Scheme(dt=0.01, sweeps=1, warm_start=warm_start)).states(values, 0.2)
    for kept in momenta(world, states):
        assert kept[1:] == pytest.approx(np.broadcast_to(kept[1], kept[1:].shape), abs=1e-10)
    assert separations(world, states)[1:].max() < 1e-12
