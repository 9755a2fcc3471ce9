"""Who may touch whom, and with what friction: as MuJoCo finds contacts when everything is in one place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from data.imported import by_name, model_of, problem_of, read, texts
from tools.repeats import thorough

from symphys.problem import Problem

mujoco = pytest.importorskip("mujoco")
COUNT = 7


def scene(seed: int, spread: float) -> str:
    """Spheres with random filters and coefficients, two of them a pair of parent and child, on a floor."""
    rng = np.random.default_rng(seed)

    def geom(name: str, kind: str) -> str:
        bits = [int(bit) for bit in rng.integers(0, 4, 2)]
        friction = rng.choice([0.3, 0.8, 1.0, 1.7], 1).tolist() + rng.choice([0.005, 0.02], 2).tolist()
        dims = rng.choice([1, 3, 4, 6], p=[0.15, 0.45, 0.2, 0.2])
        return (
            f'<geom name="{name}" {kind} contype="{bits[0]}" conaffinity="{bits[1]}" condim="{dims}" '
            f'priority="{rng.choice([0, 0, 0, 1])}" friction="{" ".join(map(str, friction))}"/>'
        )

    floor = geom("floor", f'type="plane" size="1 1 1" pos="0 0 {-spread}"')
    places = [(spread * np.cos(k), spread * np.sin(k), 0.0) for k in range(COUNT)]
    ball, bodies = 'size="0.1"', []
    for k, (x, y, z) in enumerate(places):
        child = f'<body name="c{k}" pos="0 0 {spread}"><joint axis="0 1 0"/>{geom(f"h{k}", ball)}</body>' * (k < 2)
        bodies.append(f'<body name="b{k}" pos="{x} {y} {z}"><freejoint/>{geom(f"g{k}", ball)}{child}</body>')
    pair = '<pair geom1="g3" geom2="g4" condim="4" friction="0.4 0.4 0.03 0.001 0.001"/>'
    return (
        f'<worldbody>{floor}{"".join(bodies)}</worldbody><contact><exclude body1="b5" body2="b6"/>{pair}'
        '<exclude body1="b2" body2="b4"/></contact>'
    )


def laws_here(problem: Problem) -> dict[frozenset[str], tuple[float, ...]]:
    """Of each two surfaces that may touch: friction, torsion, rolling."""
    world, parametric = problem.world(), problem.parametric
    rounded = {
        frozenset(parametric.owners(pair)): (pair.law.friction, pair.law.torsion, pair.law.rolling)
        for pair in world.pairs
    }
    return {names: tuple(round(float(number), 12) for number in law) for names, law in rounded.items()}


def laws_there(xml: str) -> dict[frozenset[str], tuple[float, ...]]:
    """The same of the contacts that MuJoCo finds."""
    model = model_of(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = {}
    for contact in data.contact:
        names = frozenset(owner(model, geom) for geom in (contact.geom1, contact.geom2))
        slide, _, spin, roll, _ = contact.friction
        found[names] = tuple(number * (contact.dim >= dim) for number, dim in ((slide, 3), (spin, 4), (roll, 6)))
    return {names: tuple(round(float(number), 12) for number in law) for names, law in found.items()}


def owner(model: Any, geom: int) -> str:
    """The body of a geom, or the ground."""
    body = int(model.geom_bodyid[geom])
    return str(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)) if body else "ground"


@pytest.mark.parametrize("seed", [0, 1, *map(thorough, range(2, 8))])
def test_filters_and_friction_are_those_of_mujoco(seed: int) -> None:
    """Read where all are apart, against MuJoCo's contacts where all overlap."""
    together = laws_there(scene(seed, 1e-3))
    assert len(together) > 5
    assert laws_here(problem_of(read(scene(seed, 1.0))[0])) == together


def robot(foot: str = "", options: str = "") -> str:
    """Three capsules in a chain above a floor, which do not touch each other."""
    shape = '<geom type="capsule" size="0.05 0.1" contype="1" conaffinity="0"/>'
    return f"""{options}<worldbody><geom name="floor" type="plane" size="1 1 1" conaffinity="1"/>
    <body name="a" pos="0 0 1"><freejoint/>{shape}<body name="b" pos="1 0 0"><joint axis="0 1 0"/>{shape}
    <body name="c" pos="1 0 0"><joint axis="0 1 0"/><joint axis="1 0 0"/>{shape}{foot}</body></body></body>
</worldbody>"""


def test_one_table_keeps_a_robot_from_itself() -> None:
    """And it touches whatever a problem adds to it."""
    tables, _ = read(robot())
    assert tables["pair"] == [{"between": ["a_group", "a_group"], "collide": False}]
    assert all(body["group"] == "a_group" for body in tables["body"] if "shape" in body)
    ball = {"name": "ball", "mass": 1, "shape": {"sphere": {"radius": 0.1}}, "position": [5, 0, 1]}
    problem = problem_of({**tables, "body": [*tables["body"], ball]})
    touching = {frozenset(problem.parametric.owners(pair)) for pair in problem.world().pairs}
    assert touching == {frozenset((a, b)) for a in ("a", "b", "c") for b in ("ground", "ball")} | {
        frozenset(("ball", "ground"))
    }


def test_bodies_between_which_several_joints_lie_do_not_touch() -> None:
    tables, _ = read(robot().replace('conaffinity="0"', 'conaffinity="1"'))
    assert tables["pair"] == [{"between": ["b", "c"], "collide": False}]
    assert frozenset(("a", "c")) in laws_here(problem_of(tables))
    apart, findings = read(robot().replace('conaffinity="0"', 'conaffinity="1"'), self_collision=False)
    assert {"ground"} <= {name for names in laws_here(problem_of(apart)) for name in names}
    assert frozenset(("a", "c")) not in laws_here(problem_of(apart))
    assert "as the caller chose" in texts(findings, "left out")


