"""Inertia and centre of mass as variables: as a file has it in which the body is built so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from tools.parameter_slopes import slopes_of

from symphys.errors import ProblemError
from symphys.problem import load_problem
from symphys.transcription import transcribe

CUBE = """
[simulation]
duration = 0.12
dt = 0.004
cuts = 0
[ground]
friction = 0.3
[[body]]
name = "cube"
mass = 0.4
{body}
orientation = [0.9, 0.3, -0.2, 0.1]
angular_velocity = [3, 5, -4]
[[site]]
name = "marker"
body = "cube"
position = [0, 0, 0]
[[cost]]
name = "there"
value = "{value}"
"""
PLAIN = """
shape = { spheres = [{ radius = 0.04, centre = [0.05, 0, 0] }, { radius = 0.04, centre = [-0.05, 0, 0] }] }
inertia = [4e-4, 6e-4, 5e-4]
position = [0, 0, 0.13]
velocity = [1, 0, -1]
"""


def cube(folder: Path, body: str, variables: str = "", value: str = "0") -> Path:
    """A dumbbell that is tossed on the ground."""
    file = folder / "cube.toml"
    file.write_text(CUBE.format(body=body, value=value) + variables)
    return file


def variable(sets: str, guess: str = "") -> str:
    """Its table; without a guess it stays as the file has it, so that steps are built of symbols alike."""
    return f'[[variable]]\nname = "{sets.replace(".", "_")}"\nsets = "{sets}"\n' + f"guess = {guess}\n" * bool(guess)


def motion(file: Path, marker: ArrayLike = (0, 0, 0)) -> np.ndarray:
    """(N + 1, 7): where a point of the cube is, and its orientation; (3,) from the centre of mass."""
    made = transcribe(load_problem(file), backend="casadi")
    z = np.concatenate([np.zeros(0), *(block.guess for block in made.shooting.blocks)])
    found = made.simulate(z)
    q = found["cube.orientation"]
    arm = Rotation.from_quat(np.roll(q, -1, axis=1)).apply(marker)
    return np.hstack([found["cube.position"] + arm, q])


@pytest.mark.slow
def test_a_toss_with_another_inertia(tmp_path: Path) -> None:
    """As that of a file which states it."""
    moments, correlations = np.array([3e-4, 5e-4, 2e-4]), np.array([0.3, -0.2, 0.4])
    yz = 0.3 * -0.2 + 0.4 * np.sqrt((1 - 0.3**2) * (1 - 0.2**2))
    matrix = np.array([[1, 0.3, -0.2], [0.3, 1, yz], [-0.2, yz, 1]]) * np.sqrt(np.outer(moments, moments))
    tensor = moments.sum() * np.eye(3) - matrix
    stated = PLAIN.replace("[4e-4, 6e-4, 5e-4]", str(tensor.tolist()))
    built = motion(cube(tmp_path, stated, variable("cube.second_moments") + variable("cube.correlations")))
    sets = variable("cube.second_moments", str(moments.tolist()))
    sets += variable("cube.correlations", str(correlations.tolist()))
    assert motion(cube(tmp_path, PLAIN, sets)) == pytest.approx(built, abs=1e-9)
    assert motion(cube(tmp_path, PLAIN)) != pytest.approx(built, abs=1e-2)


def test_a_toss_with_another_centre_of_mass(tmp_path: Path) -> None:
    """As that of a file with the shape elsewhere on the body, which starts where the cube does."""
    c = np.array([0.01, -0.004, 0.006])
    q = np.array([0.9, 0.3, -0.2, 0.1])
    w, v = q[0] / np.linalg.norm(q), q[1:] / np.linalg.norm(q)
    arm = c + 2 * np.cross(v, np.cross(v, c) + w * c)
    spheres = ", ".join(f"{{ radius = 0.04, centre = {(np.array([x, 0, 0]) - c).tolist()} }}" for x in (0.05, -0.05))
    other = f"""
