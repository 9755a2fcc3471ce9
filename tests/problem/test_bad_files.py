"""Bad problem files: one table of what is changed in a good file, and the place and remedy that the message names.

Each fault names the file, the table and the key where a person looks for it, and a word of what would be valid there.
How a message words the rest is free.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from data.mutated_texts import PROBLEM
from worlds.included import MAIN, ROBOT
from worlds.two_balls import TWO_BALLS

from symphys.cli import main as command
from symphys.errors import Issue, ProblemError
from symphys.problem import load_problem

Bad = tuple[dict[str, str], str, str, str]
"""The texts of the files by their names, the file and the place of a fault, and a word of its message."""
WHOLE, PART = "main.toml", "parts/robot.toml"


def changed(text: str, old: str, new: str) -> str:
    """A text with its first ``old`` replaced."""
    assert old in text, f"{old!r} is not in the text"
    return text.replace(old, new, 1)


# Changes of a file with two balls.
MASS = "mass = 2.0"
SETS = 'sets = "ball.velocity"\nguess = [1, 2, 3]'
GROUND = "[ground]"
COST = 'at = "always"\nsquares = "marble.force"'
OUTPUT = "[[output]]\nname = 'far'\nvalue = '"
TARGET = 'value = "ball.position - [1, 0, 0.5]"'

TWO = "friction = [0.5, 0.2]\nfriction_direction = [1, 0, 0]"
SURFACES = TWO_BALLS[TWO_BALLS.index("friction = 0.5") : TWO_BALLS.index("restitution = 0.5")]

WORLDS = [
    # keys and kinds
    (MASS, "mas = 2.0", 'body "ball".mas', '"mass"'),
    ("[ground]", "[grund]", "grund", '"ground"'),
    ("radius = 0.5", "radius = 0.5, colour = 3", 'body "ball".shape.sphere.colour', "hollow"),
    ("duration = 1.0", "", "simulation.duration", "required"),
    ("[simulation]\nduration = 1.0\ndt = 0.01", "", "simulation", "required"),
    (MASS, 'mass = "2"', 'body "ball".mass', "number"),
    (MASS, "mass = true", 'body "ball".mass', "number"),
    (MASS, "mass = nan", 'body "ball".mass', "finite"),
    (MASS, "mass = inf", 'body "ball".mass', "finite"),
    (MASS, "mass = 1" + "0" * 400, 'body "ball".mass', "number"),
    (MASS, "mass = 2020-01-01", 'body "ball".mass', "number"),
    (MASS, "mass = [1]", 'body "ball".mass', "number"),
    (MASS, "mass = { kg = 1 }", 'body "ball".mass', "number"),
    ("dt = 0.01", "dt = 0.01\nsweeps = 2.5", "simulation.sweeps", "whole"),
    ("dt = 0.01", "dt = 0.01\nsweeps = 0", "simulation.sweeps", "at least 1"),
    ("dt = 0.01", "dt = 0.01\nwarm_start = 1", "simulation.warm_start", "true or false"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = -1", "simulation.smoothing", "at least 0"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [0.1, -1]", "simulation.smoothing", "at least 0"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = []", "simulation.smoothing", "[0.1, 0.01, 0]"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [0.01, 0.1]", "simulation.smoothing", "decrease"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [0.1, 0, 0]", "simulation.smoothing", "decrease"),
    ("dt = 0.01", 'dt = 0.01\nsmoothing = "0.1"', "simulation.smoothing", "list"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [0.1, true]", "simulation.smoothing", "number"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [inf, 0]", "simulation.smoothing", "number"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [[0.1], 0]", "simulation.smoothing", "number"),
    ("title = ", "title = 5 # ", "title", "one line"),
    ("title = ", "plane = 3\ntitle = ", "plane", "list"),
    ("[solver.gradient]\niterations = 10", "[solver]\ngradient = 3", "solver.gradient", "table"),
    ("position = [0, 0, 1]", "position = [0, 1]", 'body "ball".position', "3 numbers"),
    ("position = [0, 0, 1]", 'position = [0, 1, "2"]', 'body "ball".position', "3 finite numbers"),
    ("position = [0, 0, 1]", "position = [0, 1, nan]", 'body "ball".position', "finite"),
    ("position = [0, 0, 1]", "position = 5", 'body "ball".position', "3 numbers"),
    # names
    ('name = "ball"', "", "body[0].name", "required"),
    ('name = "ball"', 'name = "my ball"', 'body "my ball".name', '"my_ball"'),
    ('name = "ball"', 'name = ""', "body[0].name", "name"),
    ('name = "ball"', 'name = "sin"', 'body "sin".name', "meaning"),
    ('name = "ball"', 'name = "time"', 'body "time".name', "meaning"),
    ('name = "ball"', 'name = "ground"', 'body "ground".name', "meaning"),
    ('name = "ball"', 'name = "lambda"', 'body "lambda".name', "meaning"),
    ('name = "marble"', 'name = "ball"', "body[1].name", '"ball"'),
    ('name = "throw"', 'name = "ball"', 'variable "ball".name', '"ball"'),
    (COST, f'{COST}\n[[cost]]\nname = "effort"\nvalue = "1"', "cost[1].name", '"effort"'),
    ('name = "effort"', 'name = "two\\nlines"', 'cost "two lines".name', "one line"),
    # simulation
    ("dt = 0.01", "dt = 0", "simulation.dt", "greater than 0"),
    ("dt = 0.01", "dt = 2", "simulation.dt", "duration"),
    ("dt = 0.01", "dt = 0.03", "simulation.dt", "dt = 0.0303030303"),
    ("duration = 1.0", "duration = 1e7", "simulation.dt", "dt = 10"),
    ("duration = 1.0\ndt = 0.01", "duration = 1e150\ndt = 1e-200", "simulation.dt", "dt = 1e+144"),
    # bodies
    (MASS, "mass = -1", 'body "ball".mass', "at least 0"),
    (MASS, "mass = 0", 'body "ball".mass', "greater than 0"),
    (MASS, "mass = 5e-324", 'body "ball".mass', "1e-100 to 1e+100 kg"),
    (MASS, "mass = 1e-310", 'body "ball".mass', "1e-100 to 1e+100 kg"),
    (MASS, "mass = 1e308", 'body "ball".mass', "1e-100 to 1e+100 kg"),
    (MASS, "mass = 2.0\ninertia = 1e-320", 'body "ball".inertia', "1e-140 to 1e+140 kg m^2"),
    (MASS, "mass = 2.0\ninertia = [1, 1, 1e200]", 'body "ball".inertia', "sum"),
    (MASS, "mass = 2.0\ninertia = 1e200", 'body "ball".inertia', "1e-140 to 1e+140 kg m^2"),
    ("{ radius = 0.5 }", "{ radius = 1e-160 }", 'body "ball".shape', "1e-140"),
    (MASS, "", 'body "ball".mass', "density"),
    (MASS, "mass = 2.0\ndensity = 1", 'body "ball".mass', "density"),
    ("{ radius = 0.1 }", "{ radius = 1e-120 }", 'body "marble".density', "1e-100 to 1e+100 kg"),
    ("{ radius = 0.1 }", "{ radius = 0.1, hollow = true }", 'body "marble".density', "mass"),
    ("radius = 0.5", "radius = -0.5", 'body "ball".shape.sphere.radius', "greater than 0"),
    ("{ sphere = { radius = 0.5 } }", "{}", 'body "ball".shape', "parts"),
    ("{ sphere = { radius = 0.5 } }", "{ spheres = [] }", 'body "ball".shape.spheres', "1 or more"),
    ("{ sphere = { radius = 0.5 } }", '"ball"', 'body "ball".shape', "table"),
    ("{ sphere = { radius = 0.5 } }", "{ cube = [1, 1, 1] }", 'body "ball".shape.cube', "box"),
    ("shape = { sphere = { radius = 0.5 } }", "", 'body "ball".inertia', "required"),
    ("shape = { sphere = { radius = 0.1 } }", "inertia = 1", 'body "marble".density', "volume"),
    (MASS, "mass = 2.0\ninertia = -1", 'body "ball".inertia', "positive"),
    (MASS, "mass = 2.0\ninertia = [1, 1, 3]", 'body "ball".inertia', "1, 1, 3"),
    (MASS, "mass = 2.0\ninertia = [1, 2]", 'body "ball".inertia', "three"),
    (MASS, "mass = 2.0\ninertia = [1, 2, true]", 'body "ball".inertia', "three"),
    (MASS, "mass = 2.0\ninertia = [[1,0,0],[0,1,0],[0.1,0,1]]", 'body "ball".inertia', "symmetric"),
    (MASS, "mass = 2.0\ninertia = [[1,2,0],[2,1,0],[0,0,1]]", 'body "ball".inertia', "-1, 1, 3"),
    (MASS, "mass = 2.0\norientation = [0, 0, 0, 0]", 'body "ball".orientation', "zero"),
    (MASS, "mass = 2.0\norientation = [1, 0, 0]", 'body "ball".orientation', "4 numbers"),
    (MASS, "mass = 2.0\norientation = { role_deg = 3 }", 'body "ball".orientation.role_deg', '"roll_deg"'),
    (MASS, 'mass = 2.0\ncollides_with = ["grund"]', 'body "ball".collides_with', '"ground"'),
    (MASS, 'mass = 2.0\ncollides_with = ["ball"]', 'body "ball".collides_with', "body"),
    # surfaces
    ("friction = 0.5", "friction = -0.5", 'body "ball".friction', "at least 0"),
    ("restitution = 0.5", "restitution = 1.5", "ground.restitution", "at most 1"),
    ("restitution = 0.5", "restitution = -0.1", "ground.restitution", "at least 0"),
    (GROUND, '[[plane]]\nname = "wall"\nnormal = [0, 0, 0]\noffset = 1\n[ground]', 'plane "wall".normal', "zero"),
    (GROUND, '[[plane]]\nname = "wall"\nnormal = [1, 0, 0]\n[ground]', 'plane "wall".offset', "point"),
    (GROUND, '[[plane]]\nname = "wall"\noffset = 0\n[ground]', 'plane "wall".normal', "required"),
    (GROUND, "[contact]\nfrequency = 5\n[ground]", "contact.frequency", "5 Hz"),
    (GROUND, "[contact]\nfrequency = 5\nrestitution = 0.5\n[ground]", "contact.frequency", "soft"),
    (GROUND, '[[pair]]\nbetween = ["ball", "ground"]\nfrequency = 5\n[ground]', "pair[0].frequency", "soft"),
    # friction along and across a direction
    ("friction = 0.5", "friction = [0.5, 0.2]", 'body "ball".friction', "friction_direction"),
    ("friction = 0.5", "friction = [0.5, 0.2, 0.1]", 'body "ball".friction', "two"),
    ("friction = 0.5", "friction = [0.5, -0.2]", 'body "ball".friction', "at least 0"),
    (
        "friction = 0.5",
        "friction = 0.5\nfriction_direction = [1, 0, 0]",
        'body "ball".friction_direction',
        "[along, across]",
    ),
    (
        "friction = 0.5",
        "friction = [0.5, 0.2]\nfriction_direction = [0, 0, 0]",
        'body "ball".friction_direction',
        "[1, 0, 0]",
    ),
    (
        SURFACES,
        SURFACES.replace("friction = 0.5", TWO).replace("friction = 0.8", TWO),
        'body "ball".friction_direction',
        "[[pair]]",
    ),
    (
        GROUND,
        f'[[pair]]\nbetween = ["ball", "ground"]\n{TWO}\nfriction_frame = "marble"\n[ground]',
        "pair[0].friction_frame",
        "one of these two",
    ),
    (GROUND, '[contact]\nfriction_frame = "ball"\n[ground]', "contact.friction_frame", "friction_direction"),
    (GROUND, "[contact]\ndamping = 1\n[ground]", "contact.damping", "no effect"),
    (GROUND, '[[pair]]\nbetween = ["ball", "ground"]\ndamping = 5\n[ground]', "pair[0].damping", "no effect"),
    (GROUND, '[[pair]]\nbetween = ["ball", "grond"]\n[ground]', "pair[0].between", '"ground"'),
    (GROUND, '[[pair]]\nbetween = ["ball"]\n[ground]', "pair[0].between", "2 or more"),
    (GROUND, '[[pair]]\nbetween = ["ball", "ball"]\n[ground]', "pair[0].between", "twice"),
    (
        GROUND,
        '[[pair]]\nbetween = ["ball", "marble"]\n[[pair]]\nbetween = ["marble", "ball"]\n[ground]',
        "pair[1].between",
        "marble",
    ),
    (
        GROUND,
        '[[pair]]\nbetween = ["ball", "marble"]\nfriction = 1\ncollide = false\n[ground]',
        "pair[0].collide",
        "friction",
    ),
    (
        "friction = 0.5",
        'collides_with = ["ground"]\n[[pair]]\nbetween = ["ball", "marble"]',
        "pair[0].between",
        "touch",
    ),
    # the start
    ("position = [2, 0, 1]", "position = [0.5, 0, 1]", 'body "ball".position', "marble by 0.1 m"),
    ("position = [2, 0, 1]", "position = [2, 0, 0]", 'body "marble".position', "ground by 0.1 m"),
    ("position = [2, 0, 1]", "position = [2, 0, 0.0985]", 'body "marble".position', "0.001"),
    (SETS, 'sets = "ball.position"\nguess = [0, 0, 0.25]', 'body "ball".position', "ground by 0.25 m"),
    (SETS, 'sets = "ball.radius"\nguess = 1.5', 'body "ball".position', "ground by 0.5 m"),
]

AIMS = [
    # variables
    (SETS, 'sets = "ball.velocty"', 'variable "throw".sets', '"ball.velocity"'),
    (SETS, 'sets = "bal.velocity"', 'variable "throw".sets', '"ball.velocity"'),
    (SETS, 'sets = "marble.friction"', 'variable "throw".sets', "value"),
    (SETS, 'sets = "ball.velocity[3]"', 'variable "throw".sets', "0 to 2"),
    (SETS, 'sets = "ball.velocity[0:4]"', 'variable "throw".sets', "3 components"),
    (SETS, 'sets = "ball.velocity[1:1]"', 'variable "throw".sets', "range"),
    (SETS, 'sets = "ball.velocity[]"', 'variable "throw".sets', "index"),
    (SETS, 'sets = "ball.velocity[x]"', 'variable "throw".sets', "quantity"),
    (SETS, "sets = []", 'variable "throw".sets', "list of texts"),
    (SETS, "sets = 3", 'variable "throw".sets', "list of texts"),
    (SETS, 'sets = ["ball.velocity", "ball.mass"]', 'variable "throw".sets', "parameter"),
    (SETS, 'sets = ["ball.velocity", "marble.velocity[0]"]', 'variable "throw".sets', "components"),
    (SETS, 'sets = ["ball.velocity[1]", "ball.velocity[1]"]', 'variable "throw".sets', "throw"),
    (SETS, 'sets = "marble.force[1]"', 'variable "push".sets', "throw"),
    (SETS, 'sets = ["ball.position", "marble.position"]', 'variable "throw".guess', "required"),
    (SETS, f"{SETS}\nknots = 3", 'variable "throw".knots', "force"),
    (SETS, f'{SETS}\ninterpolation = "linear"', 'variable "throw".interpolation', "force"),
    ("knots = 4", "knots = 0", 'variable "push".knots', "at least 1"),
    ("knots = 4", "knots = 101", 'variable "push".knots', "100"),
    ("knots = 4", 'knots = 1\ninterpolation = "linear"', 'variable "push".knots', "2 or more"),
    ("knots = 4", 'interpolation = "cubic"', 'variable "push".interpolation', "'linear'"),
    ("guess = [1, 2, 3]", "guess = [1, 2]", 'variable "throw".guess', "3 numbers"),
    ("guess = [1, 2, 3]", 'guess = "1"', 'variable "throw".guess', "number"),
    ("guess = [1, 2, 3]", "guess = [1, 2, inf]", 'variable "throw".guess', "finite"),
    ("guess = [1, 2, 3]", "guess = [[1, 2], 3]", 'variable "throw".guess', "number"),
    ("knots = 4", "knots = 4\nguess = [[1, 2]]", 'variable "push".guess', "4 lists of 2"),
    ("guess = [1, 2, 3]", "lower = nan", 'variable "throw".lower', "number"),
    ("guess = [1, 2, 3]", "lower = 1\nupper = 0", 'variable "throw".lower', "upper"),
    ("guess = [1, 2, 3]", "guess = 1\nupper = [1, 0.5, 1]", 'variable "throw".guess', "-inf to 0.5"),
    ("knots = 4", "knots = 4\nlower = 1", 'variable "push".guess', "knot 0"),
    ("guess = [1, 2, 3]", "scale = 0", 'variable "throw".scale', "positive"),
    ("guess = [1, 2, 3]", "spread = -1", 'variable "throw".spread', "negative"),
    (SETS, 'sets = "ball.mass"\nlower = 0', 'variable "throw".lower', "greater than 0"),
    (SETS, 'sets = "ball.friction"\nlower = -1', 'variable "throw".lower', "at least 0"),
    (SETS, 'sets = "ground.restitution"\nupper = 2', 'variable "throw".upper', "at most 1"),
    (SETS, 'sets = "ball.orientation"\nguess = 0', 'variable "throw".guess', "quaternion"),
    # formulas and aims
    (TARGET, 'value = "ball.position +"', 'target "lands there".value', "formula"),
    (TARGET, 'value = "ball.positon"', 'target "lands there".value', '"ball.position"'),
    (TARGET, 'value = "ball.__class__"', 'target "lands there".value', "ball.__class__"),
    (TARGET, 'value = "exec(1)"', 'target "lands there".value', "exec"),
    (TARGET, 'value = "ball.position - [1, 0]"', 'target "lands there".value', "vector of 2"),
    (TARGET, f"{TARGET}\nat = 1.5", 'target "lands there".at', "0 to 1 s"),
    (TARGET, f"{TARGET}\nat = -0.5", 'target "lands there".at', "0 to 1 s"),
    (TARGET, f"{TARGET}\nat = 0.505", 'target "lands there".at', "0.5 or 0.51"),
    (TARGET, f'{TARGET}\nat = "always"', 'target "lands there".at', "[[constraint]]"),
    (TARGET, f'{TARGET}\nat = "now"', 'target "lands there".at', '"end"'),
    ("tolerance = 0.01", "tolerance = -0.01", 'target "lands there".tolerance', "greater than 0"),
    ("tolerance = 0.01", "tolerance = 0.01\nweight = -1", 'target "lands there".weight', "at least 0"),
    ("tolerance = 0.01", "", 'target "lands there".tolerance', "required"),
    (COST, 'value = "ball.position"', 'cost "effort".value', "squares"),
    (COST, "", 'cost "effort".value', "value"),
    (COST, f'{COST}\nvalue = "1"', 'cost "effort".value', "value"),
    (COST, f"{COST}\nweight = -1", 'cost "effort".weight', "at least 0"),
    (COST, 'at = "always"\nvalue = "1 / time"', 'cost "effort".value', "finite"),
    (COST, 'at = "sometimes"\nvalue = "1"', 'cost "effort".at', '"always"'),
    ("upper = 5", "", 'constraint "stays low".lower', "equals"),
    ("upper = 5", "upper = 5\nequals = 4", 'constraint "stays low".equals', "lower"),
    ("upper = 5", "upper = 5\nlower = 6", 'constraint "stays low".lower', "upper"),
    ("upper = 5", "upper = [5, 6]", 'constraint "stays low".upper', "number"),
    ("upper = 5", "upper = [[5]]", 'constraint "stays low".upper', "number"),
    ("upper = 5", "upper = 5\npenalty = 0", 'constraint "stays low".penalty', "greater than 0"),
    (COST, f"{COST}\n{OUTPUT}ball.position'", 'output "far".value', "vector of 3"),
    (COST, f"{COST}\n{OUTPUT}ball.far'", 'output "far".value', "ball.far"),
    (COST, f"{COST}\n{OUTPUT}1'\nat = 'always'", 'output "far".at', '"end"'),
    (COST, f"{COST}\n{OUTPUT}1'\n{OUTPUT}2'", "output[1].name", '"far"'),
    (COST, f'{COST}\n[objective]\nstop = "now"', "objective.stop", "'converged'"),
    (COST, f"{COST}\n[objective]\ngoal = nan", "objective.goal", "finite"),
]

# What is added to a file with a time alone.
BASE = "[simulation]\nduration = 1.0\ndt = 0.01\n"
BODY = 'body "it"'
ROW = "[" + ", ".join(["0"] * 40) + "]"
OFF = "{ parts = [{ box = { size = [1, 1, 1] }, centre = [1, 0, 0] }, { sphere = { radius = 0.1 } }] }"
TWO = '{ parts = [{ box = { size = [1, 1, 1] } }, { capsule = { radius = 1, length = "1" } }] }'
FLAT = "{ convex = { points = [[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]] } }"
OFF_ORIGIN = "{ convex = { points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]] } }"
NO_NUMBER = "{ convex = { points = [[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, nan, 2]] } }"


def body(shape: str, keys: str = "mass = 1") -> str:
    return f'[[body]]\nname = "it"\nshape = {shape}\n{keys}\n'


def block(keys: str) -> str:
    return f'{body("{ sphere = { radius = 1 } }")}[[block]]\nname = "ramp"\n{keys}\n'


def terrain(keys: str) -> str:
    return f'{body("{ sphere = { radius = 1 } }")}[[terrain]]\nname = "hills"\n{keys}\n'


SHAPES = [
    (body("{ box = { size = [1, 0, 1] } }"), f"{BODY}.shape.box.size", "greater than 0"),
    (body("{ box = { size = [1, -1, 1] } }"), f"{BODY}.shape.box.size", "greater than 0"),
    (body("{ box = { size = [1, 1] } }"), f"{BODY}.shape.box.size", "3 numbers"),
    (body("{ box = { size = 1 } }"), f"{BODY}.shape.box.size", "3 numbers"),
    (body("{ box = { size = [1, inf, 1] } }"), f"{BODY}.shape.box.size", "finite"),
    (body("{ box = {} }"), f"{BODY}.shape.box.size", "required"),
    (body("{ box = { sise = [1, 1, 1] } }"), f"{BODY}.shape.box.sise", '"size"'),
    (body("{ box = { size = [1, 2, 1e-7] } }"), f"{BODY}.shape.box.size", "2e-06 m"),
    (body("{ capsule = { radius = 0, length = 1 } }"), f"{BODY}.shape.capsule.radius", "greater than 0"),
    (body("{ capsule = { radius = 1, length = 0 } }"), f"{BODY}.shape.capsule.length", "sphere"),
    (body("{ capsule = { radius = 1, length = -1 } }"), f"{BODY}.shape.capsule.length", "greater than 0"),
    (body("{ capsule = { radius = 1 } }"), f"{BODY}.shape.capsule.length", "required"),
    (body("{ capsule = { radius = 1, length = 1e-7 } }"), f"{BODY}.shape.capsule", "sphere"),
    (body("{ capsule = { radius = 1e-9, length = 2 } }"), f"{BODY}.shape.capsule", "1e-06 m"),
    (body("{ box = { size = [1, 1, 1] }, sphere = { radius = 1 } }"), f"{BODY}.shape", "sphere and box"),
    (body("{ cylinder = { radius = 1, length = 0 } }"), f"{BODY}.shape.cylinder.length", "greater than 0"),
    (body("{ cylinder = { radius = 1, length = 1e-7 } }"), f"{BODY}.shape.cylinder", "2e-06 m"),
    (body("{ ellipsoid = { radii = [1, 1] } }"), f"{BODY}.shape.ellipsoid.radii", "3 numbers"),
    (body("{ ellipsoid = { radii = [1, 1e-8, 1] } }"), f"{BODY}.shape.ellipsoid.radii", "1e-06 m"),
    (body("{ convex = { points = 3 } }"), f"{BODY}.shape.convex.points", "points"),
    (body("{ convex = { points = [[0, 0, 0]] } }"), f"{BODY}.shape.convex.points", "4 to 2000"),
    (body(FLAT), f"{BODY}.shape.convex.points", "plane"),
    (body(OFF_ORIGIN), f"{BODY}.shape.convex", "0.433 m"),
    (body(NO_NUMBER), f"{BODY}.shape.convex.points", "point 3"),
    (body("{ parts = [] }"), f"{BODY}.shape.parts", "1 or more"),
    (body("{ parts = [{}] }"), f"{BODY}.shape.parts[0]", "ellipsoid and convex"),
    (
        body("{ parts = [{ sphere = { radius = 1 }, box = { size = [1, 1, 1] } }] }"),
        f"{BODY}.shape.parts[0]",
        "sphere and box",
    ),
    (
        body("{ parts = [{ sphere = { radius = 1, hollow = true } }] }"),
        f"{BODY}.shape.parts[0].sphere.hollow",
        "unknown",
    ),
    (body(TWO), f"{BODY}.shape.parts[1].capsule.length", "number"),
    (
        body("{ parts = [{ box = { size = [1, 1, 1] }, orientation = [0, 0, 0, 0] }] }"),
        f"{BODY}.shape.parts[0].orientation",
        "zero",
    ),
    (body(OFF), f"{BODY}.shape.parts", "0.995"),
    (body("{ box = { size = [1e-120, 1e-120, 1e-120] } }", "density = 1"), f"{BODY}.density", "not 0"),
    (body("{ box = { size = [1e145, 1e145, 1e145] } }"), f"{BODY}.shape", "1e-140"),
    (body("{ sphere = { radius = 1e-170 } }"), f"{BODY}.shape", "1e-140"),
    # variables
    (
        body("{ box = { size = [1, 1, 1] } }")
        + '[[variable]]\nname = "v"\nsets = "it.mass"\nlower = 5e-324\nguess = 1e-320',
        'variable "v".guess',
        "1e-100 to 1e+100 kg",
    ),
    (
        body("{ box = { size = [1, 1, 1] } }") + '[[variable]]\nname = "v"\nsets = "it.size"\nlower = [0.5, 0, 0.5]',
        'variable "v".lower',
        "greater than 0",
    ),
    (
        body("{ capsule = { radius = 1, length = 1 } }") + '[[variable]]\nname = "v"\nsets = "it.length"\nlower = 0',
        'variable "v".lower',
        "greater than 0",
    ),
    (
        body("{ box = { size = [1, 1, 1] } }") + '[[variable]]\nname = "v"\nsets = "it.radius"',
        'variable "v".sets',
        "it.radius",
    ),
    (terrain('height = "x"\n[[variable]]\nname = "v"\nsets = "hills.friction"'), 'variable "v".sets', "friction"),
    # blocks
    (block("friction = 1"), 'block "ramp".shape', "required"),
    (block("shape = {}"), 'block "ramp".shape', "ellipsoid and convex"),
    (block("shape = { box = { size = [1, 1, 0] } }"), 'block "ramp".shape.box.size', "greater than 0"),
    (block("shape = { box = { size = [1, 1, 1e-9] } }"), 'block "ramp".shape.box.size', "largest"),
    (block("shape = { parts = [] }"), 'block "ramp".shape.parts', "capsule"),
    (block("shape = { sphere = { radius = 1 } }\nmass = 1"), 'block "ramp".mass', "unknown"),
    (block("shape = { sphere = { radius = 1 } }\norientation = [0, 0, 0, 0]"), 'block "ramp".orientation', "zero"),
    (
        block('shape = { sphere = { radius = 1 } }\n[[plane]]\nname = "ramp"\nnormal = [0, 0, 1]\noffset = 0'),
        'block "ramp".name',
        '"ramp"',
    ),
    # terrain
    (terrain(""), 'terrain "hills".height', "heights"),
    (terrain('height = "x"\nheights = [[0, 0], [0, 0]]\nspacing = 1'), 'terrain "hills".height', "heights"),
    (terrain("height = 1"), 'terrain "hills".height', "text"),
    (terrain('height = "x +"'), 'terrain "hills".height', "formula"),
    (terrain('height = "0.1 * z + time"'), 'terrain "hills".height', "x and y"),
    (terrain('height = "it.position[0]"'), 'terrain "hills".height', "x and y"),
    (terrain('height = "[x, y]"'), 'terrain "hills".height', "vector of 2"),
    (terrain('height = "1 / x"'), 'terrain "hills".height', "x = 0, y = 0"),
    (terrain('height = "sqrt(x)"'), 'terrain "hills".height', "slope"),
    (terrain('height = "x ** 1.5"'), 'terrain "hills".height', "curvature"),
    (terrain('height = "exec(1)"'), 'terrain "hills".height', "exec"),
    (terrain('height = "x"\nspacing = 1'), 'terrain "hills".spacing', "formula"),
    (terrain('height = "x"\norigin = [0, 0]'), 'terrain "hills".origin', "formula"),
    (terrain("heights = [[0, 0], [0, 0]]"), 'terrain "hills".spacing', "required"),
    (terrain("heights = [[0, 0], [0, 0]]\nspacing = 0"), 'terrain "hills".spacing', "greater than 0"),
    (terrain("heights = [[0, 0], [0, 0]]\nspacing = [1, -1]"), 'terrain "hills".spacing', "greater than 0"),
    (terrain("heights = [[0, 0], [0, 0]]\nspacing = [1]"), 'terrain "hills".spacing', "2 numbers"),
    (terrain("heights = [[0, 0, 0], [0, 0]]\nspacing = 1"), 'terrain "hills".heights', "row 1"),
    (terrain("heights = [[0, 0, 0]]\nspacing = 1"), 'terrain "hills".heights', "2 or more"),
    (terrain("heights = [[0], [1]]\nspacing = 1"), 'terrain "hills".heights', "2 or more"),
    (terrain("heights = []\nspacing = 1"), 'terrain "hills".heights', "rows"),
    (terrain("heights = [1, 2]\nspacing = 1"), 'terrain "hills".heights', "rows"),
    (terrain("heights = [[0, nan], [0, 0]]\nspacing = 1"), 'terrain "hills".heights', "row 0"),
    (terrain('heights = [[0, 0], [0, "a"]]\nspacing = 1'), 'terrain "hills".heights', "row 1"),
    (terrain(f"heights = [{', '.join([ROW] * 30)}]\nspacing = 1"), 'terrain "hills".heights', "1024"),
]

# Numbers whose differences or squares are not finite, in a file of all sorts.
EDGES = [
    ("x = [0, 0.5, 1]", "x = [0, 1e308, -1e308]", 'reference "r".table.x[1]'),
    ("time = [0, 0.1, 0.2]", "time = [-1e308, 0.1, 1e308]", 'reference "r".table.time[0]'),
    ("[[0, 1], [2, 3], [1, 1]]", "[[0, 1], [2, -1e308], [1e308, 1]]", 'terrain "dunes".heights[1][1]'),
    ("origin = [5, 5]", "origin = [5, 1e200]", 'terrain "dunes".origin[1]'),
    ("radius = 0.1 } }\nmass", "radius = 1e200 } }\nmass", 'body "ball".shape.sphere.radius'),
    ("knots = 5", f"knots = 5\nguess = [[1], [1e308], [{-(10**400)}], [0], [0]]", 'variable "push".guess[1][0]'),
    ("position = [0, 0, 1]", "position = [0, 1e308, 1]", 'body "ball".position[1]'),
    ("limits = [-1, 2]", "limits = [-1e308, 1e308]", 'joint "pin".limits[0]'),
    ("numbers = { c = 0.3 }", "numbers = { c = 1e300 }", 'force "wind".numbers.c'),
    ("gravity = [0, 0, -9.81]", "gravity = [0, 0, -1e308]", "world.gravity[2]"),
]


# Changes of a problem and of the robot file that it includes.
SECOND = '[[include]]\nfile = "parts/robot.toml"\n'


def robot(old: str, new: str) -> dict[str, str]:
    return {PART: changed(ROBOT, old, new)}


def main(old: str, new: str) -> dict[str, str]:
    return {WHOLE: changed(MAIN, old, new)}


INCLUDED = [
    (robot("mass = 2", "mass = -2"), PART, 'body "torso".mass', "at least 0"),
    (robot("mass = 2", "mas = 2"), PART, 'body "torso".mas', '"mass"'),
    (robot("mass = 2", ""), PART, 'body "torso".mass', "density"),
    (robot('name = "shin"', ""), PART, "body[1].name", "required"),
    (robot('["torso", "shin"]', '["torso", "shn"]'), PART, 'joint "knee".between', '"shin"'),
    (robot("knee.command", "kne.command"), PART, 'variable "bend".sets', '"knee.command"'),
    (robot('squares = "knee', 'squares = "kne'), PART, 'cost "effort".squares', "kne.command"),
    (robot("friction = 0.3", "friction = -1"), PART, "contact.friction", "at least 0"),
    (robot("friction = 0.3", "damping = 1"), PART, "contact.damping", "no effect"),
    (robot("[contact]\nfriction = 0.3", "contact = 3"), PART, "contact", "table"),
    (robot("[contact]", "[[contact]]"), PART, "contact", "table"),
    (robot("[contact]", "[contct]"), PART, "contct", '"contact"'),
    (robot("[contact]\nfriction = 0.3", "[qqq]"), PART, "qqq", "contact"),
    (robot("[contact]\nfriction = 0.3", "terrain = 3"), PART, "terrain", "[[terrain]]"),
    (robot("[contact]\nfriction = 0.3", "terrain = [3]"), PART, "terrain[0]", "table"),
    (robot('title = "Two links"', "title = 3"), PART, "title", "text"),
    (robot("[contact]", "[simulation]\ndt = 1\n[contact]"), PART, "simulation", "main.toml"),
    (robot("[contact]", "[solver.cma]\n[contact]"), PART, "solver", "main.toml"),
    (robot("[contact]", "[objective]\n[contact]"), PART, "objective", "main.toml"),
    (robot("title =", 'solvers = ["cma"]\ntitle ='), PART, "solvers", "main.toml"),
    (robot("[contact]", SECOND + "[contact]"), PART, "include", "main.toml"),
    (robot("friction = 0.3", "friction ="), PART, "", "TOML"),
    (robot(ROBOT, ""), PART, "", "empty"),
    (main("[[body]]", "[contact]\nfriction = 0.4\n[[body]]"), WHOLE, "contact.friction", "parts/robot.toml"),
    (main('"ball"', '"torso"'), WHOLE, 'body "torso".name', "parts/robot.toml"),
    (main('"ball"\nshape', '"ball"\ngroup = "shin"\nshape'), WHOLE, 'body "ball".group', "parts/robot.toml"),
    (robot('group = "robot"', 'group = "ball"'), PART, 'body "torso".group', "main.toml"),
    (
        robot("[[plane]]", '[[sensor]]\nname = "gaze"\nreads = "knee.angl"\n[[plane]]'),
        PART,
        'sensor "gaze".reads',
        '"knee.angle"',
    ),
    (main("knee.angle", "kne.angle"), WHOLE, 'target "bent".value', '"knee.angle"'),
    (main("duration = 1.0", "duration = -1"), WHOLE, "simulation.duration", "greater"),
    (main("position = [0, 2, 9]", "position = [0, 2]"), WHOLE, 'body "ball".position', "3 numbers"),
    (main("parts/robot.toml", "parts/robt.toml"), WHOLE, "include[0].file", '"parts/robt.toml"'),
    (main("parts/robot.toml", "robots/am.toml"), WHOLE, "include[0].file", '"robots/arm.toml"'),
    (main("parts/robot.toml", ""), WHOLE, "include[0].file", "at least 1"),
    (main("parts/robot.toml", "a" * 5000), WHOLE, "include[0].file", "no file"),
    (main("parts/robot.toml", "\\u0000"), WHOLE, "include[0].file", "no file"),
    (main("parts/robot.toml", "parts"), "parts", "", "folder"),
    (main("parts/robot.toml", "main.toml"), WHOLE, "include[0].file", "itself"),
    (main("parts/robot.toml", "parts/../main.toml"), WHOLE, "include[0].file", "itself"),
    (main('robot.toml"', 'robot.toml"\nyaw = 3'), WHOLE, "include[0].yaw", '"yaw_deg"'),
    (main('robot.toml"', 'robot.toml"\nprefix = "2_"'), WHOLE, "include[0].prefix", '"2_"'),
    (main(MAIN, "include = 3"), WHOLE, "include", "[[include]]"),
    (main(SECOND, SECOND * 2), WHOLE, "include[1].file", "include[0]"),
    (main(SECOND, SECOND * 101), WHOLE, "include", "100"),
    (
        {
            **robot("[[plane]]", '[[terrain]]\nname = "hills"\nheight = "x"\n[[plane]]'),
            **main('robot.toml"', 'robot.toml"\nyaw_deg = 3'),
        },
        PART,
        'terrain "hills"',
        "moved",
    ),
]


def rows() -> Iterable[Bad]:
    """Every row."""
    for old, new, where, word in (*WORLDS, *AIMS):
        yield {WHOLE: changed(TWO_BALLS, old, new)}, WHOLE, where, word
    for text, where, word in SHAPES:
        yield {WHOLE: BASE + text}, WHOLE, where, word
    for old, new, where in EDGES:
        yield {WHOLE: changed(PROBLEM, old, new)}, WHOLE, where, "too large"
    for texts, file, where, word in INCLUDED:
        yield {WHOLE: MAIN, PART: ROBOT} | texts, file, where, word


def faults(folder: Path, texts: Mapping[str, str], settings: Mapping[str, object] | None = None) -> list[Issue]:
    """The faults of the first of these files, each with its file's path from the folder on."""
    for name, text in texts.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    with pytest.raises(ProblemError) as caught:
        load_problem(folder / WHOLE, settings or {})
    assert str(caught.value).startswith(caught.value.issues[0].file or caught.value.file)
    return [
        replace(issue, file=str(Path(issue.file or caught.value.file).relative_to(folder)))
        for issue in caught.value.issues
    ]


