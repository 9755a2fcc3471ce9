"""The world that a problem builds: masses, inertia, who may touch whom and under which law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

import casadi as ca
import numpy as np
import pytest

from symphys.errors import ProblemError
from symphys.model.world import Law
from symphys.problem import Problem
from symphys.problem.schema.physics import ContactTable, PairTable, SurfaceTable

Load = Callable[..., Problem]
Refused = Callable[..., ProblemError]

BASE = """
[simulation]
duration = 1.0
dt = 0.01
"""
BALL = '[[body]]\nname = "{name}"\nshape = {{ sphere = {{ radius = 0.5 }} }}\nmass = 1\nposition = [{x}, 0, 1]\n'


def laws(problem: Problem) -> dict[str, Law]:
    return {pair.name: pair.law for pair in problem.world().pairs}


def test_parameters(load: Load) -> None:
    parameters = {name: value.tolist() for name, value in load().parameters.items()}
    assert parameters == {
        "gravity": [0, 0, -9.81],
        "contact.friction": [0.5],
        "contact.restitution": [0],
        "ball.mass": [2],
        "ball.second_moments": pytest.approx([2 * 0.5**2 / 5] * 3),
        "ball.correlations": [0, 0, 0],
        "ball.centre_of_mass": [0, 0, 0],
        "ball.radius": [0.5],
        "ball.friction": [0.5],
        "marble.mass": [pytest.approx(4 / 3 * np.pi)],  # 1000 kg/m^3 * 4/3 pi 0.1^3
        "marble.second_moments": pytest.approx([4 / 3 * np.pi * 0.1**2 / 5] * 3),
        "marble.correlations": [0, 0, 0],
        "marble.centre_of_mass": [0, 0, 0],
        "marble.radius": [0.1],
        "ground.offset": [0],
        "ground.tilt": [0, 0],
        "ground.friction": [0.8],
        "ground.restitution": [0.5],
    }


def test_coefficients_are_products_of_what_is_stated(load: Load) -> None:
    found = laws(load(("[ground]", "[contact]\nfriction = 0.9\nrolling = 0.01\n[ground]")))
    assert found["ball-ground"] == Law(friction=0.5 * 0.8, restitution=0.5, rolling=0.01)
    assert found["marble-ground"] == Law(friction=0.8, restitution=0.5, rolling=0.01)
    assert found["ball-marble"] == Law(friction=0.5, rolling=0.01)


def test_lengths_are_sums_of_what_is_stated(load: Load) -> None:
    changes = ("friction = 0.5", "rolling = 0.01\ntorsion = 0.02"), ("friction = 0.8", "rolling = 0.03")
    law = laws(load(*changes))["ball-ground"]
    assert (law.rolling, law.torsion) == (pytest.approx(0.04), 0.02)


def test_a_pair_table_overrides(load: Load) -> None:
    text = '[[pair]]\nbetween = ["ground", "ball"]\nfriction = 0.1\n[ground]'
    problem = load(("[ground]", text))
    assert laws(problem)["ball-ground"] == Law(friction=0.1, restitution=0.5)
    assert problem.parameters["ground-ball.friction"] == 0.1


def test_tables_have_the_coefficients_that_a_law_declares() -> None:
    """With its defaults; those of surfaces are those that combine. What a world sets is no coefficient."""
    law = {each.name: each for each in fields(Law) if each.metadata}
    given = ContactTable().model_dump(exclude_none=True)
    assert set(ContactTable.model_fields) == set(law)
    assert given == {name: law[name].default for name in given}
    assert set(SurfaceTable.model_fields) == {name for name, each in law.items() if "combine" in each.metadata}
    assert set(PairTable.model_fields) == {*law, "between", "collide"}


@pytest.mark.parametrize("name", [each.name for each in fields(Law) if "physical" in each.metadata])
def test_each_coefficient_of_a_pair_reaches_its_law(load: Load, name: str) -> None:
    """And is a parameter."""
    stated = {"restitution": 0.0, "frequency": 0.0 if name == "restitution" else 5.0} | {name: 0.25}
    text = "\n".join(f"{key} = {value}" for key, value in stated.items())
    problem = load(("[ground]", f'[[pair]]\nbetween = ["ball", "ground"]\n{text}\n[ground]'))
    assert getattr(laws(problem)["ball-ground"], name) == stated[name]
    assert problem.parameters[f"ball-ground.{name}"] == 0.25


def test_soft_pairs(load: Load) -> None:
    text = '[[pair]]\nbetween = ["ball", "ground"]\nfrequency = 5\ndamping = 0.7\nrestitution = 0\n[ground]'
    law = laws(load(("[ground]", text)))["ball-ground"]
    assert (law.frequency, law.damping, law.restitution, law.soft) == (5, 0.7, 0, True)


def test_who_collides(load: Load) -> None:
    everything = {"ball-ground", "marble-ground", "ball-marble"}
    assert set(laws(load())) == everything
    apart = load(("friction = 0.5", 'collides_with = ["ground"]'))
    assert set(laws(apart)) == everything - {"ball-marble"}
    nothing = load(("friction = 0.5", "collides_with = []"))
    assert set(laws(nothing)) == {"marble-ground"}
    excluded = load(("[ground]", '[[pair]]\nbetween = ["marble", "ball"]\ncollide = false\n[ground]'))
    assert set(laws(excluded)) == everything - {"ball-marble"}


def test_solid_and_hollow_spheres(load: Load) -> None:
    assert load().world().bodies[0].inertia == pytest.approx(2 / 5 * 2 * 0.25)
    hollow = load(("radius = 0.5", "radius = 0.5, hollow = true"))
    assert hollow.world().bodies[0].inertia == pytest.approx(2 / 3 * 2 * 0.25)


@pytest.mark.parametrize(
    ("inertia", "expected"),
    [
        ("0.5", 0.5),
        ("[1, 2, 2.5]", (1, 2, 2.5)),
        ("[[1,0,0],[0,1,0.1],[0,0.1,1]]", ((1, 0, 0), (0, 1, 0.1), (0, 0.1, 1))),
    ],
)
def test_given_inertia(load: Load, inertia: str, expected: object) -> None:
    assert load(("mass = 2.0", f"mass = 2.0\ninertia = {inertia}")).world().bodies[0].inertia == expected


def compound(*centres: tuple[float, float, float], keys: str = "mass = 3") -> str:
    spheres = ", ".join(f"{{ radius = 0.1, centre = {list(centre)} }}" for centre in centres)
    return f'{BASE}[[body]]\nname = "thing"\nshape = {{ spheres = [{spheres}] }}\n{keys}\n'


def test_compound_of_spheres(load: Load) -> None:
    body = load(text=compound((0.2, 0, 0), (-0.2, 0, 0))).world().bodies[0]
    own, steiner = 3 * 2 / 5 * 0.1**2, 3 * 0.2**2  # both spheres of 1.5 kg, 0.2 m from the axis
    np.testing.assert_allclose(body.inertia, (own, own + steiner, own + steiner))
    assert [shape.centre for shape in body.shapes] == [(0.2, 0, 0), (-0.2, 0, 0)]


def test_compound_off_its_axes_has_a_full_tensor(load: Load) -> None:
    problem = load(text=compound((0.1, 0.1, 0), (-0.1, -0.1, 0)))
    tensor = np.array(problem.world().bodies[0].inertia)
    own = 2 / 5 * 0.1**2
    expected = 3 * np.array([[own + 0.01, -0.01, 0], [-0.01, own + 0.01, 0], [0, 0, own + 0.02]])
    np.testing.assert_allclose(tensor, expected)


def test_compound_by_density(load: Load) -> None:
    problem = load(text=compound((0.2, 0, 0), (-0.2, 0, 0), keys="density = 100"))
    assert problem.parameters["thing.mass"] == pytest.approx(2 * 100 * 4 / 3 * np.pi * 1e-3)
    assert "thing.radius" not in problem.parameters


def test_compound_with_its_mass_off_centre(refused: Refused) -> None:
    message = str(refused(text=compound((0.2, 0, 0), (0.0, 0, 0))))
    assert 'body "thing".shape.spheres: the centre of mass of these spheres is 0.1 m from' in message
    assert "at [0.1, 0, 0]" in message


def test_compound_off_centre_with_given_inertia(load: Load) -> None:
    body = load(text=compound((0.2, 0, 0), (0.0, 0, 0), keys="mass = 1\ninertia = 2")).world().bodies[0]
    assert body.inertia == 2


def test_planes(load: Load) -> None:
    text = '[[plane]]\nname = "ramp"\nnormal = [0, 3, 4]\npoint = [0, 0, -5]\n[[plane]]\nname = "wall"\n'
    world = load(("[ground]", f"{text}normal = [-1, 0, 0]\noffset = -7\n[ground]\nheight = 0.25")).world()
    assert [plane.name for plane in world.statics] == ["ground", "ramp", "wall"]
    assert world.statics[0].offset == 0.25
    assert world.statics[1].normal == pytest.approx((0, 0.6, 0.8))
    assert [plane.offset for plane in world.statics[1:]] == [pytest.approx(-4), -7]


def test_no_ground_without_its_table(load: Load) -> None:
    problem = load(text=BASE + BALL.format(name="ball", x=0))
    assert (problem.world().statics, problem.world().pairs) == ((), ())


def test_gravity(load: Load) -> None:
    assert load(("[ground]", "[world]\ngravity = [1, 2, 3]\n[ground]")).world().gravity == (1, 2, 3)


def test_symbols_replace_parameters(load: Load) -> None:
    problem = load()
    mass, radius, mu, g = ca.SX.sym("m"), ca.SX.sym("r"), ca.SX.sym("mu"), ca.SX.sym("g", 3)
    world = problem.world({"ball.mass": mass, "ball.radius": radius, "ground.friction": mu, "gravity": g})
    ball = world.bodies[0]
    friction = next(pair.law.friction for pair in world.pairs if pair.name == "ball-ground")
    function = ca.Function("f", [mass, radius, mu, g], [ball.mass, ball.inertia, friction, world.gravity[2]])
    assert [float(value) for value in function(3, 2, 0.4, [0, 0, 7])] == pytest.approx([3, 2 / 5 * 3 * 4, 0.2, 7])
    assert ball.shapes[0].radius is radius


def test_mass_by_density_follows_the_radius(load: Load) -> None:
    marble = load().world({"marble.radius": 0.2}).bodies[1]
    assert marble.mass == pytest.approx(1000 * 4 / 3 * np.pi * 0.2**3)
    assert load().world({"marble.radius": 0.2, "marble.mass": 1.0}).bodies[1].mass == 1.0


def test_inertia_of_a_compound_follows_the_mass(load: Load) -> None:
    problem = load(text=compound((0.2, 0, 0), (-0.2, 0, 0)))
    doubled = np.array(problem.world({"thing.mass": 6.0}).bodies[0].inertia)
    np.testing.assert_allclose(doubled, 2 * np.array(problem.world().bodies[0].inertia))


def test_an_override_must_be_a_parameter(load: Load) -> None:
    with pytest.raises(KeyError, match=r"bal\.mass"):
        load().world({"bal.mass": 1.0})
