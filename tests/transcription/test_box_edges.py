"""Boxes whose edges are round where they touch planes and terrain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tools.parameter_slopes import slopes
from tools.repeats import few

from symphys import Problem, SymphysError
from symphys.errors import ProblemError
from symphys.model import Body, Plane, make_world
from symphys.problem import load_problem
from symphys.transcription import transcribe

BOX = """
[simulation]
duration = 0.05
dt = 0.01
cuts = 0
[ground]
friction = 0.4
[[body]]
name = "crate"
mass = 2
shape = { box = { size = [0.2, 0.3, 0.1], edge = EDGE } }
position = [0, 0, HEIGHT]
orientation = { pitch_deg = PITCH }
velocity = VELOCITY
[[cost]]
name = "there"
value = "crate.position[0] + crate.angular_velocity[1]"
"""


def box(folder: Path, edge: float = 0.02, pitch: float = 0, height: float = 0.05, velocity: str = "[0, 0, 0]") -> Path:
    """A crate on the ground, or above it."""
    file = folder / "box.toml"
    numbers = {"EDGE": edge, "PITCH": pitch, "HEIGHT": height, "VELOCITY": velocity}
    text = BOX
    for key, value in numbers.items():
        text = text.replace(key, str(value))
    file.write_text(text)
    return file


def gaps(file: Path) -> np.ndarray:
    """(N + 1, 8) of the crate and what stands still [m]."""
    found = transcribe(load_problem(file), backend="casadi").simulate(np.zeros(0))
    names = [name for name in found.units if name.startswith("crate-") and name.endswith(".gap")]
    return np.stack([found[name] for name in names], axis=1)


@pytest.mark.slow
@few("ground", ["[ground]", '[[terrain]]\nname = "ground"\nheight = "0 * x * y"'], 1)
@few("pitch", [0, 30, 60], 1)
def test_the_lowest_point_of_a_tilted_crate(tmp_path: Path, ground: str, pitch: float) -> None:
    """At (a - r) sin + (c - r) cos + r below its centre, for half edges a and c."""
    file = box(tmp_path, pitch=pitch, height=0.3)
    file.write_text(file.read_text().replace("[ground]", ground).replace('"ground"', '"floor"'))
    angle = np.deg2rad(pitch)
    reach = 0.08 * np.sin(angle) + 0.03 * np.cos(angle) + 0.02
    assert gaps(file)[0].min() == pytest.approx(0.3 - reach, abs=1e-9)


def test_it_lies_on_its_faces(tmp_path: Path) -> None:
    """As one with sharp edges does."""
    found = gaps(box(tmp_path))
    assert np.sort(np.abs(found), axis=1)[:, :4] == pytest.approx(np.zeros((6, 4)), abs=1e-9)


@pytest.mark.slow
def test_slopes_by_the_radius(tmp_path: Path) -> None:
    """It lands on an edge, which rolls."""
    file = box(tmp_path, pitch=40, height=0.125, velocity="[0.5, 0, -1]")
    file.write_text(f'{file.read_text()}[[variable]]\nname = "edge"\nsets = "crate.edge"\n')
    (variable,) = load_problem(file).variables
    assert (variable.lower, variable.upper) == (0, pytest.approx(0.0495))
    _, exact, differences = slopes(file)
    assert abs(exact) > 1
    assert differences == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize("edge", [0.05, -0.01])
def test_a_radius_that_leaves_no_box(tmp_path: Path, edge: float) -> None:
    with pytest.raises(ProblemError, match=r"shape.box.edge: .*(half|0)"):
        load_problem(box(tmp_path, edge))
    with pytest.raises(SymphysError, match=r'body "crate": .*half'):
        Body.box("crate", (0.2, 0.3, 0.1), 2, edge=edge)


def test_sharp_edges_have_no_radius_to_vary(tmp_path: Path) -> None:
    file = box(tmp_path, 0)
    file.write_text(f'{file.read_text()}[[variable]]\nname = "edge"\nsets = "crate.edge"\n')
    with pytest.raises(ProblemError, match=r"crate .*edge: .*above 0"):
        load_problem(file)


def test_a_world_from_python_keeps_it(tmp_path: Path) -> None:
    crate = Body.box("crate", (0.2, 0.3, 0.1), 2, edge=0.02, position=(0, 0, 1))
    problem = Problem.from_world(make_world([crate], [Plane.ground()]), duration=0.1)
    assert problem.parameters["crate.edge"].tolist() == [0.02]
    assert problem.world().bodies[0].shapes == crate.shapes
