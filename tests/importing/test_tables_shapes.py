"""Shapes, height fields, names, masses, and that nothing of a model is dropped in silence."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from data.imported import by_name, model_of, problem_of, read, texts
from tools.repeats import few

from symphys.importing import fitting
from symphys.importing.records import ImportOptions
from symphys.importing.robot import read_source, tables_of
from symphys.model.shapes import Box, Sphere

mujoco = pytest.importorskip("mujoco")

KINDS = """<worldbody><body name="all" pos="0 0 1" euler="0.1 0.2 0.3"><freejoint/>
<geom type="sphere" size="0.1" pos="1 0 0"/>
<geom type="capsule" size="0.05" fromto="0 1 0 0.3 1 0.4"/><geom type="cylinder" size="0.1 0.2" euler="1 0 0"/>
<geom type="ellipsoid" size="0.1 0.2 0.3" pos="0 0 1"/><geom type="box" size="0.1 0.2 0.3" pos="0 0 2" euler="0 0.5 0"/>
<geom type="capsule" size="0.1 1e-9"/></body></worldbody>"""


def test_shapes_lie_where_mujoco_has_them() -> None:
    tables, _ = read(KINDS)
    model = model_of(KINDS)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    parts, body = tables["body"][0]["shape"]["parts"], tables["body"][0]
    kinds = [next(iter(part)) for part in parts]
    assert kinds == ["sphere", "capsule", "cylinder", "ellipsoid", "box", "sphere"]
    assert parts[1]["capsule"] == {"radius": 0.05, "length": pytest.approx(0.5)}
    assert parts[2]["cylinder"] == {"radius": 0.1, "length": 0.4}
    assert parts[3]["ellipsoid"] == {"radii": [0.1, 0.2, 0.3]}
    assert parts[4]["box"] == {"size": [0.2, 0.4, 0.6]}
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.array(body["orientation"]))
    for part, place, axes in zip(parts, data.geom_xpos, data.geom_xmat, strict=True):
        here = np.array(body["position"]) + turn.reshape(3, 3) @ part.get("centre", [0, 0, 0])
        assert here == pytest.approx(place, abs=1e-12)
        own = np.zeros(9)
        mujoco.mju_quat2Mat(own, np.array(part.get("orientation", [1, 0, 0, 0]), float))
        if "sphere" not in part:
            assert turn.reshape(3, 3) @ own.reshape(3, 3) == pytest.approx(axes.reshape(3, 3), abs=1e-12)


def test_masses_of_a_welded_body() -> None:
    """Mass, centre and inertia of three welded bodies, against MuJoCo's mass matrix of the free joint."""
    rng = np.random.default_rng(1)
    inner = ""
    for k in range(3):
        place, turn = (" ".join(map(str, rng.normal(size=3))) for _ in "ab")
        inner += f'<body name="w{k}" pos="{place}" euler="{turn}"><inertial pos="0.1 {0.1 * k} 0" mass="{k + 1}" '
        inner += f'diaginertia="{0.02 + k} 0.03 {0.025 + k}" euler="0.3 0.1 0.2"/>'
    base = '<body name="base" euler="0.2 0 1"><freejoint/><geom size="0.1"/>'
    xml = f"<worldbody>{base}{inner}{'</body>' * 4}</worldbody>"
    model, body = model_of(xml), read(xml)[0]["body"][0]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    full = np.zeros((6, 6))
    mujoco.mj_fullM(model, full, data.qM) if hasattr(data, "qM") else mujoco.mj_fullM(model, data, full)
    arm = np.array(body["position"]) - data.xpos[1]
    turn = data.xmat[1].reshape(3, 3)
    inertia = np.array(body["inertia"]) + body["mass"] * (arm @ arm * np.eye(3) - np.outer(turn.T @ arm, turn.T @ arm))
    assert body["mass"] == pytest.approx(full[0, 0], rel=1e-12)
    assert body["position"] == pytest.approx(data.subtree_com[1], abs=1e-12)
    assert inertia == pytest.approx(full[3:, 3:], rel=1e-11, abs=1e-11)


