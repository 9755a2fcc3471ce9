"""A robot file and a problem that includes it."""

from __future__ import annotations

ROBOT = """
title = "Two links"

[contact]
friction = 0.3

[[body]]
name = "torso"
mass = 2
inertia = 1
position = [0, 0, 1]
velocity = [1, 0, 0]
group = "robot"

[[body]]
name = "shin"
shape = { sphere = { radius = 0.1 } }
mass = 1
position = [0.5, 0, 1]
orientation = { roll_deg = 30 }
collides_with = ["floor"]

[[plane]]
name = "floor"
normal = [0, 0, 2]
offset = 0.4

[[block]]
name = "post"
shape = { box = { size = [0.1, 0.1, 0.1] } }
position = [3, 0, 0.5]

[[joint]]
name = "knee"
between = ["torso", "shin"]
hinge = { axis = [0, 1, 0] }
point = [0.25, 0, 1]
motor = { torque = { torque = 3 } }

[[joint]]
name = "rail"
between = ["world", "torso"]
universal = { axes = [[0, 1, 0], [1, 0, 0]] }
anchors = [[0, 0, 1.5], [0, 0, 0.5]]

[[variable]]
name = "bend"
sets = "knee.command"
knots = 2

[[cost]]
name = "effort"
at = "always"
squares = "knee.command"
"""
MAIN = """
[simulation]
duration = 1.0
dt = 0.01

[[include]]
file = "parts/robot.toml"

[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1
position = [0, 2, 9]

[[target]]
name = "bent"
value = "knee.angle - 0.5"
tolerance = 0.01
"""
