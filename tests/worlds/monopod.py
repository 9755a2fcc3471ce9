"""A leg of two balls on a slider with a servo, above the ground: the smallest robot that hops."""

MONOPOD = """
[[body]]
name = "torso"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 0.6]
collides_with = []

[[body]]
name = "foot"
shape = { sphere = { radius = 0.1 } }
mass = 0.3
position = [0.05, 0, 0.13]

[[joint]]
name = "leg"
between = ["torso", "foot"]
slider = { axis = [0, 0, 1] }
motor = { servo = { gain = 20, torque = 40, velocity = 3 } }

[ground]
friction = 0.5
"""