def field(rows: int, columns: int, data: str = "") -> str:
    """A height field above the origin, and a sphere."""
    return f"""<asset><hfield name="hills" nrow="{rows}" ncol="{columns}" size="2 1 0.5 0.1" {data}/></asset>
    <worldbody><geom name="land" type="hfield" hfield="hills" pos="0.3 0.1 0.2"/>
    <body pos="0 0 5"><freejoint/><geom size="0.1"/></body></worldbody>"""


def test_a_height_field_is_terrain() -> None:
    """Where rays from above meet MuJoCo's."""
    values = np.round(np.random.default_rng(0).uniform(size=(4, 5)), 3)
    values[0, 0], values[1, 1] = 0.0, 1.0
    xml = field(4, 5, f'elevation="{" ".join(map(str, values.ravel()))}"')
    table = read(xml)[0]["terrain"][0]
    model = model_of(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, np.int32)
    for row in range(4):
        for column in range(5):
            x, y = (table["origin"][k] + table["spacing"][k] * (column, row)[k] for k in (0, 1))
            x, y = (min(max(v, m - r + 1e-6), m + r - 1e-6) for v, m, r in ((x, 0.3, 2), (y, 0.1, 1)))
            distance = mujoco.mj_ray(model, data, [x, y, 4.0], [0.0, 0.0, -1.0], None, 1, -1, hit)
            assert 4 - distance == pytest.approx(table["heights"][row][column], abs=1e-5)


def test_a_large_height_field_is_thinned_and_a_flat_one_a_plane() -> None:
    waves = np.sin(np.arange(60) / 8)[:, None] + np.cos(np.arange(80) / 9)
    waves = (waves - waves.min()) / np.ptp(waves)
    tables, findings = read(field(60, 80, f'elevation="{" ".join(f"{v:.5f}" for v in waves.ravel())}"'))
    heights = np.array(tables["terrain"][0]["heights"])
    assert heights.size <= 1024
    corners = 0.2 + 0.5 * waves[[-1, 0]][:, [0, -1]]  # rows of an elevation are from the far end
    assert heights[[0, -1]][:, [0, -1]] == pytest.approx(corners, abs=1e-5)
    near = texts(findings, "approximated")
    assert "60 x 80 heights are thinned to" in near
    assert float(near.split(" mm")[0].rpartition(" ")[2]) < 15
    flat, findings = read(field(60, 80))
    assert flat["plane"][0]["point"] == [0.3, 0.1, 0.2]
    assert "all its heights are the same" in texts(findings, "approximated")


def test_how_far_a_height_field_is_from_its_triangles_is_said() -> None:
    """A step of 0.5 m between two columns: the cubic leaves the straight line by 0.5 / (6 sqrt(3)) m at most."""
    steps = field(3, 6, 'elevation="' + "0 0 0 1 1 1 " * 3 + '"')
    tables, findings = read(steps)
    heights = np.array(tables["terrain"][0]["heights"])
    assert (heights.min(), heights.max()) == (0.2, 0.7)
    told = float(texts(findings, "approximated").split("differ by at most ")[1].split(" mm")[0])
    assert told == pytest.approx(1000 * 0.5 / (6 * np.sqrt(3)), rel=0.05)


def test_a_mesh_is_its_hull() -> None:
    """A cube of 8 corners with a dent, and a ball of 400 points that is thinned to 64."""
    cube = "0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 1 0 1 0 1 1 1 1 1 0.5 0.5 0.9"
    ball = np.random.default_rng(3).normal(size=(400, 3))
    ball = 0.2 * ball / np.linalg.norm(ball, axis=1)[:, None]
    xml = f"""<asset><mesh name="cube" vertex="{cube}"/>
    <mesh name="ball" vertex="{" ".join(f"{v:.6f}" for v in ball.ravel())}"/></asset><worldbody>
    <geom type="plane" size="1 1 1"/><body name="a" pos="0 0 3"><freejoint/><geom type="mesh" mesh="cube"/></body>
    <body name="b" pos="4 0 3"><freejoint/><geom type="mesh" mesh="ball"/></body></worldbody>"""
    tables, findings = read(xml)
    bodies = by_name(tables, "body")
    corners = np.array(part_of(bodies["a"])["convex"]["points"])
    assert len(corners) == 8
    assert np.ptp(corners, axis=0) == pytest.approx(np.ptp(corners, axis=0).max() * np.ones(3), abs=2.0)
    assert len(part_of(bodies["b"])["convex"]["points"]) == 64
    near = texts(findings, "approximated")
    off = float(near.partition("up to ")[2].split(" mm")[0])
    assert 5 < off < 40
    assert len(problem_of(tables).world().pairs) == 8 + 8 + 4


