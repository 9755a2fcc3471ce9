"""Joints: a compiled kernel gives what casadi does, values and gradients."""

from __future__ import annotations

import numpy as np
import pytest
from tools.agreement import assert_kernel_gives_what_casadi_does, transcribed

LEG = """
[simulation]
duration = 0.3
dt = 0.01
sweeps = 3
cuts = 0

[[body]]
name = "hull"
shape = { sphere = { radius = 0.05 } }
mass = 2.0
position = [0, 0, 0.57]
inertia = [0.01, 0.02, 0.02]

[[body]]
name = "thigh"
shape = { capsule = { radius = 0.04, length = 0.2 } }
mass = 1.0
position = [0, 0, 0.42]

[[body]]
name = "shin"
shape = { capsule = { radius = 0.03, length = 0.2 } }
mass = 0.5
position = [0, 0, 0.16]

[ground]
friction = 0.6

[[pair]]
between = ["hull", "shin"]
collide = false

[[joint]]
name = "rail"
between = ["world", "hull"]
slider = { axis = [0, 0, 1] }

[[joint]]
name = "hip"
between = ["hull", "thigh"]
universal = { axes = [[0, 1, 0], [1, 0, 0]] }
point = [0, 0, 0.54]
motor = { velocity = { torque = 5, velocity = 6 } }
limits_deg = [-40, 60]

[[joint]]
name = "knee"
between = ["thigh", "shin"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0.29]
motor = { servo = { gain = 20, torque = 30, velocity = 8 } }
limits_deg = [-90, 5]
spring = { stiffness = 5, damping = 0.1 }

[[variable]]
name = "bend"
sets = "knee.command"
knots = 3
guess = [-0.2, -0.5, 0.1]
spread = 0.1

[[variable]]
name = "swing"
sets = "hip.command"
guess = [0.5, 0.3]
spread = 0.2

[[variable]]
name = "stiff"
sets = "knee.stiffness"

[[variable]]
name = "fall"
sets = ["hull.velocity[2]", "thigh.velocity[2]", "shin.velocity[2]"]
guess = -1.5

[[target]]
name = "place"
value = "[hull.position[2] - 0.4, hip.angle, 0.1 * knee.rate]"
tolerance = 0.1

[[cost]]
name = "effort"
at = "always"
squares = "knee.torque"
weight = 0.01
"""


@pytest.mark.parametrize("smoothing", [0.0, 1e-3])
def test_a_kernel_gives_what_casadi_does(smoothing: float) -> None:
    """Of a leg that lands on its foot, by commands, a stiffness and the speed of the fall."""
    assert_kernel_gives_what_casadi_does(LEG, smoothing)


def test_the_leg_lands() -> None:
    leg = transcribed(LEG, "casadi")
    assert np.abs(leg.simulate(leg.shooting.start(0)).contact_force).max() > 0
