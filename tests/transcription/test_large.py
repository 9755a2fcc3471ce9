"""Large nets, by matrix products between steps, do what the same nets do within the compiled step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from fakes.emulated import Remote, needs_compiler
from tools.repeats import thorough
from worlds.monopod import MONOPOD

from symphys import solve
from symphys.errors import ProblemError
from symphys.export.writing import export_problem
from symphys.problem import load_problem
from symphys.problem.sweeps.points import combined, swept
from symphys.problem.sweeps.reading import read_axes
from symphys.shooting import ScenarioEvaluator
from symphys.transcription import Transcription, transcribe
from symphys.transcription.network_rollout import LargeEvaluator, LargeTranscription, layers, require_small_nets
from symphys.transcription.network_rollout import evaluator as evaluators
from symphys.transcription.network_rollout import partition as split
from symphys.transcription.recorded_rollout import record_rollout
from symphys.types import Array
from symphys.verification import examine
from symphys.verification.examination import compare_gradient
from symphys.verification.sensitivity_growth import sensitivity_growth

pytestmark = pytest.mark.slow


HOPPING = (
    """
[simulation]
duration = 0.3
dt = 0.01
sweeps = 4
smoothing = 0.02
"""
    + MONOPOD
    + """
[[sensor]]
name = "body"
reads = ["torso.position", "torso.accelerometer", "leg.command"]

[[sensor]]
name = "leg_state"
reads = ["leg.position", "leg.rate", "sin(9 * time)", "foot.contact_force[2]"]

[[controller]]
name = "brain"
drives = "leg.command"
senses = ["leg_state", "body"]
scale = 0.3
net = { hidden = [6, 5], output = "tanh", ACTIVATION }

[[controller]]
name = "other"
drives = "leg.command"
senses = ["leg_state"]
net = { hidden = [4], skip = true, biases = false, activation = "relu" }

[[controller]]
name = "small"
drives = "leg.command"
senses = ["leg_state"]
linear = { gains = [[0.1, 0.01, 0, 0]] }

[[variable]]
name = "weights"
sets = "brain.weights"

[[variable]]
name = "gains"
sets = "small.gains"

[[variable]]
name = "start"
sets = "torso.velocity"
guess = [0.1, 0, 0.2]

[[cost]]
name = "effort"
at = "always"
squares = "[leg.torque, start]"
weight = 0.01

[[cost]]
name = "middle"
at = 0.25
value = "foot.position[0] * leg.command"

[[target]]
name = "there"
value = "torso.position - [0.2, 0, 0.7]"
tolerance = 0.1
"""
)


LIFTED = """
[simulation]
duration = 0.2
dt = 0.01
smoothing = 0.02

[[body]]
name = "bob"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 0.15]

[[joint]]
name = "rail"
between = ["world", "bob"]
slider = { axis = [0, 0, 1] }
motor = { servo = { gain = 20, torque = 40, velocity = 3 } }

[[sensor]]
name = "state"
reads = ["rail.position", "rail.rate", "sin(9 * time)"]

[[controller]]
name = "brain"
drives = "rail.command"
senses = ["state"]
net = { hidden = [6, 5], ACTIVATION }

[[variable]]
name = "weights"
sets = "brain.weights"

[[variable]]
name = "start"
sets = "bob.velocity[2]"
guess = 0.2

[[cost]]
name = "height"
at = "always"
squares = "rail.torque"
weight = 0.01

[[target]]
name = "there"
value = "bob.position[2] - 0.3"
tolerance = 0.1
"""
"""The least that a net can move: a ball on a rail."""
FORMS = ("skip = true", 'activation = "tanh"', 'activation = "relu", biases = false')
HOPS, LIFTS = ([text.replace("ACTIVATION", form) for form in FORMS] for text in (HOPPING, LIFTED))
"""Each with nets of each form."""

ASKED = (
    LIFTS[1]
    + """
[[force]]
name = "air"
on = "bob.force[2]"
value = "-2 * bob.velocity[2] + way.z"

[[reference]]
name = "way"
table = { time = [0, 0.1, 0.2], z = [0, 1, 0.5] }

[[phase]]
name = "first"
share = 0.3
sets = { gravity = [0, 0, -5], "rail.gain" = 10, "rail.torque" = 30 }

[[cost]]
name = "in the first"
during = "first"
squares = "bob.velocity[2] - way.z"

[[cost]]
name = "whole"
value = "integral(bob.velocity[2]**2) / (1 + end.bob.position[2] - start.bob.position[2])"
"""
)
"""With a force law, a reference, a phase, and parts of the whole motion."""


FREE = (
    LIFTS[1]
    + """