def test_a_mesh_may_be_fitted_by_shapes_that_touch_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """The places of shapes are those of the fit, in the frame of the mesh, which is turned in its body."""
    shapes = (Box((0.6, 0.2, 0.1), (0.01, 0.02, 0.03), (0.6, 0.8, 0.0, 0.0)), Sphere(0.1, (0.2, 0.0, 0.0)))
    monkeypatch.setattr(fitting, "fit", lambda *_: fitting.Fit("box", shapes, 1.0, 2.0))
    corners = " ".join(f"{x} {y} {z}" for x in (0, 0.6) for y in (0, 0.2) for z in (0, 0.1))
    geom = '<geom type="mesh" mesh="bar" pos="0.1 0 0" euler="0.3 0.2 0.1"/>'
    xml = f"""<asset><mesh name="bar" vertex="{corners}"/></asset><worldbody><body name="a" pos="0 0 3"><freejoint/>
    {geom}</body><body name="b" pos="4 0 3"><freejoint/>{geom}</body></worldbody>"""
    tables, findings = read(xml, meshes="fit")
    body, model = by_name(tables, "body")["a"], model_of(xml)
    box, ball = body["shape"]["parts"]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert box["box"]["size"] == [1.2, 0.4, 0.2]
    turn, place = data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0]
    assert np.array(body["position"]) + ball["centre"] == pytest.approx(place + turn @ [0.2, 0, 0], abs=1e-12)
    assert np.array(body["position"]) + box["centre"] == pytest.approx(place + turn @ [0.01, 0.02, 0.03], abs=1e-12)
    own, wanted = np.zeros(9), np.zeros(9)
    mujoco.mju_quat2Mat(own, np.array(box["orientation"]))
    mujoco.mju_quat2Mat(wanted, np.array([0.6, 0.8, 0, 0]))
    assert own.reshape(3, 3) == pytest.approx(turn @ wanted.reshape(3, 3), abs=1e-12)
    assert "mesh bar: 2 box 1 mm too small, 2 mm too large" in texts(findings, "approximated")
    assert len(problem_of(tables).world().pairs) == 4 + 1 + 1 + 1


def part_of(body: dict[str, object]) -> dict[str, dict[str, object]]:
    """The only part of a body's shape."""
    shape = body["shape"]
    assert isinstance(shape, dict)
    return shape["parts"][0] if "parts" in shape else shape  # type: ignore[no-any-return]


def test_what_only_the_eye_meets_is_the_shape_of_a_body_without_another() -> None:
    xml = """<worldbody><geom type="plane" size="1 1 1"/><body name="seen" pos="0 0 2"><freejoint/>
    <geom size="0.1" contype="0" conaffinity="0"/></body><body name="both" pos="1 0 2"><freejoint/><geom size="0.1"/>
    <geom size="0.2" contype="0" conaffinity="0"/></body></worldbody>"""
    tables, findings = read(xml)
    bodies = by_name(tables, "body")
    assert bodies["seen"]["collides_with"] == []
    assert bodies["both"]["shape"] == {"sphere": {"radius": 0.1}}
    assert "1 geoms that collide with nothing" in texts(findings, "left out")
    assert [pair.name.split(":")[0] for pair in problem_of(tables).world().pairs] == ["both-ground"]


def test_names_become_identifiers_that_are_used_once() -> None:
    xml = """<worldbody><geom name="rail" type="box" size="1 1 1" pos="9 0 0"/><body name="sin"><joint name="knee.1 é"/>
    <geom size="0.1"/><body name="knee" pos="1 0 0"><joint name="knee"/><joint name="lambda" axis="1 0 0"/>
<geom size="0.1"/>
    <site name="knee"/><body pos="1 0 0"><joint/><geom size="0.1"/></body></body></body>
    <body name="KNEE" pos="3 3 3"><freejoint/><geom size="0.1"/></body><body name="9" pos="5 5 5"><freejoint/>
    <geom size="0.1"/></body></worldbody>"""
    problem_of(read(xml)[0])