@pytest.mark.parametrize(("texts", "file", "where", "word"), list(rows()))
def test_a_fault_names_file_table_key_and_remedy(
    tmp_path: Path, texts: dict[str, str], file: str, where: str, word: str
) -> None:
    found = faults(tmp_path, texts)
    assert [each for each in found if (each.file, each.where) == (file, where) and word in each.message], found


@pytest.mark.parametrize(
    ("key", "word"),
    [("body.tors.mass", '"torso"'), ("body", "included"), ("include.0.yaw", "yaw_deg"), ("include.1.yaw_deg", '"1"')],
)
def test_settings_that_have_no_place_are_named(tmp_path: Path, key: str, word: str) -> None:
    (fault,) = faults(tmp_path, {WHOLE: MAIN, PART: ROBOT}, {key: 1})
    assert word in str(fault)


def test_faults_are_reported_together(tmp_path: Path) -> None:
    """Of tables and keys, of formulas, and of shapes."""
    tables = changed(changed(TWO_BALLS, MASS, "mass = -1\ncolour = 3"), "tolerance = 0.01", 'tolerance = "x"')
    formulas = changed(changed(TWO_BALLS, TARGET, 'value = "1 +"'), '"ball.position[2]"', '"ball.position[3]"')
    shapes = body("{ box = { size = [1, 1, 1e-9] } }") + '[[terrain]]\nname = "hills"\nheight = "z"\n'
    shapes += '[[block]]\nname = "ramp"\nshape = {}\n[[pair]]\nbetween = ["it", "ramps"]\n'
    places = [[each.where for each in faults(tmp_path, {WHOLE: text})] for text in (tables, formulas, BASE + shapes)]
    assert places == [
        ['body "ball".mass', 'body "ball".colour', 'target "lands there".tolerance'],
        ['target "lands there".value', 'constraint "stays low".value'],
        [f"{BODY}.shape.box.size", 'block "ramp".shape', 'terrain "hills".height', "pair[0].between"],
    ]


