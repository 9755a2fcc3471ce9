"""Problems of so many bodies that their steps find the pairs that are near, against those that list all pairs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import thorough
from worlds.toys import require

import symphys
from symphys import Body, Law, Plane, Problem, make_world
from symphys.errors import ProblemError, SymphysError
from symphys.export.mjcf import problem_model
from symphys.problem import load_problem
from symphys.problem.parametric import meetings
from symphys.transcription import transcribe
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.transcription import Transcription
from symphys.verification.examination import examine, survey

pytestmark = pytest.mark.slow

BALLS = 5
TABLES = """
[simulation]
duration = 0.3
dt = 0.01
[contact]
friction = 0.3
restitution = 0.6
[ground]
[[plane]]
name = "wall"
normal = [1, 0, 0]
offset = -1.0
[[variable]]
name = "kick"
sets = ["b0.velocity", "b3.velocity"]
guess = [0.9, 0.1, -1.0]
[[variable]]
name = "place"
sets = "b1.position[2]"
guess = 0.12
[[target]]
name = "there"
value = "b4.position - [1, 0, 0.1] - 0.1 * b1.velocity"
tolerance = 0.1
[[cost]]
name = "rolls"
value = "dot(b2.velocity, b2.velocity)"
at = "always"
[[constraint]]
name = "low"
value = "b0.position[2]"
upper = 0.3
at = "always"
tolerance = 0.1
[[output]]
name = "height"
value = "b3.position[2]"
"""
SPHERE = """
[[body]]
name = "b{0}"
shape = {{ sphere = {{ radius = 0.1 }} }}
mass = 1.0
position = [{1}, 0.02, 0.15]
"""


def file_of(folder: Path, more: str = "", balls: int = BALLS, tables: str = TABLES) -> Path:
    """Of balls in a row."""
    path = folder / "row.toml"
    path.write_text(tables + "".join(SPHERE.format(i, round(0.25 * i, 2)) for i in range(balls)) + more)
    return path


def found(path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The problem of a file, whose few pairs count as many."""
    monkeypatch.setattr(meetings, "MOST_POINTS", 9)
    problem = load_problem(path)
    monkeypatch.undo()
    return problem


LAWS = {
    "rigid": "restitution = 0.6",
    "soft": "frequency = 30\ndamping = 0.3",
    "rolling": "restitution = 0.6\ntorsion = 0.01\nrolling = 0.005",
}


@pytest.fixture(scope="module", params=["rigid", thorough("soft"), thorough("rolling")])
def pair(request: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Transcription, Transcription]:
    """Of pairs that are found, and of a list."""
    require("simd")
    tables = TABLES.replace(LAWS["rigid"], LAWS[request.param])
    path = file_of(tmp_path_factory.mktemp("row"), tables=tables)
    with pytest.MonkeyPatch.context() as patch:
        near = transcribe(found(path, patch), threads=2)
    return near, transcribe(load_problem(path), exact=True, backend="simd", threads=1)


@pytest.mark.slow
def test_pairs_are_found_or_listed(pair: tuple[Transcription, Transcription]) -> None:
    near, listed = pair
    assert (len(near.rollout.world.pairs), len(listed.rollout.world.pairs)) == (0, 20)
    assert "finds the pairs" in str(near.backend)


@pytest.mark.slow
def test_values_and_gradients_are_those_of_the_list(pair: tuple[Transcription, Transcription]) -> None:
    Z = np.array([pair[1].shooting.start(seed) for seed in range(5)])
    here, there = (made.shooting.evaluator.gradient(Z, 0.0) for made in pair)
    for name in ("merit", "objective", "errors", "outputs"):
        np.testing.assert_allclose(getattr(here, name), getattr(there, name), rtol=1e-12, atol=1e-14)
    assert here.gradient is not None and there.gradient is not None
    np.testing.assert_allclose(here.gradient, there.gradient, atol=1e-7 * np.abs(there.gradient).max())
    plain = pair[0].shooting.evaluator.value(Z, 0.0)
    np.testing.assert_array_equal(plain.merit, here.merit)
    np.testing.assert_array_equal(pair[0].shooting.evaluator.value(Z[2:3], 0.0).merit, here.merit[2:3])