def test_massless_ends_and_impossible_inertias_are_mended() -> None:
    xml = """<compiler boundmass="0"/><worldbody><body name="arm" pos="0 0 1"><joint axis="0 1 0"/><geom size="0.1"/>
    <body name="tip" pos="0.5 0 0"><joint name="wrist" axis="1 0 0"/><inertial pos="0 0 0" mass="1e-9"
    diaginertia="1e-12 1e-12 1e-12"/></body></body></worldbody>"""
    from symphys.importing.records import CompiledModel, Inertial

    light = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    bent = Inertial(2.0, np.array([0.1, 0, 0]), np.diag([0.1, 0.1, 0.3]))
    source = CompiledModel(Path("robot.urdf"), "urdf", model_of(xml), {"tip": light, "arm": bent})
    tables, findings = tables_of(source, ImportOptions())
    assert [body["name"] for body in tables["body"]] == ["arm"]
    assert tables["body"][0]["inertia"] == pytest.approx([0.1, 0.1, 0.2])
    assert tables["body"][0]["position"] == [0.1, 0, 1]
    assert "joints of body tip: bodies without mass at the end of a branch" in texts(findings, "left out")
    assert "inertia of arm: no rigid body has the moments of the model" in texts(findings, "approximated")
    assert "0.1 kg m^2" in texts(findings, "approximated")
    problem_of(tables)


LOST = """<mujoco><option density="1.2" viscosity="0.1" wind="1 0 0"/><worldbody><light pos="0 0 3"/><camera name="c"/>
<body name="a" pos="0 0 1" gravcomp="0.5"><freejoint name="f"/><geom size="0.1"/><site name="s"/>
<body name="b" pos="0.5 0 0"><joint name="j" type="ball" damping="2" stiffness="1" range="0 1" limited="true"/>
<geom size="0.1"/><site name="t"/></body></body>
<body name="m" mocap="true" pos="0 3 1"><geom size="0.1"/></body></worldbody>
<tendon><spatial name="rope" stiffness="3"><site site="s"/><site site="t"/></spatial></tendon>
<actuator><motor name="pull" tendon="rope"/><motor name="turn" joint="j"/><motor name="jet" site="s"/>
<adhesion name="glue" body="a" ctrlrange="0 1"/></actuator><sensor><force site="s"/><rangefinder site="s"/></sensor>
<equality><tendon name="hold" tendon1="rope"/></equality><keyframe><key name="rest"/></keyframe></mujoco>"""


def test_nothing_is_dropped_in_silence() -> None:
    lost = texts(read(LOST)[1], "left out")
    for words in (
        *("fluid", "wind", "gravity", "lights", "cameras", "tendons rope", "actuator pull", "actuator turn"),
        *("actuator glue", "1 force, 1 rangefinder", "equality hold", "motion of body m", "keyframes rest"),
        *("damping of joint j", "stiffness of joint j", "limit of joint j", "time step 0.002 s"),
    ):
        assert words in lost, f"{words} is not in\n{lost}"


def gymnasium(name: str) -> Path:
    """A model of gymnasium's."""
    spec = importlib.util.find_spec("gymnasium")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("gymnasium is not installed")
    return Path(spec.submodule_search_locations[0]) / "envs" / "mujoco" / "assets" / f"{name}.xml"


@pytest.mark.slow
@few(
    ("name", "bodies", "frames", "joints", "motors"),
    [
        ("ant", 9, 0, 8, 8),
        ("half_cheetah", 7, 2, 9, 6),
        ("hopper", 4, 2, 6, 3),
        ("walker2d", 7, 2, 9, 6),
        ("humanoid", 11, 7, 17, 17),
    ],
    1,
)
def test_gymnasiums_models(name: str, bodies: int, frames: int, joints: int, motors: int) -> None:
    source = read_source(gymnasium(name), ImportOptions())
    tables, _ = tables_of(source, ImportOptions(self_collision=False))
    problem = problem_of(tables)
    weighing = [body for body in problem.world().bodies if not body.massless]
    assert len(weighing) == bodies
    assert len(problem.world().bodies) == bodies + frames
    assert sum(body.mass for body in weighing) == pytest.approx(source.model.body_mass.sum(), rel=1e-12)
    assert len(tables["joint"]) == joints
    assert sum("motor" in joint for joint in tables["joint"]) == motors
