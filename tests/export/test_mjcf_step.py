"""A model moves in MuJoCo as the world does here: motors, springs and soft contacts hold at the file's time step."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tools.repeats import few

from symphys.export import problem_model
from symphys.export.mjcf import inertias
from symphys.export.mjcf_bodies import StartState
from symphys.export.mjcf_trial import stiffer, tried_model
from symphys.problem import Problem, problem_of_tables

mujoco = pytest.importorskip("mujoco")
SIMULATION = {"duration": 1.0, "dt": 0.01}
STILL = {"gravity": [0, 0, 0]}


def wheel(inertia: float, **joint: Any) -> Problem:
    """A body on a hinge about y, without gravity."""
    hinge = {"name": "j", "between": ["world", "w"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 0], **joint}
    body = {"name": "w", "mass": 1.0, "inertia": inertia}
    return problem_of_tables({"simulation": SIMULATION, "world": STILL, "body": [body], "joint": [hinge]}, "wheel")


def on_soft_ground(shape: dict[str, Any], height: float, frequency: float, **more: Any) -> Problem:
    """A body that lies on ground that gives way with a damping ratio of 1."""
    body = {"name": "b", "shape": shape, "mass": 2.0, "position": [0, 0, height]}
    pair = {"between": ["b", "ground"], "friction": 0.5, "frequency": frequency, "damping": 1.0}
    tables = {"simulation": SIMULATION, "ground": {}, "body": [body], "pair": [pair], **more}
    return problem_of_tables(tables, "soft")


def run(text: str, ctrl: Any = 0.0, seconds: float = 1.0) -> tuple[Any, Any]:
    """MuJoCo's data at the end, and all qpos and qvel on the way (K, n)."""
    model = mujoco.MjModel.from_xml_string(text)
    data, rows = mujoco.MjData(model), []
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = ctrl
    while data.time < seconds - 1e-9:
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([data.qpos, data.qvel]))
    assert not sum(warning.number for warning in data.warning)
    return data, np.array(rows)