shape = {{ spheres = [{spheres}] }}
inertia = [4e-4, 6e-4, 5e-4]
position = {(arm + np.array([0, 0, 0.13])).tolist()}
velocity = {(np.array([1, 0, -1]) + np.cross([3, 5, -4], arm)).tolist()}
"""
    built = motion(cube(tmp_path, other, variable("cube.centre_of_mass")), -c)
    varied = motion(cube(tmp_path, PLAIN, variable("cube.centre_of_mass", str(c.tolist()))), -c)
    assert varied == pytest.approx(built, abs=1e-9)
    assert varied[0, :3] == pytest.approx([0, 0, 0.13])
    assert motion(cube(tmp_path, PLAIN)) != pytest.approx(built, abs=1e-2)


PENDULUM = """
[simulation]
duration = 0.5
dt = 0.002
[[body]]
name = "bob"
mass = 0.7
shape = { box = { size = [0.1, 0.1, 0.3] } }
position = [0, 0, -0.2]
collides_with = []
[[joint]]
name = "pivot"
between = ["world", "bob"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0]
[[variable]]
name = "centre"
sets = "bob.centre_of_mass"
guess = [0.01, 0, -0.05]
[[cost]]
name = "swing"
value = "pivot.angle"
"""


def test_a_pendulum_swings_about_its_joint(tmp_path: Path) -> None:
    """Angle by Newton about the pivot: (I + m l^2) a = -m g (l x), with the mass 1 cm off and 5 cm lower."""
    file = tmp_path / "pendulum.toml"
    file.write_text(PENDULUM)
    value, exact, differences = slopes_of(file, 1e-6)
    inertia, mass, x, z = 0.7 / 12 * (0.1**2 + 0.3**2), 0.7, 0.01, -0.25
    angle, rate, step = 0.0, 0.0, 1e-5
    for _ in range(50_000):
        level = x * np.cos(angle) + z * np.sin(angle)
        rate += step * mass * 9.81 * level / (inertia + mass * (x * x + z * z))
        angle += step * rate
    assert value == pytest.approx(angle, rel=1e-4)
    assert exact[[0, 2]] == pytest.approx(differences[[0, 2]], rel=1e-5)
    made = transcribe(load_problem(file), backend="casadi").simulate(np.array([0.01, 0, -0.05]))
    assert np.abs(made.joint_separation[0]).max() < 1e-12


SLOPE = """
[simulation]
duration = 0.3
dt = 0.01
[contact]
friction = 0
[[body]]
name = "ball"
shape = {{ sphere = {{ radius = 0.1 }} }}
mass = 0.5
position = {position}
[world]
gravity = {gravity}
{surface}
[[variable]]
name = "tilt"
sets = "{name}.tilt"
[[cost]]
name = "there"
value = "dot(ball.position, {along})"
"""


@pytest.mark.parametrize(
    ("normal", "along", "sign"),
    [
        ((0, 0, 1), [(1, 0, 0), (0, 1, 0)], (1, -1)),
        ((1, 0, 0), [(0, 0, -1), (0, 1, 0)], (1, -1)),
        ((0, 0, -1), [(1, 0, 0), (0, -1, 0)], (1, -1)),
    ],
)
def test_a_ball_slides_off_what_is_tilted(
    tmp_path: Path, normal: tuple[int, ...], along: list[tuple[int, ...]], sign: tuple[int, int]
) -> None:
    """By g t^2 / 2 times the tilt, where gravity presses it on: tilt about y towards the first axis."""
    file, up = tmp_path / "slope.toml", np.array(normal)
    surface = f'[[plane]]\nname = "floor"\nnormal = {list(normal)}\noffset = 0\n'
    name = "floor"
    if normal == (0, 0, 1):
        surface, name = "[ground]\n", "ground"
    for k, axis in enumerate(along):
        numbers = {"position": (0.1 * up).tolist(), "gravity": (-10.0 * up).tolist(), "along": list(axis)}
        file.write_text(SLOPE.format(surface=surface, name=name, **numbers))
        value, exact, differences = slopes_of(file, 1e-6)
        expected = np.zeros(2)
        expected[1 - k] = sign[k] * 10 * 0.3**2 / 2
        assert value == pytest.approx(0, abs=1e-12)
        assert exact == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert differences == pytest.approx(expected, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(
    ("sets", "guess", "lower", "message"),
    [
        ("cube.second_moments", "[1e-4, 1e-4, -1e-4]", "[-1, -1, -1]", "cube.second_moments must be at least 0"),
        ("cube.correlations", "[0, 0, 0]", "[-2, -1, -1]", "cube.correlations must be at least -1"),
        ("ground.tilt", "[0, 0]", "[-2, 0]", "ground.tilt must be at least -1.5708"),
        ("ground.centre_of_mass", "0", "0", "no quantity .*ground.tilt"),
    ],
)
def test_what_cannot_vary(tmp_path: Path, sets: str, guess: str, lower: str, message: str) -> None:
    file = cube(tmp_path, PLAIN, f"{variable(sets, guess)}lower = {lower}\n")
    with pytest.raises(ProblemError, match=message):
        load_problem(file)