def test_several_laws_of_one_body_are_told() -> None:
    foot = '<geom name="foot" size="0.08" pos="0 0 -0.3" friction="2 0.005 0.0001" condim="3"/>'
    tables, findings = read(robot(foot))
    assert by_name(tables, "body")["c"]["friction"] == 2
    assert "friction of 1 pairs of bodies" in texts(findings, "approximated")


def pair_of(friction: str, plane: str = "", geom: str = 'size="0.1"') -> str:
    """A geom on a plane, with an explicit pair."""
    return f"""<worldbody><geom name="floor" type="plane" size="1 1 1" {plane}/>
    <body name="b" pos="0 0 1"><freejoint/><geom name="g" {geom}/></body></worldbody>
    <contact><pair geom1="floor" geom2="g" condim="4" friction="{friction}"/></contact>"""


@pytest.mark.parametrize("plane", ["", 'zaxis="0 1 2"', 'zaxis="0.1 -3 1"'])
def test_two_coefficients_of_a_pair_hold_along_and_across_the_tangent_of_its_contact(plane: str) -> None:
    """As MuJoCo has it where the ball is pushed into the plane."""
    xml = pair_of("0.8 0.2 0.01 0 0", plane)
    model = model_of(xml)
    data = mujoco.MjData(model)
    data.qpos[:3] = 0
    mujoco.mj_forward(model, data)
    tangent = np.array(data.contact[0].frame).reshape(3, 3)[1]
    tables, findings = read(xml)
    (law,) = {pair.law for pair in problem_of(tables).world().pairs}
    assert (law.friction, law.torsion) == ((0.8, 0.2), 0.01)
    assert np.array(law.friction_direction) == pytest.approx(tangent, abs=1e-12)
    assert "friction_direction" not in texts(findings, "approximated")


def test_two_coefficients_whose_tangents_turn_with_a_body_become_the_larger() -> None:
    tables, findings = read(pair_of("0.8 0.2 0.01 0 0", geom='type="capsule" size="0.1 0.2"'))
    assert by_name(tables, "body")["b"]["friction"] == 0.8
    assert "friction_direction" in texts(findings, "approximated")


def test_shapes_without_a_rule_and_what_overlaps() -> None:
    xml = """<worldbody><geom type="plane" size="1 1 1"/>
    <body name="can" pos="0 0 2"><freejoint/><geom type="ellipsoid" size="0.1 0.1 0.2"/></body>
    <body name="tin" pos="2 0 2"><freejoint/><geom type="ellipsoid" size="0.1 0.1 0.2"/></body>
    <body name="ball" pos="2 0.15 2"><freejoint/><geom size="0.1"/></body></worldbody>"""
    tables, findings = read(xml)
    lost = texts(findings, "left out")
    assert "there is no rule for contact between such shapes: ellipsoid and ellipsoid (1)" in lost
    assert "ball and tin (50 mm)" in lost
    touching = laws_here(problem_of(tables)).keys()
    assert touching == {frozenset((name, "ground")) for name in ("can", "tin", "ball")} | {frozenset(("ball", "can"))}


def test_what_floats_below_the_ground_is_lifted() -> None:
    xml = """<worldbody><geom type="plane" size="1 1 1" pos="0 0 0.5"/><body name="box" pos="0 0 0.52"><freejoint/>
    <geom type="box" size="0.1 0.2 0.06"/></body></worldbody>"""
    tables, findings = read(xml)
    assert tables["body"][0]["position"] == pytest.approx([0, 0, 0.56], abs=1e-12)
    assert "start of box: the model begins below the ground; it is lifted onto it 40 mm" in texts(
        findings, "approximated"
    )


def test_more_points_than_a_world_may_have() -> None:
    """40 boxes, 4 points each two: the robot does not touch itself, but the floor."""
    links = "".join(
        f'<body name="k{k}" pos="1 0 0"><joint axis="0 1 0"/><geom type="box" size="0.1 0.1 0.1"/>' for k in range(40)
    )
    floor = '<geom type="plane" size="1 1 1" pos="0 0 -1"/>'
    tables, findings = read(f"<worldbody>{floor}{links}{'</body>' * 40}</worldbody>")
    assert "there would be 3284 points of contact, and a world may have 2000" in texts(findings, "left out")
    assert len(laws_here(problem_of(tables))) == 40


@pytest.mark.parametrize(("corners", "meet"), [(8, True), (60, False)])
def test_hulls_of_one_robot_meet_if_they_have_few_corners(corners: int, meet: bool) -> None:
    """Those of two robots do in any case."""
    points = np.random.default_rng(1).normal(size=(corners, 3))
    vertices = " ".join(f"{x:.6f}" for x in np.ravel(0.1 * points / np.linalg.norm(points, axis=1)[:, None]))
    links = "".join(
        f'<body name="l{k}" pos="{k} 0 1"><joint axis="0 1 0"/><geom type="mesh" mesh="m"/></body>' for k in range(3)
    )
    xml = f"""<asset><mesh name="m" vertex="{vertices}"/></asset><worldbody><body name="base" pos="0 0 1"><freejoint/>
    <geom type="mesh" mesh="m" pos="0 2 0"/>{links}</body>
    <body name="rock" pos="0 5 1"><freejoint/><geom type="mesh" mesh="m"/></body></worldbody>"""
    tables, findings = read(xml)
    lost = texts(findings, "left out")
    assert ("pairs of bodies of one robot: their hulls have 360 corners" in lost) == (not meet)
    touching = laws_here(problem_of(tables)).keys()
    assert (frozenset(("l0", "l1")) in touching) == meet
    assert frozenset(("l0", "rock")) in touching
