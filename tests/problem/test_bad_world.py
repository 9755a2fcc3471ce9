"""What can be wrong with names, time, bodies and surfaces: where it is, and what would be valid."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from symphys.errors import ProblemError

Refused = Callable[..., ProblemError]
Names = Callable[[ProblemError, str, str], None]
MASS = "mass = 2.0"
SETS = 'sets = "ball.velocity"\nguess = [1, 2, 3]'
GROUND = "[ground]"
COST = 'at = "always"\nsquares = "marble.force"'

CASES = [
    # keys and kinds
    (MASS, "mas = 2.0", 'body "ball".mas', 'unknown key; did you mean "mass"'),
    ("[ground]", "[grund]", "grund", 'unknown key; did you mean "ground"'),
    ("radius = 0.5", "radius = 0.5, colour = 3", 'body "ball".shape.sphere.colour', "valid: radius, hollow"),
    ("duration = 1.0", "", "simulation.duration", "required"),
    ("[simulation]\nduration = 1.0\ndt = 0.01", "", "simulation", "required"),
    (MASS, 'mass = "2"', 'body "ball".mass', 'must be a number, not the text "2"'),
    (MASS, "mass = true", 'body "ball".mass', "must be a number, not true"),
    (MASS, "mass = nan", 'body "ball".mass', "finite"),
    (MASS, "mass = inf", 'body "ball".mass', "finite number, not inf"),
    (MASS, "mass = 1" + "0" * 400, 'body "ball".mass', "number"),
    (MASS, "mass = 2020-01-01", 'body "ball".mass', "must be a number, not a date"),
    (MASS, "mass = [1]", 'body "ball".mass', "must be a number, not a list of 1"),
    (MASS, "mass = { kg = 1 }", 'body "ball".mass', "must be a number, not a table"),
    ("dt = 0.01", "dt = 0.01\nsweeps = 2.5", "simulation.sweeps", "whole number, not 2.5"),
    ("dt = 0.01", "dt = 0.01\nsweeps = 0", "simulation.sweeps", "at least 1, not 0"),
    ("dt = 0.01", "dt = 0.01\nwarm_start = 1", "simulation.warm_start", "true or false, not 1"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = -1", "simulation.smoothing", "at least 0, not -1"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [0.1, -1]", "simulation.smoothing", "at least 0, not -1"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = []", "simulation.smoothing", r"at least one, as in \[0.1, 0.01, 0\]"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [0.01, 0.1]", "simulation.smoothing", "decrease.* 0.1 comes after 0.01"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [0.1, 0, 0]", "simulation.smoothing", "decrease.*: 0 comes after 0"),
    ("dt = 0.01", 'dt = 0.01\nsmoothing = "0.1"', "simulation.smoothing", 'list of stages .*not the text "0.1"'),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [0.1, true]", "simulation.smoothing", "a number, .*not true"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [inf, 0]", "simulation.smoothing", "a number, .*not inf"),
    ("dt = 0.01", "dt = 0.01\nsmoothing = [[0.1], 0]", "simulation.smoothing", "a number, .*not a list of 1"),
    ("title = ", "title = 5 # ", "title", "name: one line"),
    ("title = ", "plane = 3\ntitle = ", "plane", "must be a list, not 3"),
    ("[solver.gradient]\niterations = 10", "[solver]\ngradient = 3", "solver.gradient", "must be a table, not 3"),
    ("position = [0, 0, 1]", "position = [0, 1]", 'body "ball".position', "3 numbers, not a list of 2"),
    ("position = [0, 0, 1]", 'position = [0, 1, "2"]', 'body "ball".position', 'one is the text "2"'),
    ("position = [0, 0, 1]", "position = [0, 1, nan]", 'body "ball".position', "3 finite numbers; one is nan"),
    ("position = [0, 0, 1]", "position = 5", 'body "ball".position', "3 numbers, not 5"),
    # names
    ('name = "ball"', "", "body[0].name", "required"),
    ('name = "ball"', 'name = "my ball"', 'body "my ball".name', '"my ball" is no name.*for instance "my_ball"'),
    ('name = "ball"', 'name = ""', "body[0].name", "is no name"),
    ('name = "ball"', 'name = "sin"', 'body "sin".name', "already has a meaning"),
    ('name = "ball"', 'name = "time"', 'body "time".name', "already has a meaning"),
    ('name = "ball"', 'name = "ground"', 'body "ground".name', "already has a meaning"),
    ('name = "ball"', 'name = "lambda"', 'body "lambda".name', "already has a meaning"),
    ('name = "marble"', 'name = "ball"', "body[1].name", '"ball" is already the name of another body'),
    ('name = "throw"', 'name = "ball"', 'variable "ball".name', "already the name of another"),
    (COST, f'{COST}\n[[cost]]\nname = "effort"\nvalue = "1"', "cost[1].name", "already the name of another cost"),
    ('name = "effort"', 'name = "two\\nlines"', 'cost "two lines".name', "one line of text"),
    # simulation
    ("dt = 0.01", "dt = 0", "simulation.dt", "greater than 0"),
    ("dt = 0.01", "dt = 2", "simulation.dt", "longer than the duration"),
    ("dt = 0.01", "dt = 0.03", "simulation.dt", "33.33333333 is no whole number .* dt = 0.0303030303 .33 steps."),
    ("duration = 1.0", "duration = 1e7", "simulation.dt", r"1e\+09 steps are too many, .* dt = 10 or more"),
    ("duration = 1.0\ndt = 0.01", "duration = 1e150\ndt = 1e-200", "simulation.dt", "inf steps are too many"),
    # bodies
    (MASS, "mass = -1", 'body "ball".mass', "at least 0, not -1"),
    (MASS, "mass = 0", 'body "ball".mass', "greater than 0, not 0"),
    (MASS, "mass = 5e-324", 'body "ball".mass', r"must be from 1e-100 to 1e\+100 kg, not 4.94066e-324"),
    (MASS, "mass = 1e-310", 'body "ball".mass', r"must be from 1e-100 to 1e\+100 kg, not 1e-310"),
    (MASS, "mass = 1e308", 'body "ball".mass', r"must be from 1e-100 to 1e\+100 kg, not 1e\+308"),
    (MASS, "mass = 2.0\ninertia = 1e-320", 'body "ball".inertia', r"from 1e-140 to 1e\+140 kg m\^2, not 9.99.*e-321"),
    (MASS, "mass = 2.0\ninertia = [1, 1, 1e200]", 'body "ball".inertia', "exceed the sum of the other two"),
    (MASS, "mass = 2.0\ninertia = 1e200", 'body "ball".inertia', r"from 1e-140 to 1e\+140 kg m\^2, not 1e\+200"),
    (
        "{ radius = 0.5 }",
        "{ radius = 1e-160 }",
        'body "ball".shape',
        "the inertia that follows .* from 1e-140",
    ),
    (MASS, "", 'body "ball".mass', "give either mass .* or density"),
    (MASS, "mass = 2.0\ndensity = 1", 'body "ball".mass', "give either mass .* or density"),
    ("{ radius = 0.1 }", "{ radius = 1e-120 }", 'body "marble".density', r"the mass .* from 1e-100 to 1e\+100 kg"),
    ("{ radius = 0.1 }", "{ radius = 0.1, hollow = true }", 'body "marble".density', "hollow sphere .* give mass"),
    ("radius = 0.5", "radius = -0.5", 'body "ball".shape.sphere.radius', "greater than 0"),
    (
        "{ sphere = { radius = 0.5 } }",
        "{}",
        'body "ball".shape',
        "give one of sphere, box, .* and parts: ",
    ),
    ("{ sphere = { radius = 0.5 } }", "{ spheres = [] }", 'body "ball".shape.spheres', "1 or more entries"),
    ("{ sphere = { radius = 0.5 } }", '"ball"', 'body "ball".shape', "must be a table"),
    ("{ sphere = { radius = 0.5 } }", "{ cube = [1, 1, 1] }", 'body "ball".shape.cube', "valid: sphere, box"),
    ("shape = { sphere = { radius = 0.5 } }", "", 'body "ball".inertia', "required for a body without a shape"),
    ("shape = { sphere = { radius = 0.1 } }", "inertia = 1", 'body "marble".density', "no volume"),
    (MASS, "mass = 2.0\ninertia = -1", 'body "ball".inertia', "must be positive; they are -1"),
    (MASS, "mass = 2.0\ninertia = [1, 1, 3]", 'body "ball".inertia', "exceed the sum of the other two; .* 1, 1, 3"),
    (MASS, "mass = 2.0\ninertia = [1, 2]", 'body "ball".inertia', "three principal moments"),
    (MASS, "mass = 2.0\ninertia = [1, 2, true]", 'body "ball".inertia', "three principal moments"),
    (MASS, "mass = 2.0\ninertia = [[1,0,0],[0,1,0],[0.1,0,1]]", 'body "ball".inertia', "symmetric"),
    (MASS, "mass = 2.0\ninertia = [[1,2,0],[2,1,0],[0,0,1]]", 'body "ball".inertia', "positive; they are -1, 1, 3"),
    (MASS, "mass = 2.0\norientation = [0, 0, 0, 0]", 'body "ball".orientation', "must not be zero"),
    (MASS, "mass = 2.0\norientation = [1, 0, 0]", 'body "ball".orientation', "list of 4 numbers"),
    (MASS, "mass = 2.0\norientation = { role_deg = 3 }", 'body "ball".orientation.role_deg', '"roll_deg"'),
    (MASS, 'mass = 2.0\ncollides_with = ["grund"]', 'body "ball".collides_with', 'did you mean "ground"'),
    (MASS, 'mass = 2.0\ncollides_with = ["ball"]', 'body "ball".collides_with', "no other body"),
    # surfaces
    ("friction = 0.5", "friction = -0.5", 'body "ball".friction', "at least 0"),
    ("restitution = 0.5", "restitution = 1.5", "ground.restitution", "at most 1, not 1.5"),
    ("restitution = 0.5", "restitution = -0.1", "ground.restitution", "at least 0"),
    (
        GROUND,
        '[[plane]]\nname = "wall"\nnormal = [0, 0, 0]\noffset = 1\n[ground]',
        'plane "wall".normal',
        "not be zero",
    ),
    (GROUND, '[[plane]]\nname = "wall"\nnormal = [1, 0, 0]\n[ground]', 'plane "wall".offset', "either a point"),
    (GROUND, '[[plane]]\nname = "wall"\noffset = 0\n[ground]', 'plane "wall".normal', "required"),
    (GROUND, "[contact]\nfrequency = 5\n[ground]", "contact.frequency", "ball and ground: .* either soft .* 5 Hz"),
    (GROUND, "[contact]\nfrequency = 5\nrestitution = 0.5\n[ground]", "contact.frequency", "either soft"),
    (GROUND, '[[pair]]\nbetween = ["ball", "ground"]\nfrequency = 5\n[ground]', "pair[0].frequency", "either soft"),
    (GROUND, "[contact]\ndamping = 1\n[ground]", "contact.damping", "no effect"),
    (GROUND, '[[pair]]\nbetween = ["ball", "ground"]\ndamping = 5\n[ground]', "pair[0].damping", "no effect"),
    (GROUND, '[[pair]]\nbetween = ["ball", "grond"]\n[ground]', "pair[0].between", 'did you mean "ground"'),
    (GROUND, '[[pair]]\nbetween = ["ball"]\n[ground]', "pair[0].between", "2 or more entries, has 1"),
    (GROUND, '[[pair]]\nbetween = ["ball", "ball"]\n[ground]', "pair[0].between", "same surface twice"),
    (
        GROUND,
        '[[pair]]\nbetween = ["ball", "marble"]\n[[pair]]\nbetween = ["marble", "ball"]\n[ground]',
        "pair[1].between",
        "already have a",
    ),
    (
        GROUND,
        '[[pair]]\nbetween = ["ball", "marble"]\nfriction = 1\ncollide = false\n[ground]',
        "pair[0].collide",
        "friction would have no effect",
    ),
    (
        "friction = 0.5",
        'collides_with = ["ground"]\n[[pair]]\nbetween = ["ball", "marble"]',
        "pair[0].between",
        "never touch",
    ),
    # the start
    ("position = [2, 0, 1]", "position = [0.5, 0, 1]", 'body "ball".position', "overlaps marble by 0.1 m"),
    ("position = [2, 0, 1]", "position = [2, 0, 0]", 'body "marble".position', "sinks into ground by 0.1 m"),
    ("position = [2, 0, 1]", "position = [2, 0, 0.0985]", 'body "marble".position', "by 0.0015 m .* at most 0.001"),
    (SETS, 'sets = "ball.position"\nguess = [0, 0, 0.25]', 'body "ball".position', "sinks into ground by 0.25 m"),
    (SETS, 'sets = "ball.radius"\nguess = 1.5', 'body "ball".position', "sinks into ground by 0.5 m"),
]


@pytest.mark.parametrize(("old", "new", "where", "message"), CASES)
def test_refused(refused: Refused, names: Names, old: str, new: str, where: str, message: str) -> None:
    names(refused((old, new)), where, message)


def test_several_faults_are_reported_together(refused: Refused) -> None:
    error = refused((MASS, "mass = -1\ncolour = 3"), ("tolerance = 0.01", 'tolerance = "x"'))
    assert [issue.where for issue in error.issues] == [
        'body "ball".mass',
        'body "ball".colour',
        'target "lands there".tolerance',
    ]


def test_too_many_surfaces(refused: Refused) -> None:
    spheres = ", ".join("{ radius = 0.1 }" for _ in range(500))
    error = refused(
        ("{ sphere = { radius = 0.5 } }", f"{{ spheres = [{spheres}] }}"),
        ("{ sphere = { radius = 0.1 } }", f"{{ spheres = [{spheres}] }}"),
    )
    assert "251000 points of contact in every step are too many, 2000 are allowed (2 compounds against" in str(error)