[[variable]]
name = "T"
sets = "simulation.duration"
lower = 0.1
upper = 0.5

[[cost]]
name = "soon"
value = "T + integral(bob.velocity[2]**2)"

[[force]]
name = "air"
on = "bob.force[2]"
value = "-2 * bob.velocity[2] + sin(20 * time)"
"""
)
"""With a duration that a variable sets, and sensors and forces that look at the time."""

SAMPLED = (
    LIFTS[1]
    + """
[termination]
margin = "bob.position[2] - 0.14"

[[scenario]]
name = "mass"
sets = "bob.mass"
factor = 0.3

[[scenario]]
name = "push"
sets = "bob.force[2]"
shift = 100
lasts = 0.05

[[scenario]]
name = "finer"
simulation = { dt = 0.005 }
"""
)
"""Samples of scenarios, some of which end before their time."""


def problems(*texts: str) -> pytest.MarkDecorator:
    """The last of these problems in every run, all with ``make test-all``, the other hops with ``make thorough``."""
    others = (thorough(text) for text in HOPS if text not in texts)
    texts = (*(pytest.param(text, marks=pytest.mark.slow) for text in texts[:-1]), texts[-1])  # type: ignore[assignment]
    return pytest.mark.parametrize("both", [*texts, *others], indirect=True, ids=named, scope="module")


def named(text: str) -> str:
    """A problem by what moves and its net's form."""
    form = next(form for form in FORMS if f", {form} }}" in text.partition('name = "other"')[0])
    kind = "hop" if text in HOPS else {ASKED: "asked", FREE: "free"}.get(text, "lift")
    return f"{kind}-{form}"


@pytest.fixture(scope="module")
def both(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Transcription, LargeTranscription]]:
    """The same problem with its nets in the step, and beside it."""
    path = tmp_path_factory.mktemp("large") / "large.toml"
    path.write_text(request.param)
    within = transcribe(load_problem(path), backend="casadi")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(split, "MAX_STEP_WEIGHTS", 10)
        beside = transcribe(load_problem(path))
        assert isinstance(beside, LargeTranscription)
        yield within, beside


