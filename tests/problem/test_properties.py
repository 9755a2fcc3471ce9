"""Whatever a file holds, either a Problem or a ProblemError comes out."""

from __future__ import annotations

import contextlib
import copy
import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds.included import MAIN, ROBOT

from symphys.errors import ProblemError
from symphys.problem import load_problem
from symphys.problem.schema import Document

KEYS = sorted({*Document.model_fields, "name", "mass", "friction", "value", "at", "sets", "guess", "sphere", "radius"})
TEXTS = [
    "x * y",
    "pins",
    "hills",
    "",
    "ball",
    "ball.velocity",
    "ball.force[0:2]",
    "ball.mass",
    "gravity",
    "end",
    "always",
    "1 / time",
    "é",
    "-",
]
VALUES = st.recursive(
    st.one_of(
        st.booleans(),
        st.integers(-(10**25), 10**25),
        st.floats(),
        st.sampled_from([0, 1, -1, 0.5, 1e308, 1e-308, 100]),
        st.sampled_from(TEXTS),
        st.text(max_size=10),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=5), inner, max_size=4)
    ),
    max_leaves=6,
)


SHAPES = """
[simulation]
duration = 1.0
dt = 0.01

[[body]]
name = "tower"
shape = { parts = [
    { box = { size = [1, 2, 3] }, centre = [0, 0, 0.5] },
    { capsule = { radius = 0.5, length = 1.0 }, centre = [0, 0, -1], orientation = { roll_deg = 90 } },
] }
mass = 2.0
inertia = [1, 1, 1]
position = [0, 0, 9]
group = "pins"

[[body]]
name = "brick"
shape = { box = { size = [1, 2, 3] } }
density = 100.0
position = [9, 0, 9]
group = "pins"
collides_with = ["hills", "pins"]

[[block]]
name = "ramp"
shape = { box = { size = [2, 1, 0.2] } }
orientation = { pitch_deg = 20 }

[[terrain]]
name = "hills"
height = "sin(x) * y"

[[terrain]]
name = "dunes"
heights = [[0, 1], [2, 3], [1, 1]]
spacing = [1, 2]
origin = [0, 1]

[[pair]]
between = ["pins", "ramp"]
friction = 0.5
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("properties") / "problem.toml"


def write(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k, ensure_ascii=False)} = {write(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(write(item) for item in value) + "]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def load(path: Path, text: str, changed: dict[str, object] | None = None) -> None:
    path.write_text(text, encoding="utf-8", errors="replace")
    with contextlib.suppress(ProblemError):
        load_problem(path, changed or {}).world()


def places(value: Any, prefix: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every key and index in a nested value."""
    keys = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    return [found for key in keys for found in [(*prefix, key), *places(value[key], (*prefix, key))]]


def put(data: Any, place: tuple[Any, ...], value: Any) -> None:
    for key in place[:-1]:
        data = data[key]
    data[place[-1]] = value


@settings(deadline=None)
@given(st.text(max_size=300))
def test_any_text(path: Path, text: str) -> None:
    load(path, text)


@settings(deadline=None)
@given(content=st.binary(max_size=300))
def test_any_bytes(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with contextlib.suppress(ProblemError):
        load_problem(path)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_a_valid_file_with_any_value_anywhere(path: Path, valid: str, data: st.DataObject) -> None:
    document = copy.deepcopy(tomllib.loads(data.draw(st.sampled_from([valid, SHAPES]))))
    for _ in range(data.draw(st.integers(1, 3))):
        put(document, data.draw(st.sampled_from(places(document))), data.draw(VALUES))
    load(path, "\n".join(f"{key} = {write(value)}" for key, value in document.items()))


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_a_valid_robot_with_any_value_anywhere(path: Path, data: st.DataObject) -> None:
    """In the robot file, in the problem, or in a setting."""
    robot, problem = tomllib.loads(ROBOT), tomllib.loads(MAIN.replace("knee.", "l_knee."))
    problem["include"] = [{"file": "robot.toml", "position": [1, 2, 3], "yaw_deg": 10, "prefix": "l_"}]
    for _ in range(data.draw(st.integers(1, 2))):
        document = data.draw(st.sampled_from([robot, problem]))
        put(document, data.draw(st.sampled_from(places(document))), data.draw(VALUES))
    for name, document in (("robot.toml", robot), ("main.toml", problem)):
        text = "\n".join(f"{key} = {write(value)}" for key, value in document.items())
        (path.parent / name).write_text(text, encoding="utf-8", errors="replace")
    keys = st.lists(st.sampled_from(["include", "body", "0", "file", "l_torso", "mass", "prefix"]), max_size=3)
    changed = data.draw(st.dictionaries(keys.map(".".join), VALUES, max_size=1))
    with contextlib.suppress(ProblemError):
        load_problem(path.parent / "main.toml", changed).world()


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_a_valid_file_with_text_spliced_in(path: Path, valid: str, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(valid)))
    stop = min(len(valid), start + data.draw(st.integers(0, 30)))
    load(path, valid[:start] + data.draw(st.text(max_size=10)) + valid[stop:])


@settings(max_examples=200, deadline=None)
@given(
    key=st.lists(st.sampled_from([*KEYS, "ball", "0", "gradient", "throw", "dt"]) | st.text(max_size=3), max_size=5),
    value=VALUES,
)
def test_any_setting(path: Path, valid: str, key: list[str], value: object) -> None:
    load(path, valid, {".".join(key): value})


@pytest.mark.slow
@pytest.mark.parametrize("shapes", [False, True])
def test_the_rewritten_file_is_the_same(path: Path, valid: str, shapes: bool) -> None:
    original = SHAPES if shapes else valid
    text = "\n".join(f"{key} = {write(value)}" for key, value in tomllib.loads(original).items())
    assert tomllib.loads(text) == tomllib.loads(original)
    path.write_text(text)
    load_problem(path)