@pytest.mark.slow
def test_the_judge_and_the_motion_are_those_of_the_list(pair: tuple[Transcription, Transcription]) -> None:
    z = pair[1].shooting.start(3)
    one, other = (made.judge(z) for made in pair)
    assert one.objective == pytest.approx(other.objective, rel=1e-12)
    assert one.costs == pytest.approx(other.costs, rel=1e-12)
    assert [check.name for check in one.checks] == [check.name for check in other.checks] == ["there", "low"]
    near, listed = (made.record(z).motion for made in pair)
    np.testing.assert_allclose(near.position, listed.position, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(near["b1.velocity"], listed["b1.velocity"], rtol=1e-10, atol=1e-12)
    assert near.contact_names == () and near.contact_force.shape == (30, 0, 3)
    np.testing.assert_allclose(pair[0].probe.gradient(z), pair[1].probe.gradient(z), rtol=1e-6, atol=1e-7)


def test_what_is_not_known_is_told(pair: tuple[Transcription, Transcription]) -> None:
    near, z = pair[0], pair[0].shooting.start(0)
    record = near.record(z)
    with pytest.raises(SymphysError, match="smoothed"):
        near.simulate(z, 0.1)
    with pytest.raises(SymphysError, match="whole motions"):
        near.back(record, np.eye(3))
    for function in ("step", "report"):
        with pytest.raises(ProblemError, match="body: "):
            getattr(near.rollout, function)
    with pytest.raises(ProblemError, match="body: "):
        symbolic_rollout(near.problem)
    assert survey(near, record) == {}


@pytest.mark.slow
def test_the_examination_compares_gradients_and_finer_steps(pair: tuple[Transcription, Transcription]) -> None:
    told = examine(pair[0], pair[0].shooting.start(0))
    assert set(told) == {"gradient", "refined", "order", "bounds"}
    assert [row["variable"] for row in told["gradient"]] == ["kick", "place"]
    assert all(row["error"] < 1e-5 for row in told["gradient"])
    assert [row["what"] for row in told["refined"]] == ["dt / 2", "dt / 4", "sweeps x 2"]


@pytest.mark.parametrize(
    "more, named",
    [
        ('[[variable]]\nname = "m"\nsets = "b0.mass"\nguess = 1.0', 'variable "m".sets: has no place'),
        (
            '[[variable]]\nname = "f"\nsets = "b0.force"\nguess = [0, 0, 0]\nknots = 3',
            'variable "f".sets: has no place',
        ),
    ],
)
def test_only_starts_may_vary(more: str, named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ProblemError, match=named):
        transcribe(found(file_of(tmp_path, more), monkeypatch))


def test_smoothing_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tables = TABLES.replace("dt = 0.01\n", "dt = 0.01\nsmoothing = [0.1, 0]\n")
    with pytest.raises(ProblemError, match=r"simulation\.smoothing: .*0"):
        transcribe(found(file_of(tmp_path, tables=tables), monkeypatch))


@pytest.mark.parametrize(
    "more, why",
    [
        ('[[pair]]\nbetween = ["b0", "b1"]\nfriction = 0.1', r"there is a \[\[pair\]\], "),
        ('[[joint]]\nname = "j"\nball = {}\nbetween = ["b0", "b1"]\npoint = [0.1, 0, 0.15]', "there is a joint, j"),
        ('[[block]]\nname = "step"\nshape = { box = { size = [1, 1, 1] } }\nposition = [5, 0, 0]', "step is no plane"),
        (
            SPHERE.format("tun", 90).replace("sphere = { radius", "cylinder = { length = 0.2, radius"),
            "btun is no sphere, capsule or box",
        ),
        (
            SPHERE.format("light", 90).replace("mass = 1.0", "mass = 0.01"),
            "b0 has more than 20 times the mass of blight",
        ),
        (SPHERE.format("soft", 90) + "restitution = 0.1", "contacts have different laws"),
        (SPHERE.format("shy", 90) + 'collides_with = ["ground"]', "bshy has collides_with"),
    ],
)
def test_worlds_of_another_kind_keep_their_limit(more: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=f"points of contact .*{why}"):
        load_problem(file_of(tmp_path, more, balls=80))


@pytest.mark.slow
def test_others_programs_get_a_list(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A model for MuJoCo has all pairs; C has none to give."""
    problem = found(file_of(tmp_path), monkeypatch)
    assert (
        problem_model(problem, approximate=True).text.count("<pair ")
        == len(load_problem(file_of(tmp_path)).world().pairs)
        == 20
    )
    with pytest.raises(ProblemError, match="body: "):
        symphys.export(problem, c=tmp_path / "c")


@pytest.mark.slow
def test_a_hundred_balls_from_python() -> None:
    """They fall onto the ground, as one does, and lie still."""
    require("simd")
    places = [(0.3 * (i % 10), 0.3 * (i // 10), 0.1 + 0.001 * i) for i in range(100)]
    bodies = [Body.ball(f"b{i}", radius=0.1, mass=1.0, position=place) for i, place in enumerate(places)]
    world = make_world(bodies, [Plane.ground()], Law(restitution=0.0))
    assert len(world.pairs) == 5050
    motion = symphys.simulate(Problem.from_world(world, duration=0.3))
    fall = places[99][2] - 0.5 * 9.81 * motion.time[:10] ** 2
    np.testing.assert_allclose(motion["b99.position"][:10, 2], fall, atol=1e-12)
    np.testing.assert_allclose(motion.position[-1], [[x, y, 0.1] for x, y, _ in places], atol=1e-9)
    np.testing.assert_allclose(motion.velocity[-1], 0, atol=1e-9)
