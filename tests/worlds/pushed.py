"""A problem with controls, a parameter, costs over time, a target and a constraint, small enough to check by hand."""

PUSHED = """
[simulation]
duration = 1.0
dt = 0.01

[world]
gravity = [0, 0, 0]

[[body]]
name = "puck"
shape = { sphere = { radius = 0.1 } }
mass = 2.0

[[variable]]
name = "push"
sets = "puck.force[0:2]"
knots = 4
guess = [[1, 2], [3, 4], [5, 6], [7, 8]]

[[variable]]
name = "mass"
sets = "puck.mass"
guess = 2.0

[[cost]]
name = "effort"
at = "always"
squares = "puck.force"
weight = 0.5

[[cost]]
name = "path"
at = "always"
value = "puck.position[0] + time"

[[target]]
name = "place"
value = "puck.position[0:2] - [1, 0]"
tolerance = 0.1
weight = 3.0

[[constraint]]
name = "speed"
at = "always"
value = "puck.velocity[0]"
upper = 1.5
tolerance = 0.01
penalty = 7.0
"""
