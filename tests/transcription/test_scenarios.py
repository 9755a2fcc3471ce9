"""Domain randomization: draws keep their bounds and joints, and evaluations are those of files with their numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tools.repeats import first

from symphys.dynamics.observation import gap_function
from symphys.dynamics.observation.joint_coordinates import readings
from symphys.model.state_layout import initial_state
from symphys.problem import Problem, load_problem
from symphys.shooting import ScenarioSamples
from symphys.transcription import Transcription, transcribe
from symphys.transcription.sampler import Sampler
from symphys.types import Array

pytestmark = pytest.mark.slow

WALKER = """
[simulation]
duration = 0.4
dt = 0.01
sweeps = 4
cuts = 0
[[body]]
name = "torso"
shape = { box = { size = [0.4, 0.2, 0.1] } }
mass = 5
position = [0, 0, 0.6]
collides_with = []
[[body]]
name = "leg"
shape = { sphere = { radius = 0.05 } }
mass = 1
position = [0, 0, 0.3]
[[joint]]
name = "hip"
between = ["torso", "leg"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0.55]
start = 0.2
motor = { servo = { gain = 20, torque = 30, velocity = 8 } }
[ground]
height = 0.252
friction = 0.5
[fall]
margin = "torso.position[2] - 0.5"
[[variable]]
name = "command"
sets = "hip.command"
knots = 2
[[cost]]
name = "far"
value = "-torso.position[0]"
[[scenario]]
name = "friction"
sets = "ground.friction"
factor = 0.3
[[scenario]]
name = "masses"
sets = ["torso.mass", "leg.mass"]
factor = 0.1
[[scenario]]
name = "push"
sets = "torso.force[0:2]"
shift = [30, 20]
lasts = 0.1
[[scenario]]
name = "pose"
robot = "torso"
tilt = 0.2
joints = 0.3
velocity = 0.1
[[scenario]]
name = "finer"
simulation = { dt = 0.005 }
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("walker") / "walker.toml"
    path.write_text(WALKER, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def problem(path: Path) -> Problem:
    return load_problem(path)


@pytest.fixture(scope="module")
def walker(problem: Problem) -> Transcription:
    made = transcribe(problem)
    if made.shooting.scenario is None:
        pytest.skip(made.backend.note)
    return made


def columns(sampler: Sampler, rows: Array) -> dict[str, Array]:
    """By the name of what is drawn, (count, k)."""
    own = [v for v in sampler.problem.variables if ":" in v.name]
    ends = np.cumsum([0, *(v.guess.size for v in own)])
    return {v.slots[0].name: rows[:, a:b] for v, a, b in zip(own, ends[:-1], ends[1:], strict=True)}


def test_numbers_keep_their_bounds(problem: Problem) -> None:
    """The first row is the file's, the others spread over what the tables say, twice as wide where asked."""
    sampler = Sampler(problem)
    for width in (1.0, 2.0):
        drawn = columns(sampler, sampler.draw(np.random.default_rng(0), 400, width))
        friction, masses = drawn["ground.friction"][:, 0], drawn["torso.mass"][:, 0] / 5
        assert (friction[0], masses[0]) == (0.5, 1)
        for numbers, middle, spread in ((friction, 0.5, 0.15), (masses, 1, 0.1)):
            off = np.abs(numbers - middle).max()
            assert 0.9 * width * spread < off <= width * spread + 1e-12
        assert abs(np.corrcoef(masses[1:], drawn["leg.mass"][1:, 0])[0, 1]) < 0.2


def test_pushes_act_for_their_time(problem: Problem) -> None:
    sampler = Sampler(problem)
    force = columns(sampler, sampler.draw(np.random.default_rng(0), 200, 1.0))["torso.force"].reshape(200, -1, 2)
    acts = (force != 0).any(axis=2)
    assert not acts[0].any()
    assert np.all(acts[1:].sum(axis=1) == 10)
    assert np.all(np.abs(np.diff(acts[1:].astype(int), axis=1)).sum(axis=1) <= 2)
    assert len(set(np.argmax(acts[1:], axis=1))) > 20
    assert np.abs(force[..., 0]).max() > 25 > 20 >= np.abs(force[..., 1]).max()


def test_pushes_act_as_long_on_a_finer_grid(problem: Problem) -> None:
    """From the same instants."""
    assert problem.scenarios is not None
    (grid,) = problem.scenarios.discretisations
    coarse, fine = (
        columns(sampler, sampler.draw(np.random.default_rng(0), 50, 1.0))["torso.force"].reshape(50, -1, 2)[1:]
        for sampler in (Sampler(problem), Sampler(replace(problem, simulation=grid.simulation)))
    )
    sums = [force.sum(axis=1) * dt for force, dt in ((coarse, 0.01), (fine, 0.005))]
    assert np.allclose(*sums, rtol=1e-12)
    begins = [np.argmax((force != 0).any(axis=2), axis=1) * dt for force, dt in ((coarse, 0.01), (fine, 0.005))]
    assert np.abs(begins[0] - begins[1]).max() <= 0.01 + 1e-12


def test_draws_stay_physical(problem: Problem) -> None:
    """However wide: friction and masses never below what files may say."""
    drawn = columns(sampler := Sampler(problem), sampler.draw(np.random.default_rng(0), 500, 20.0))
    assert drawn["ground.friction"].min() >= 0
    assert drawn["torso.mass"].min() >= 5e-3


@first("count", [15, 60])
def test_poses_hold_together_and_touch_nothing(problem: Problem, count: int) -> None:
    """Joints at their drawn angles, without a gap; lifted only where the robot would be in the ground."""
    sampler, world = Sampler(problem), problem.world()
    drawn = columns(sampler, sampler.draw(np.random.default_rng(1), count, 1.0))
    angles, lifted = [], 0
    for k in range(count):
        values = {name: value[k] for name, value in drawn.items() if name in problem.initial}
        x = initial_state(world, values)
        (reading,) = readings(world, x).values()
        assert float(reading.separation) < 1e-12
        angles.append(float(reading.value))
        gap = float(np.min(np.array(gap_function(world)(x))))
        assert gap > -1e-12
        lifted += gap < 1e-12
        spin = [values[f"{body}.velocity"] for body in ("torso", "leg")]
        assert np.array_equal(*spin) and np.abs(spin[0]).max() <= 0.1
    assert angles[0] == pytest.approx(0.2, abs=1e-12)
    assert np.abs(np.array(angles) - 0.2).max() <= 0.3 and np.ptp(angles) > 0.5
    assert count / 12 < lifted < count - count / 12


@pytest.mark.slow
def test_evaluations_are_those_of_the_numbers_in_a_file(walker: Transcription, path: Path) -> None:
    """Values and gradients of rows against files with the same numbers."""
    scenario = walker.shooting.scenario
    assert scenario is not None
    z, drawn = np.array([[0.3, -0.2]]), scenario.draw(np.random.default_rng(2), 3)
    numbers = columns(Sampler(walker.problem), drawn.numbers)
    numbers["torso.force"][:] = 0
    found = scenario.gradient(z, ScenarioSamples(0, np.concatenate(list(numbers.values()), axis=1)), 0.0)
    assert found.gradient is not None
    for k in range(3):
        settings = {
            "ground.friction": float(numbers["ground.friction"][k, 0]),
            **{f"body.{body}.mass": float(numbers[f"{body}.mass"][k, 0]) for body in ("torso", "leg")},
        }
        loaded = load_problem(path, settings)
        posed = {name: numbers[name][k] if name in numbers else value for name, value in loaded.initial.items()}
        made = transcribe(replace(loaded, initial=posed, scenarios=None), backend="casadi")
        alone = made.shooting.evaluator.gradient(z, 0.0)
        assert alone.gradient is not None
        assert found.merit[k] == pytest.approx(alone.merit[0], rel=1e-10)
        assert found.gradient[k] == pytest.approx(alone.gradient[0], rel=1e-7)
    assert np.ptp(found.merit) > 1e-3


def test_pushes_push(walker: Transcription) -> None:
    """Sideways, with the force that was drawn."""
    scenario = walker.shooting.scenario
    assert scenario is not None
    drawn = scenario.draw(np.random.default_rng(2), 30)
    force = columns(Sampler(walker.problem), drawn.numbers)["torso.force"].reshape(30, -1, 2)
    quiet = ScenarioSamples(0, drawn.numbers.copy())
    columns(Sampler(walker.problem), quiet.numbers)["torso.force"][:] = 0
    z = np.zeros((1, 2))
    far = [-scenario.value(z, each, 0.0).merit for each in (drawn, quiet)]
    ahead = force[..., 0].sum(axis=1)
    strong = np.abs(ahead) > 100
    assert strong.sum() > 5
    assert np.array_equal(np.sign((far[0] - far[1])[strong]), np.sign(ahead[strong]))


def test_the_problem_itself_is_the_first(walker: Transcription) -> None:
    """On every grid; a finer one has nearly the same answer, and the plain evaluator the same to the bit."""
    scenario = walker.shooting.scenario
    assert scenario is not None
    z = np.array([[0.3, -0.2]])
    first, finer = (scenario.gradient(z, scenario.draw(np.random.default_rng(0), 2, 1.0, grid), 0.0) for grid in (0, 1))
    alone = walker.shooting.evaluator.gradient(z, 0.0)
    assert first.merit[0] == alone.merit[0] and first.gradient is not None and alone.gradient is not None
    assert np.array_equal(first.gradient[0], alone.gradient[0])
    assert first.merit[0] == pytest.approx(walker.judge(z[0]).objective, rel=1e-12)
    assert finer.merit[0] != first.merit[0]
    assert finer.merit[0] == pytest.approx(first.merit[0], rel=0.1, abs=0.01)


def test_discount_and_termination(walker: Transcription) -> None:
    """Shorter adjoints far from the end; what has fallen says so."""
    scenario = walker.shooting.scenario
    assert scenario is not None
    drawn = scenario.draw(np.random.default_rng(3), 8)
    exact, discounted = (scenario.gradient(np.zeros((1, 2)), drawn, 0.0, discount) for discount in (0.0, 50.0))
    assert exact.gradient is not None and discounted.gradient is not None
    assert np.linalg.norm(discounted.gradient[:, 0]) < 0.1 * np.linalg.norm(exact.gradient[:, 0])
    assert exact.alive is not None
    assert set(exact.alive) == {0.0, 1.0} or set(exact.alive) == {1.0}


def test_without_kernels_there_are_none(problem: Problem) -> None:
    """It is said, and the rest works."""
    made = transcribe(problem, backend="casadi")
    assert made.shooting.scenario is None
    assert "no samples of scenarios" in made.backend.note
    assert np.isfinite(made.shooting.evaluator.value(np.zeros((1, 2)), 0.0).merit).all()


@pytest.mark.thorough
def test_a_shorter_horizon_is_a_shorter_motion(walker: Transcription, path: Path) -> None:
    """The gradient is that of a file with less duration, in which both knots act together."""
    scenario = walker.shooting.scenario
    assert scenario is not None
    z, simulation = np.array([[0.3, 0.3]]), walker.problem.simulation
    shorter = transcribe(replace(walker.problem, simulation=replace(simulation, duration=simulation.duration / 2)))
    assert shorter.shooting.scenario is not None
    nominal = [each.draw(np.random.default_rng(0), 1) for each in (scenario, shorter.shooting.scenario)]
    short = scenario.gradient(z, nominal[0], 0.0, horizon=simulation.duration / 2)
    alone = shorter.shooting.scenario.gradient(z, nominal[1], 0.0)
    assert short.gradient is not None and alone.gradient is not None
    assert short.gradient[0] == pytest.approx([alone.gradient.sum(), 0], rel=1e-9)