@pytest.fixture(scope="module")
def examined(both: tuple[Transcription, LargeTranscription]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What ``check`` finds of both, near the guess."""
    z = points(both[0])[0]
    return examine(both[0], z), examine(both[1], z)


def points(context: Transcription) -> Array:
    """(2, n) near the guess."""
    start = context.shooting.start(0)
    return start + 0.05 * np.random.default_rng(5).standard_normal((2, start.size))


@problems(HOPS[0], *LIFTS[1:], FREE, ASKED)
@pytest.mark.parametrize("smoothing", [0.0, 0.05])
def test_values_and_gradients(both: tuple[Transcription, LargeTranscription], smoothing: float) -> None:
    """To rounding, which impacts amplify, whatever the length of segments, and how much is computed again."""
    within, beside = both
    Z = points(within)
    a = within.shooting.evaluator.gradient(Z, smoothing)
    assert a.gradient is not None
    for columns, kept in ((1, 1), (4, 150), (layers.SEGMENT_COLUMNS, evaluators.MAX_KEPT_NUMBERS)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(layers, "SEGMENT_COLUMNS", columns)
            patch.setattr(evaluators, "MAX_KEPT_NUMBERS", kept)
            b = beside.shooting.evaluator.gradient(Z, smoothing)
        assert b.gradient is not None
        assert np.allclose(a.merit, b.merit, rtol=1e-12)
        assert np.allclose(a.errors, b.errors, rtol=1e-12)
        assert np.allclose(a.gradient, b.gradient, rtol=1e-7, atol=1e-8 * np.abs(a.gradient).max())
    alone = beside.shooting.evaluator.value(Z, smoothing)
    assert np.allclose(a.merit, alone.merit, rtol=1e-12) and np.allclose(a.errors, alone.errors, rtol=1e-12)


@pytest.mark.slow
@problems(HOPS[0])
def test_gradient_by_differences(both: tuple[Transcription, LargeTranscription]) -> None:
    """Of a leg that lands on its foot, by weights and start."""
    found = compare_gradient(both[1], points(both[1])[0])
    assert len(found) == 3
    assert max(row["error"] for row in found) < 1e-6


@pytest.mark.slow
@problems(HOPS[0])
def test_robots_share_weights(both: tuple[Transcription, LargeTranscription], monkeypatch: pytest.MonkeyPatch) -> None:
    """Many robots at once, over threads: each one's own gradient, and the sum of those of the weights."""
    beside = both[1]
    evaluator = beside.shooting.evaluator
    assert isinstance(evaluator, LargeEvaluator)
    parts = evaluator.context.partition
    z = points(beside)[0]
    Z = np.tile(z[parts.small], (19, 1)) + 0.01 * np.random.default_rng(1).standard_normal((19, len(parts.small)))
    whole = np.tile(z, (19, 1))
    whole[:, parts.small] = Z
    alone = evaluator.gradient(whole, 0.0)
    weights = [own.at(z) for own in parts.weights]
    monkeypatch.setattr(evaluator, "threads", 2)
    shared = evaluator.shared(weights, Z, gradient=True)
    assert alone.gradient is not None and shared.small is not None and shared.weights is not None
    assert np.allclose(shared.merit, alone.merit, rtol=1e-12)
    assert np.allclose(shared.small, alone.gradient[:, parts.small], rtol=1e-7, atol=1e-8)
    total = np.zeros(parts.n)
    for own, slope in zip(parts.weights, shared.weights, strict=True):
        own.add(total, slope)
    expected = alone.gradient.sum(axis=0)
    expected[parts.small] = 0
    assert np.allclose(total, expected, rtol=1e-7, atol=1e-8 * np.abs(expected).max())


@problems(HOPS[0])
def test_judge_and_motion(both: tuple[Transcription, LargeTranscription]) -> None:
    """Casadi's rollouts of both agree, motion and contacts included."""
    within, beside = both
    z = points(within)[0]
    a, b = within.judge(z), beside.judge(z)
    assert a.objective == pytest.approx(b.objective, rel=1e-12)
    motions = [context.simulate(z).arrays() for context in both]
    for name, values in motions[0].items():
        if values.dtype.kind == "f":
            assert np.allclose(values, motions[1][name], rtol=1e-9, atol=1e-9, equal_nan=True), name


@pytest.mark.slow
@problems(LIFTS[0])
def test_examination(
    both: tuple[Transcription, LargeTranscription], examined: tuple[dict[str, Any], dict[str, Any]]
) -> None:
    """``check`` says the same of both: gradient, refinements, growth through the nets, energy."""
    a, b = examined
    assert max(row["error"] for row in b["gradient"]) < 1e-6
    assert [row["scale"] for row in b["gradient"]] == pytest.approx([row["scale"] for row in a["gradient"]], rel=1e-7)
    for one, other in zip(a["refined"], b["refined"], strict=True):
        assert one["objective"] == pytest.approx(other["objective"], rel=1e-9)
        assert one["gradient"].keys() == other["gradient"].keys()
        for name, change in one["gradient"].items():
            assert change == other["gradient"][name] or change == pytest.approx(other["gradient"][name], rel=1e-6)
    assert b["growth"]["factor"] == pytest.approx(a["growth"]["factor"], rel=1e-7)
    assert b["energy"]["contact"] == pytest.approx(a["energy"]["contact"], abs=1e-9)
    assert (b["fault"], b["smoothed"]) == ("", [pytest.approx(row) for row in a["smoothed"]])


@pytest.mark.slow
@problems(HOPS[0])
def test_single_precision_of_nets(both: tuple[Transcription, LargeTranscription]) -> None:
    """Nets in single precision cost six digits, not more."""
    beside = both[1]
    single = transcribe(beside.problem, backend="simd32")
    Z = points(beside)
    a, b = (context.shooting.evaluator.gradient(Z, 0.0) for context in (beside, single))
    assert a.gradient is not None and b.gradient is not None
    assert np.allclose(a.gradient, b.gradient, atol=1e-4 * np.abs(a.gradient).max())
    assert not np.array_equal(a.gradient, b.gradient)


@pytest.mark.slow
@needs_compiler
@problems(LIFTS[0])
def test_nets_on_a_device(
    both: tuple[Transcription, LargeTranscription],
    examined: tuple[dict[str, Any], dict[str, Any]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Steps by a device's kernel, products by its library, on arrays that stay there: the same numbers and trust."""
    monkeypatch.setattr("symphys.codegen.cuda.find_gpu", lambda: Remote(tmp_path))
    beside = both[1]
    there = transcribe(beside.problem, backend="cuda")
    assert (there.backend.name, there.backend.note) == ("cuda", "nets by matrix products")
    Z = points(beside)
    a, b = (context.shooting.evaluator.gradient(Z, 0.0) for context in (beside, there))
    assert a.gradient is not None and b.gradient is not None
    assert np.array_equal(a.merit, b.merit)
    assert np.allclose(a.gradient, b.gradient, rtol=0, atol=1e-11 * np.abs(a.gradient).max())
    assert max(row["error"] for row in compare_gradient(there, Z[0])) < 1e-6
    growth = sensitivity_growth(there, there.record(Z[0]))
    assert growth["factor"] == pytest.approx(examined[1]["growth"]["factor"], rel=1e-7)


@pytest.mark.slow
@needs_compiler
@problems(LIFTS[0])
def test_a_device_that_cannot_multiply(
    both: tuple[Transcription, LargeTranscription], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The processor does, with what it wants in a note."""

    class Poor(Remote):
        def lacks(self) -> str:
            return "no cuBLAS"

    monkeypatch.setattr("symphys.codegen.cuda.find_gpu", lambda: Poor(tmp_path))
    there = transcribe(both[1].problem, backend="cuda")
    assert (there.backend.name, there.backend.note) == (
        "cuda",
        "nets by matrix products, which the processor computes: no cuBLAS",
    )
    Z = points(both[1])
    a, b = (context.shooting.evaluator.gradient(Z, 0.0) for context in (both[1], there))
    assert a.gradient is not None and b.gradient is not None
    assert np.array_equal(a.merit, b.merit)
    assert np.allclose(a.gradient, b.gradient, rtol=0, atol=1e-11 * np.abs(a.gradient).max())


def test_formulas_may_read_the_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The step has such a net, unless it is huge: that is refused, as it is in exported code."""
    path = tmp_path / "hopping.toml"
    path.write_text(
        HOPPING.replace("ACTIVATION", "skip = true").replace('"[leg.torque, start]"', '"[leg.torque, weights]"')
    )
    problem = load_problem(path)
    monkeypatch.setattr(split, "MAX_STEP_WEIGHTS", 1000)
    made = transcribe(problem, backend="casadi")
    z = made.shooting.start(0)[None]
    within = made.shooting.evaluator.gradient(z, 0.0)
    monkeypatch.setattr(split, "MAX_STEP_WEIGHTS", 10)
    beside = transcribe(problem, backend="casadi").shooting.evaluator.gradient(z, 0.0)
    assert within.gradient is not None and beside.gradient is not None
    assert np.allclose(beside.merit, within.merit, rtol=1e-12)
    assert np.allclose(beside.gradient, within.gradient, rtol=0, atol=1e-9 * np.abs(within.gradient).max())
    monkeypatch.setattr(split, "MAX_COMPILED_WEIGHTS", 20)
    with pytest.raises(ProblemError, match=r'cost "effort": looks at weights, .* up to 20, and there are \d+'):
        transcribe(problem)
    with pytest.raises(ProblemError, match=r'controller "brain"\.net: .*20'):
        require_small_nets(problem, "export")


def test_solvers_by_steps_take_nets_whose_weights_are_fixed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They find the same, to rounding, whether the net is large; with weights that vary they say what to take."""
    path = tmp_path / "fixed.toml"
    fixed = HOPPING.replace("ACTIVATION", "skip = true").replace('sets = "brain.weights"', 'sets = "other.weights"')
    path.write_text(fixed)
    problem = load_problem(path)
    monkeypatch.setattr(split, "MAX_STEP_WEIGHTS", 1000)
    within = solve(problem, "ilqr", backend="casadi", iterations=4)
    monkeypatch.setattr(split, "MAX_STEP_WEIGHTS", 30)
    beside = solve(problem, "ilqr", backend="casadi", iterations=4)
    assert isinstance(transcribe(problem, backend="casadi"), LargeTranscription)
    known, found = ([stage.objective for stage in each.run.stages] for each in (within, beside))
    assert beside.run.iterations == 4 and found == pytest.approx(known, rel=1e-6)
    path.write_text(HOPPING.replace("ACTIVATION", "skip = true"))
    assert transcribe(load_problem(path), backend="casadi").shooting.staged is None


def test_quantities_and_exported_functions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a large net: the step itself has it there, with the same objective and gradient."""
    path = tmp_path / "large.toml"
    path.write_text(LIFTS[1])
    problem = load_problem(path)
    monkeypatch.setattr(split, "MAX_STEP_WEIGHTS", 10)
    beside = transcribe(problem, threads=1)
    assert isinstance(beside, LargeTranscription)
    Z = points(beside)
    known = beside.shooting.evaluator.gradient(Z, 0.0)
    assert known.gradient is not None
    recorded = record_rollout(problem, ["bob.position"], 0.0, "simd", 1)
    value, quantities = recorded.forward(Z)
    slopes = recorded.pull(Z, np.ones(2), {"bob.position": np.zeros_like(quantities["bob.position"])})
    assert np.allclose(value, known.merit, rtol=1e-12)
    assert np.allclose(slopes, known.gradient, rtol=1e-7, atol=1e-8 * np.abs(known.gradient).max())
    export_problem(problem, casadi=tmp_path / "exported")
    gradient = ca.Function.load(str(tmp_path / "exported" / "gradient.casadi"))
    found = gradient(z=Z[0], smoothing=0.0)
    assert np.allclose(np.array(found["gradient"]).ravel(), known.gradient[0], rtol=1e-7, atol=1e-7)


@pytest.fixture(scope="module")
def sampled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Transcription, Transcription]:
    """A problem with scenarios, with its net in the step, and beside it."""
    path = tmp_path_factory.mktemp("sampled") / "sampled.toml"
    path.write_text(SAMPLED)
    problem = load_problem(path)
    made = []
    for most in (1000, 10):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(split, "MAX_STEP_WEIGHTS", most)
            made.append(transcribe(problem))
    if made[0].shooting.scenario is None:
        pytest.skip(made[0].backend.note)
    return made[0], made[1]


@pytest.mark.parametrize(("discount", "horizon"), [(0.0, np.inf), (20.0, np.inf), (20.0, 0.12)])
@pytest.mark.parametrize("grid", [0, 1])
def test_samples_of_scenarios(
    sampled: tuple[Transcription, Transcription], grid: int, discount: float, horizon: float
) -> None:
    """Values, gradients and what lasted, of each sample, with shorter adjoints and shorter motions too."""
    assert [isinstance(made, LargeTranscription) for made in sampled] == [False, True]
    z = points(sampled[0])[:1]
    found = []
    for made in sampled:
        scenario = made.shooting.scenario
        assert scenario is not None
        drawn = scenario.draw(np.random.default_rng(4), 19, 1.0, grid)
        found.append(scenario.gradient(z, drawn, 0.02, discount, horizon))
    a, b = found
    assert a.gradient is not None and b.gradient is not None and a.alive is not None and b.alive is not None
    assert np.array_equal(a.alive, b.alive) and set(a.alive) == {0.0, 1.0}
    assert np.allclose(a.merit, b.merit, rtol=1e-10) and np.allclose(a.errors, b.errors, rtol=1e-10)
    assert np.allclose(a.gradient, b.gradient, rtol=1e-7, atol=1e-8 * np.abs(a.gradient).max())
    assert np.ptp(a.merit) > 1e-3


def test_points_of_their_own_in_samples(sampled: tuple[Transcription, Transcription]) -> None:
    """As searches by values alone ask: each sample with weights of its own."""
    rng = np.random.default_rng(6)
    Z = points(sampled[0])[0] + 0.1 * rng.standard_normal((5, sampled[0].shooting.n))
    a, b = (
        scenario.value(Z, scenario.draw(np.random.default_rng(4), 5), 0.0) for scenario in map(scenario_of, sampled)
    )
    assert np.allclose(a.merit, b.merit, rtol=1e-10) and np.array_equal(a.alive, b.alive)


def scenario_of(made: Transcription) -> ScenarioEvaluator:
    assert made.shooting.scenario is not None
    return made.shooting.scenario


@pytest.mark.parametrize("text", [LIFTS[1], SAMPLED], ids=["plain", "with scenarios"])
def test_points_of_a_sweep(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has its own numbers, and all have one kernel."""
    path = tmp_path / "sweep.toml"
    path.write_text(text)
    base = load_problem(path)
    found = list(swept(base, combined(None, base, read_axes(("bob.mass=0.8,1.25",))[0])))
    monkeypatch.setattr(split, "MAX_STEP_WEIGHTS", 1000)
    within = [transcribe(replace(problem, scenarios=None, varied=frozenset()), backend="casadi") for problem in found]
    monkeypatch.setattr(split, "MAX_STEP_WEIGHTS", 10)
    beside = [transcribe(problem, threads=1) for problem in found]
    assert beside[1].backend.cached
    z = points(within[0])
    for own, made in zip(within, beside, strict=True):
        a, b = (each.shooting.evaluator.gradient(z, 0.0) for each in (own, made))
        assert a.gradient is not None and b.gradient is not None
        assert np.allclose(a.merit, b.merit, rtol=1e-10)
        assert np.allclose(a.gradient, b.gradient, rtol=1e-7, atol=1e-8 * np.abs(a.gradient).max())
        assert made.judge(z[0]).objective == pytest.approx(own.judge(z[0]).objective, rel=1e-12)
        assert np.allclose(made.probe.gradient(z[0]), own.probe.gradient(z[0]), rtol=1e-6, atol=1e-9)
    assert abs(within[0].judge(z[0]).objective / within[1].judge(z[0]).objective - 1) > 1e-3
