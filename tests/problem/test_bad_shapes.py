"""What can be wrong with shapes, blocks and terrain: where it is, and what would be valid."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from symphys.errors import ProblemError

Refused = Callable[..., ProblemError]
Names = Callable[[ProblemError, str, str], None]
BASE = "[simulation]\nduration = 1.0\ndt = 0.01\n"
BODY = 'body "it"'


def body(shape: str, keys: str = "mass = 1") -> str:
    return f'[[body]]\nname = "it"\nshape = {shape}\n{keys}\n'


def block(keys: str) -> str:
    return f'{body("{ sphere = { radius = 1 } }")}[[block]]\nname = "ramp"\n{keys}\n'


def terrain(keys: str) -> str:
    return f'{body("{ sphere = { radius = 1 } }")}[[terrain]]\nname = "hills"\n{keys}\n'


ROW = "[" + ", ".join(["0"] * 40) + "]"
OFF = "{ parts = [{ box = { size = [1, 1, 1] }, centre = [1, 0, 0] }, { sphere = { radius = 0.1 } }] }"
TWO = '{ parts = [{ box = { size = [1, 1, 1] } }, { capsule = { radius = 1, length = "1" } }] }'
ONE_OF = "give one of sphere, box, capsule, cylinder, ellipsoid and convex"
FLAT = "{ convex = { points = [[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]] } }"
OFF_ORIGIN = "{ convex = { points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]] } }"
NO_NUMBER = "{ convex = { points = [[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, nan, 2]] } }"

CASES = [
    (body("{ box = { size = [1, 0, 1] } }"), f"{BODY}.shape.box.size", "greater than 0; one is 0"),
    (body("{ box = { size = [1, -1, 1] } }"), f"{BODY}.shape.box.size", "greater than 0; one is -1"),
    (body("{ box = { size = [1, 1] } }"), f"{BODY}.shape.box.size", "a list of 3 numbers, not a list of 2"),
    (body("{ box = { size = 1 } }"), f"{BODY}.shape.box.size", "a list of 3 numbers, not 1"),
    (body("{ box = { size = [1, inf, 1] } }"), f"{BODY}.shape.box.size", "finite numbers; one is inf"),
    (body("{ box = {} }"), f"{BODY}.shape.box.size", "required"),
    (body("{ box = { sise = [1, 1, 1] } }"), f"{BODY}.shape.box.sise", 'did you mean "size"'),
    (
        body("{ box = { size = [1, 2, 1e-7] } }"),
        f"{BODY}.shape.box.size",
        "1e-07 m, .* make it 2e-06 m or more, or use",
    ),
    (body("{ capsule = { radius = 0, length = 1 } }"), f"{BODY}.shape.capsule.radius", "greater than 0"),
    (body("{ capsule = { radius = 1, length = 0 } }"), f"{BODY}.shape.capsule.length", "without length is a sphere"),
    (body("{ capsule = { radius = 1, length = -1 } }"), f"{BODY}.shape.capsule.length", "greater than 0, not -1"),
    (body("{ capsule = { radius = 1 } }"), f"{BODY}.shape.capsule.length", "required"),
    (body("{ capsule = { radius = 1, length = 1e-7 } }"), f"{BODY}.shape.capsule", "use a sphere"),
    (body("{ capsule = { radius = 1e-9, length = 2 } }"), f"{BODY}.shape.capsule", "make the radius 1e-06 m or more"),
    (
        body("{ box = { size = [1, 1, 1] }, sphere = { radius = 1 } }"),
        f"{BODY}.shape",
        "has sphere and box; give only one",
    ),
    (body("{ cylinder = { radius = 1, length = 0 } }"), f"{BODY}.shape.cylinder.length", "greater than 0"),
    (body("{ cylinder = { radius = 1, length = 1e-7 } }"), f"{BODY}.shape.cylinder", "make the length 2e-06 m or more"),
    (body("{ ellipsoid = { radii = [1, 1] } }"), f"{BODY}.shape.ellipsoid.radii", "a list of 3 numbers"),
    (body("{ ellipsoid = { radii = [1, 1e-8, 1] } }"), f"{BODY}.shape.ellipsoid.radii", "make it 1e-06 m or more"),
    (body("{ convex = { points = 3 } }"), f"{BODY}.shape.convex.points", "a list of points"),
    (body("{ convex = { points = [[0, 0, 0]] } }"), f"{BODY}.shape.convex.points", "has 1 points; give 4 to 2000"),
    (body(FLAT), f"{BODY}.shape.convex.points", "in a plane"),
    (body(OFF_ORIGIN), f"{BODY}.shape.convex", "these points is 0.433 m .* every point, or give inertia"),
    (body(NO_NUMBER), f"{BODY}.shape.convex.points", "point 3 must be three finite numbers"),
    (body("{ parts = [] }"), f"{BODY}.shape.parts", "1 or more"),
    (body("{ parts = [{}] }"), f"{BODY}.shape.parts[0]", ONE_OF),
    (
        body("{ parts = [{ sphere = { radius = 1 }, box = { size = [1, 1, 1] } }] }"),
        f"{BODY}.shape.parts[0]",
        "has sphere and box; give only one",
    ),
    (
        body("{ parts = [{ sphere = { radius = 1, hollow = true } }] }"),
        f"{BODY}.shape.parts[0].sphere.hollow",
        "unknown key",
    ),
    (body(TWO), f"{BODY}.shape.parts[1].capsule.length", 'not the text "1"'),
    (
        body("{ parts = [{ box = { size = [1, 1, 1] }, orientation = [0, 0, 0, 0] }] }"),
        f"{BODY}.shape.parts[0].orientation",
        "must not be zero",
    ),
    (body(OFF), f"{BODY}.shape.parts", r"is 0.995.* m from the body's origin, at \[0.995.*, 0, 0\]; subtract"),
    (
        body("{ box = { size = [1e-120, 1e-120, 1e-120] } }", "density = 1"),
        f"{BODY}.density",
        "the mass .* kg, not 0$",
    ),
    (
        body("{ box = { size = [1e145, 1e145, 1e145] } }"),
        f"{BODY}.shape",
        "the inertia that follows .* from 1e-140",
    ),
    (
        body("{ sphere = { radius = 1e-170 } }"),
        f"{BODY}.shape",
        "the inertia that follows .* from 1e-140",
    ),
    # variables
    (
        body("{ box = { size = [1, 1, 1] } }")
        + '[[variable]]\nname = "v"\nsets = "it.mass"\nlower = 5e-324\nguess = 1e-320',
        'variable "v".guess',
        r"a mass must be from 1e-100 to 1e\+100 kg, not 9.99.*e-321",
    ),
    (
        body("{ box = { size = [1, 1, 1] } }") + '[[variable]]\nname = "v"\nsets = "it.size"\nlower = [0.5, 0, 0.5]',
        'variable "v".lower',
        "it.size must be greater than 0",
    ),
    (
        body("{ capsule = { radius = 1, length = 1 } }") + '[[variable]]\nname = "v"\nsets = "it.length"\nlower = 0',
        'variable "v".lower',
        "it.length must be greater than 0",
    ),
    (
        body("{ box = { size = [1, 1, 1] } }") + '[[variable]]\nname = "v"\nsets = "it.radius"',
        'variable "v".sets',
        "no quantity",
    ),
    (
        terrain('height = "x"\n[[variable]]\nname = "v"\nsets = "hills.friction"'),
        'variable "v".sets',
        "what states no friction has none to vary",
    ),
    # blocks
    (block("friction = 1"), 'block "ramp".shape', "required"),
    (block("shape = {}"), 'block "ramp".shape', ONE_OF),
    (block("shape = { box = { size = [1, 1, 0] } }"), 'block "ramp".shape.box.size', "greater than 0"),
    (block("shape = { box = { size = [1, 1, 1e-9] } }"), 'block "ramp".shape.box.size', "of the largest"),
    (block("shape = { parts = [] }"), 'block "ramp".shape.parts', "valid: sphere, box, capsule"),
    (block("shape = { sphere = { radius = 1 } }\nmass = 1"), 'block "ramp".mass', "unknown key"),
    (
        block("shape = { sphere = { radius = 1 } }\norientation = [0, 0, 0, 0]"),
        'block "ramp".orientation',
        "must not be zero",
    ),
    (
        block('shape = { sphere = { radius = 1 } }\n[[plane]]\nname = "ramp"\nnormal = [0, 0, 1]\noffset = 0'),
        'block "ramp".name',
        '"ramp" is already the name of another',
    ),
    # terrain
    (terrain(""), 'terrain "hills".height', "give either height .* or heights"),
    (
        terrain('height = "x"\nheights = [[0, 0], [0, 0]]\nspacing = 1'),
        'terrain "hills".height',
        "give either height .* or heights",
    ),
    (terrain("height = 1"), 'terrain "hills".height', "must be text"),
    (terrain('height = "x +"'), 'terrain "hills".height', "cannot read the formula"),
    (terrain('height = "0.1 * z + time"'), 'terrain "hills".height', '"time", "z": a height is a formula of x and y'),
    (terrain('height = "it.position[0]"'), 'terrain "hills".height', '"it.position": a height is a formula of x'),
    (terrain('height = "[x, y]"'), 'terrain "hills".height', "must be a number, but is a vector of 2"),
    (terrain('height = "1 / x"'), 'terrain "hills".height', "height is not finite at x = 0, y = 0, where a body"),
    (terrain('height = "sqrt(x)"'), 'terrain "hills".height', "slope is not finite"),
    (terrain('height = "x ** 1.5"'), 'terrain "hills".height', "curvature is not finite"),
    (terrain('height = "exec(1)"'), 'terrain "hills".height', "unknown function"),
    (terrain('height = "x"\nspacing = 1'), 'terrain "hills".spacing', "a formula needs none"),
    (terrain('height = "x"\norigin = [0, 0]'), 'terrain "hills".origin', "a formula needs none"),
    (terrain("heights = [[0, 0], [0, 0]]"), 'terrain "hills".spacing', "required with heights"),
    (terrain("heights = [[0, 0], [0, 0]]\nspacing = 0"), 'terrain "hills".spacing', "greater than 0, or two"),
    (terrain("heights = [[0, 0], [0, 0]]\nspacing = [1, -1]"), 'terrain "hills".spacing', "greater than 0; one is -1"),
    (terrain("heights = [[0, 0], [0, 0]]\nspacing = [1]"), 'terrain "hills".spacing', "list of 2 numbers"),
    (
        terrain("heights = [[0, 0, 0], [0, 0]]\nspacing = 1"),
        'terrain "hills".heights',
        "row 1 has 2 heights, row 0 has 3",
    ),
    (
        terrain("heights = [[0, 0, 0]]\nspacing = 1"),
        'terrain "hills".heights',
        "1 rows of 3; 2 or more rows and columns",
    ),
    (terrain("heights = [[0], [1]]\nspacing = 1"), 'terrain "hills".heights', "2 rows of 1; 2 or more"),
    (terrain("heights = []\nspacing = 1"), 'terrain "hills".heights', "list of rows along y"),
    (terrain("heights = [1, 2]\nspacing = 1"), 'terrain "hills".heights', "list of rows along y"),
    (
        terrain("heights = [[0, nan], [0, 0]]\nspacing = 1"),
        'terrain "hills".heights',
        "finite numbers; one in row 0 is nan",
    ),
    (terrain('heights = [[0, 0], [0, "a"]]\nspacing = 1'), 'terrain "hills".heights', 'one in row 1 is the text "a"'),
    (
        terrain(f"heights = [{', '.join([ROW] * 30)}]\nspacing = 1"),
        'terrain "hills".heights',
        r"has 1200 heights \(30 x 40\), at most 1024 are allowed; take a coarser grid, or give height as a formula",
    ),
]


@pytest.mark.parametrize(("text", "where", "message"), CASES)
def test_refused(refused: Refused, names: Names, text: str, where: str, message: str) -> None:
    names(refused(text=BASE + text), where, message)


def test_everything_is_reported_together(refused: Refused) -> None:
    text = body("{ box = { size = [1, 1, 1e-9] } }") + '[[terrain]]\nname = "hills"\nheight = "z"\n'
    text += '[[block]]\nname = "ramp"\nshape = {}\n[[pair]]\nbetween = ["it", "ramps"]\n'
    wheres = [issue.where for issue in refused(text=BASE + text).issues]
    assert wheres == [f"{BODY}.shape.box.size", 'block "ramp".shape', 'terrain "hills".height', "pair[0].between"]