def test_inertias_are_those_of_the_mass_matrix() -> None:
    names = ("torso", "frame", "leg", "foot")
    solid = {"mass": 1.0, "inertia": [0.01, 0.02, 0.03]}
    places = [{"name": name, "position": [0.2 * k, 0, 1]} for k, name in enumerate(names)]
    body = [place | ({"mass": 0.0} if place["name"] == "frame" else solid) for place in places]
    kinds = ({"hinge": {"axis": [1, 0, 1]}}, {"hinge": {"axis": [0, 1, 0]}}, {"slider": {"axis": [1, 1, 0]}})
    joint = [
        {"name": f"j{k}", "between": [names[k], names[k + 1]], "point": [0.2 * k, 0.1, 1], "start": 0.3, **kind}
        for k, kind in enumerate(kinds)
    ]
    joint[2]["armature"] = 0.02
    problem = problem_of_tables({"simulation": SIMULATION, "body": body, "joint": joint}, "leg")
    model = mujoco.MjModel.from_xml_string(problem_model(problem).text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    for row, unit in zip(mass, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    give = np.diag(np.linalg.inv(mass))
    found = inertias(StartState(problem.parametric.world({}), problem.initial))
    assert len(found) == 3
    for (name, _), inertia in found.items():
        assert inertia * give[model.joint(name).dofadr[0]] == pytest.approx(1)


@pytest.mark.slow
@pytest.mark.parametrize("inertia", [1e-4, 1e-2])
def test_a_velocity_motor_settles_at_its_command(inertia: float) -> None:
    """However light the wheel: at 10 ms its torque alone would throw the lighter one to 100 rad/s."""
    problem = wheel(inertia, motor={"velocity": {"torque": 1.0, "velocity": 10.0}})
    _, rows = run(problem_model(problem).text, ctrl=5.0, seconds=0.5)
    rate = rows[len(rows) // 2 :, 1]
    assert rate == pytest.approx(5.0, abs=0.01)
    assert rows[:, 1].max() < 6


@pytest.mark.parametrize("motor", [False, True])
def test_a_stiff_spring_keeps_its_amplitude(motor: bool) -> None:
    """Of 318 Hz, or a motor of the same stiffness: a step of 10 ms would throw it away."""
    acting: dict[str, Any] = {"spring": {"stiffness": 40_000.0, "damping": 0.0}}
    if motor:
        acting = {"motor": {"affine": {"kp": 10_000.0, "gear": 2}}}
    _, rows = run(problem_model(wheel(0.01, start=0.3, **acting)).text)
    assert 0.25 < np.abs(rows[:, 0]).max() < 0.36


def test_a_ball_sinks_into_soft_ground_as_far_as_here() -> None:
    """By g / omega^2, whatever its mass."""
    for frequency in (5.0, 15.0):
        data, _ = run(problem_model(on_soft_ground({"sphere": {"radius": 0.1}}, 0.1, frequency)).text)
        assert 0.1 - data.qpos[2] == pytest.approx(9.81 / (2 * math.pi * frequency) ** 2, rel=0.02)


def test_a_box_on_soft_ground_is_held_by_friction() -> None:
    """A tenth of its weight pulls to the side: free it would go 0.5 m, and it neither creeps nor hops."""
    tilted = {"gravity": [1.0, 0, -9.81]}
    problem = on_soft_ground({"box": {"size": [0.2, 0.2, 0.1]}}, 0.05, 15.0, world=tilted)
    data, _ = run(problem_model(problem).text)
    assert abs(data.qpos[0]) < 1e-3 and 0.045 < data.qpos[2] < 0.05


@few(("way", "mu"), [([1, 0, 0], 0.5), ([0, 1, 0], 0.2)], 1)
def test_friction_along_and_across_a_direction_brakes_there_as_here(way: list[int], mu: float) -> None:
    """A box that slides along x, where mu is 0.5, or along y, where it is 0.2; MuJoCo's tangents are y and x."""
    box = {"name": "b", "shape": {"box": {"size": [0.4, 0.4, 0.1]}}, "mass": 2.0, "position": [0, 0, 0.05]}
    ground = {"friction": [0.5, 0.2], "friction_direction": [1, 0, 0]}
    tables = {"simulation": SIMULATION, "ground": ground, "body": [{**box, "velocity": [2 * each for each in way]}]}
    data, _ = run(problem_model(problem_of_tables(tables, "slide")).text, seconds=0.3)
    pressed = 9.81 * data.time + data.qvel[2]  # what the ground has given, by mass: the box may hop
    assert 2 - data.qvel[:3] @ way == pytest.approx(mu * pressed, rel=0.02)


def test_a_soft_foot_has_its_own_mass_behind_it_whatever_hangs_on_it() -> None:
    """MuJoCo's estimate has the joints in it; a trial corrects it, and a robot sinks by F / (m omega^2) as here."""
    foot = {"name": "foot", "shape": {"sphere": {"radius": 0.1}}, "mass": 0.5, "position": [0, 0, 0.1]}
    load = {"name": "load", "mass": 5.0, "inertia": 0.1, "position": [0, 0, 0.6], "collides_with": []}
    leg = {"name": "leg", "between": ["load", "foot"], "slider": {"axis": [1, 0, 0]}, "point": [0, 0, 0.3]}
    rail = {"name": "rail", "between": ["world", "load"], "slider": {"axis": [0, 0, 1]}, "point": [0, 0, 0.6]}
    pair = {"between": ["foot", "ground"], "friction": 0.0, "frequency": 15.0, "damping": 1.0}
    tables = {"simulation": SIMULATION, "ground": {}, "body": [foot, load], "joint": [rail, leg], "pair": [pair]}
    problem = problem_of_tables(tables, "leg")
    text = problem_model(problem).text
    data, _ = run(problem_model(problem, stiffer=stiffer(problem.world(), text)).text)
    assert -data.qpos[0] == pytest.approx(5.5 * 9.81 / (0.5 * (2 * math.pi * 15) ** 2), rel=0.05)


@pytest.mark.slow
def test_the_robot_of_the_timing_table_stands() -> None:
    """Commanded to its start it stays there; at 10 ms with stiff gains it sank by 6 cm, or was thrown."""
    pose = [0, 0, np.deg2rad(25), np.deg2rad(-50)] * 4
    include = [{"file": "robots/table_robot.toml"}]
    tables = {"simulation": {**SIMULATION, "sweeps": 20}, "ground": {"friction": 0.8}, "include": include}
    problem = problem_of_tables(tables, "table")
    data, rows = run(problem_model(problem, approximate=True).text, ctrl=pose)
    assert data.qpos[2] == pytest.approx(0.594, abs=0.005)
    assert np.abs(rows[:, 3] - 1).max() < 1e-4


def test_a_trial_says_how_far_the_motions_are_apart() -> None:
    """In the first lines of the file: of an oscillator, whose phase MuJoCo has to first order in the step."""
    problem = wheel(0.01, start=0.3, spring={"stiffness": 0.4, "damping": 0.01})
    made = tried_model(problem, approximate=False)
    (found,) = (each for each in made.departures if each.kind == "measured")
    assert str(found) in made.text.split("<compiler")[0]
    assert f"MuJoCo {mujoco.__version__} is off by at most" in found.how
    assert float(found.how.split("at most ")[1].split(" mm")[0]) < 1e-6
    assert float(found.how.split(" and ")[1].split(" degrees")[0]) < 0.6  # 0.3 rad times omega dt / 2