def test_varied_restitution_needs_rigid_contacts(tmp_path: Path) -> None:
    text = changed(TWO_BALLS, "[ground]", "[contact]\nfrequency = 5\n[ground]\nrestitution = 0.0 #")
    text = changed(changed(text, "restitution = 0.5", ""), SETS, 'sets = "ground.restitution"')
    fault = faults(tmp_path, {WHOLE: text})[0]
    assert fault.where == 'variable "throw".sets' and "soft" in fault.message


def test_too_many_surfaces_are_counted(tmp_path: Path) -> None:
    spheres = f"{{ spheres = [{', '.join(['{ radius = 0.1 }'] * 500)}] }}"
    text = changed(
        changed(TWO_BALLS, "{ sphere = { radius = 0.5 } }", spheres), "{ sphere = { radius = 0.1 } }", spheres
    )
    assert "251000" in str(faults(tmp_path, {WHOLE: text})[0])


def test_two_included_files_must_not_differ(tmp_path: Path) -> None:
    texts = main("[[body]]", '[[include]]\nfile = "moon.toml"\n[[body]]')
    (fault,) = faults(tmp_path, texts | {PART: ROBOT, "moon.toml": "[contact]\nfriction = 0.4\n"})
    assert (fault.file, fault.where) == ("moon.toml", "contact.friction") and PART in fault.message


