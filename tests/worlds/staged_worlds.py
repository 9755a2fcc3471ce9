"""Problems whose states have all that a tangent must hold."""

from __future__ import annotations

from pathlib import Path

from symphys.problem import Problem, load_problem

LOOP = """
[simulation]
duration = 0.3
dt = 0.01
sweeps = 12
cuts = 0
[ground]
friction = 0.5
[[body]]
name = "crank"
shape = { box = { size = [0.3, 0.05, 0.05] } }
mass = 1
position = [0.15, 0, 1]
collides_with = []
[[body]]
name = "rod"
shape = { box = { size = [0.3, 0.05, 0.05] } }
mass = 1
position = [0.45, 0, 1]
collides_with = []
[[body]]
name = "rocker"
shape = { box = { size = [0.05, 0.05, 0.3] } }
mass = 1
position = [0.6, 0, 0.85]
collides_with = []
[[joint]]
name = "one"
between = ["world", "crank"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 1]
motor = { torque = { torque = 20 } }
[[joint]]
name = "two"
between = ["crank", "rod"]
ball = {}
point = [0.3, 0, 1]
[[joint]]
name = "three"
between = ["rod", "rocker"]
universal = { axes = [[0, 1, 0], [1, 0, 0]] }
point = [0.6, 0, 1]
spring = { stiffness = 2, damping = 0.1 }
[[joint]]
name = "four"
between = ["world", "rocker"]
hinge = { axis = [0, 1, 0] }
point = [0.6, 0, 0.7]
friction = 0.1
[[variable]]
name = "push"
sets = "one.command"
knots = 3
guess = [3, -2, 4]
[[cost]]
name = "far"
value = "rod.position[2]"
"""
SOFT = """
[simulation]
duration = 0.4
dt = 0.01
sweeps = 10
[ground]
friction = 0.6
[[body]]
name = "sledge"
shape = { box = { size = [0.4, 0.3, 0.2] } }
mass = 2
position = [0, 0, 0.11]
velocity = [1, 0.2, 0]
[[body]]
name = "mast"
shape = { spheres = [{ radius = 0.1, centre = [0, 0, 0.2] }] }
mass = 0.5
inertia = [0.01, 0.012, 0.002]
position = [0, 0, 0.5]
[[joint]]
name = "mount"
between = ["sledge", "mast"]
fixed = {}
point = [0, 0, 0.3]
frequency = 5
damping = 0.3
[[variable]]
name = "speed"
sets = "mast.velocity"
guess = [0.1, 0, 0]
[[variable]]
name = "wind"
sets = "mast.force[0]"
knots = 2
guess = [1, -1]
[[cost]]
name = "far"
value = "mast.position[0]"
"""

LEG = """
[simulation]
duration = 0.4
dt = 0.01
sweeps = 4
cuts = 0
[ground]
friction = 0.8
[[body]]
name = "trunk"
shape = { box = { size = [0.4, 0.2, 0.1] } }
mass = 4
position = [0, 0, 0.7]
collides_with = []
[[body]]
name = "upper"
shape = { box = { size = [0.05, 0.05, 0.3] } }
mass = 1
inertia = [0.01, 0.01, 0.002]
position = [0, 0, 0.5]
collides_with = []
[[body]]
name = "lower"
shape = { spheres = [{ radius = 0.05, centre = [0, 0, -0.15] }] }
mass = 0.6
inertia = [0.005, 0.005, 0.001]
position = [0, 0, 0.2]
[[joint]]
name = "hip"
between = ["trunk", "upper"]
hinge = { axis = [0, 1, 0] }
anchors = [[0, 0, -0.05], [0, 0, 0.15]]
motor = { servo = { gain = 20, torque = 30, velocity = 8 } }
start = 0.4
[[joint]]
name = "knee"
between = ["upper", "lower"]
hinge = { axis = [0, 1, 0] }
anchors = [[0, 0, -0.15], [0, 0, 0.15]]
motor = { servo = { gain = 20, torque = 30, velocity = 8 } }
start = -0.9
[[variable]]
name = "knee_at"
sets = "knee.anchor[2]"
guess = -0.17
[[cost]]
name = "height"
at = "always"
value = "trunk.position[2] + 0.1 * lower.velocity[0]"
"""
"""Its knee lies where a variable has it."""


def problem_of(name: str, folder: Path, more: str = "") -> Problem:
    """A shipped problem, or one of this module with ``more`` tables."""
    text = {"loop": LOOP, "soft": SOFT, "leg": LEG}.get(name)
    if text is None:
        return load_problem(Path(__file__).parents[2] / "problems" / f"{name}.toml")
    file = folder / f"{name}.toml"
    file.write_text(text + more)
    return load_problem(file)
