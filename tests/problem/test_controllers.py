"""Sensors and controllers of a file: what can be wrong with them."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from symphys.errors import ProblemError
from symphys.problem import load_problem

SOURCE = """
[simulation]
duration = 1.0
dt = 0.01

[[body]]
name = "arm"
shape = { capsule = { radius = 0.05, length = 0.4 } }
mass = 2.0

[[joint]]
name = "pivot"
between = ["world", "arm"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0.2]
motor = { torque = { torque = 3 } }

[[sensor]]
name = "state"
reads = ["pivot.angle", "pivot.rate"]

[[controller]]
name = "brain"
drives = "pivot.command"
senses = ["state"]
net = { hidden = [3] }
"""


def refused(folder: Path, old: str, new: str) -> str:
    """What is said of the file with a change in it."""
    assert old in SOURCE
    path = folder / "arm.toml"
    path.write_text(SOURCE.replace(old, new))
    with pytest.raises(ProblemError) as caught:
        load_problem(path)
    return str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"pivot.rate"', '"pivot.rat"', ['sensor "state".reads', "pivot.rate"]),
        ('"pivot.rate"', '"1 / pivot.rate"', ['sensor "state".reads', "not a finite number"]),
        ('"pivot.rate"', '"pivot.rate +"', ['sensor "state".reads']),
        ('senses = ["state"]', 'senses = ["stat"]', ['controller "brain".senses', '"state"']),
        ('senses = ["state"]', "senses = []", ['controller "brain".senses', "sensors"]),
        ('"pivot.command"', '"pivot.comand"', ['controller "brain".drives', "pivot.command"]),
        ('"pivot.command"', '"arm.mass"', ['controller "brain".drives', "forces, torques and commands"]),
        ('"pivot.command"', '["pivot.command", "pivot.command"]', ['controller "brain".drives', "twice"]),
        ("net = { hidden = [3] }", "", ['controller "brain"', "linear = { gains"]),
        ("net = {", "linear = {}\nnet = {", ['controller "brain"', "linear and net"]),
        ("hidden = [3]", "hidden = [0]", ['controller "brain".net.hidden']),
        ("hidden = [3]", 'activation = "sine"', ['controller "brain".net.activation', "tanh"]),
        ("hidden = [3]", 'weights = "none.npy"', ['controller "brain".net.weights', "cannot be read"]),
        ("net = { hidden = [3] }", "linear = { gains = [1, 2, 3] }", ['controller "brain".linear.gains', "2 of them"]),
        ("net = { hidden = [3] }", "periodic = { frequency = 1 }", ['controller "brain".senses', "senses nothing"]),
        ('name = "brain"', 'name = "state"', ['"state" is already the name']),
        ("net = {", "scale = [1, 2]\nnet = {", ['controller "brain".scale', "it has 2"]),
    ],
)
def test_faults_name_table_and_key(tmp_path: Path, old: str, new: str, said: list[str]) -> None:
    """Each with what would be valid."""
    text = refused(tmp_path, old, new)
    for part in said:
        assert part in text


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        (np.zeros(12), "the net has 13 weights"),
        (np.zeros((13, 1)), "(13,) is needed"),
        (np.where(np.arange(13) == 4, np.nan, 0.0), "the first is number 4"),
        (np.array(["a"] * 13), "one array of numbers"),
    ],
)
def test_weights_that_do_not_fit(tmp_path: Path, weights: np.ndarray, said: str) -> None:
    """Shape, kind and finiteness; the message names the file and what the net has."""
    np.save(tmp_path / "w.npy", weights)
    text = refused(tmp_path, "hidden = [3]", 'hidden = [3], weights = "w.npy"')
    assert 'controller "brain".net.weights' in text and "w.npy" in text and said in text


def test_files_are_never_unpickled(tmp_path: Path) -> None:
    """A pickle in a .npy file could run anything."""
    np.save(tmp_path / "w.npy", np.array([print] * 13, dtype=object), allow_pickle=True)
    assert "no .npy file of numbers" in refused(tmp_path, "hidden = [3]", 'hidden = [3], weights = "w.npy"')


def test_half_an_archive_of_weights(tmp_path: Path) -> None:
    (tmp_path / "w.npy").write_bytes(b"PK\x03\x04 half an archive")
    assert "no .npy file of numbers" in refused(tmp_path, "hidden = [3]", 'hidden = [3], weights = "w.npy"')


def test_weights_of_a_file(tmp_path: Path) -> None:
    """What is in the file is what the controller has."""
    np.save(tmp_path / "w.npy", np.arange(13, dtype=np.float32))
    (tmp_path / "arm.toml").write_text(SOURCE.replace("hidden = [3]", 'hidden = [3], weights = "w.npy"'))
    problem = load_problem(tmp_path / "arm.toml")
    assert np.array_equal(problem.weights["brain.weights"], np.arange(13.0))


@pytest.mark.parametrize(("inputs", "outputs", "said"), [(3, 1, "3 arguments for what is sensed"), (2, 2, "2 outputs")])
def test_functions_that_do_not_fit(tmp_path: Path, inputs: int, outputs: int, said: str) -> None:
    """Sizes are compared before anything is built."""
    path = tmp_path / "arm.toml"
    path.write_text(SOURCE.replace("net = { hidden = [3] }", "function = {}"))
    o, t, w = ca.SX.sym("o", inputs), ca.SX.sym("t"), ca.SX.sym("w")
    function = ca.Function("f", [o, t, w], [w * ca.SX.ones(outputs) * ca.sum1(o)])
    with pytest.raises(ProblemError, match=said):
        load_problem(path, functions={"brain": function})


def test_function_without_a_controller(tmp_path: Path) -> None:
    """A name that no controller has is no silent mistake."""
    path = tmp_path / "arm.toml"
    path.write_text(SOURCE)
    o, t, w = ca.SX.sym("o", 2), ca.SX.sym("t"), ca.SX.sym("w")
    function = ca.Function("f", [o, t, w], [w])
    with pytest.raises(ProblemError, match="brian"):
        load_problem(path, functions={"brian": function})