def test_files_that_are_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of them, or all together."""
    monkeypatch.setattr("symphys.problem.reading.source.MAX_BYTES", len(ROBOT) - 1)
    assert faults(tmp_path, {WHOLE: MAIN, PART: ROBOT})[0].file == PART
    monkeypatch.undo()
    monkeypatch.setattr("symphys.problem.include.MAX_BYTES", len(ROBOT) + len(MAIN) - 1)
    assert faults(tmp_path, {WHOLE: MAIN, PART: ROBOT})[0].file == WHOLE


def test_an_included_file_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_bytes(b"a = 1\n\xff")
    (fault,) = faults(tmp_path, main("parts/robot.toml", "bad.toml"))
    assert fault.file == "bad.toml" and "line 2" in fault.message


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_what_changes_within_next_to_no_time_is_named(tmp_path: Path, kind: str) -> None:
    """A slope of 1e308 and more."""
    text = changed(changed(PROBLEM, "time = [0, 0.1, 0.2]", "time = [0, 1e-308, 0.2]"), '"cubic"', f'"{kind}"')
    assert any('row 3, column "x"' in str(each) for each in faults(tmp_path, {WHOLE: text}))


@pytest.mark.parametrize("file", ["parts/none.toml", "parts", "main.toml", "parts/bad.toml"])
def test_the_command_ends_with_2(file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "bad.toml").write_text("= 3", encoding="utf-8")
    (tmp_path / WHOLE).write_text(changed(MAIN, PART, file), encoding="utf-8")
    assert command(["check", str(tmp_path / WHOLE)]) == 2
    assert file in capsys.readouterr().err
