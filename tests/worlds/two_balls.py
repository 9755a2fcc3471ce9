"""A small valid problem of two balls, with one table of most kinds."""

TWO_BALLS = """
title = "Two balls"

[simulation]
duration = 1.0
dt = 0.01

[[body]]
name = "ball"
shape = { sphere = { radius = 0.5 } }
mass = 2.0
position = [0, 0, 1]
friction = 0.5

[[body]]
name = "marble"
shape = { sphere = { radius = 0.1 } }
density = 1000.0
position = [2, 0, 1]

[ground]
friction = 0.8
restitution = 0.5

[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 2, 3]

[[variable]]
name = "push"
sets = "marble.force[0:2]"
knots = 4

[[cost]]
name = "effort"
at = "always"
squares = "marble.force"

[[target]]
name = "lands there"
value = "ball.position - [1, 0, 0.5]"
tolerance = 0.01

[[constraint]]
name = "stays low"
at = "always"
value = "ball.position[2]"
upper = 5

[solver.gradient]
iterations = 10
"""
