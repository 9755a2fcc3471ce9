"""Problems of a sweep share a kernel, and it gives each of them what its own functions do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from tools.repeats import few
from worlds.thrown import TABLES

from symphys.codegen.toolchain import warm_start
from symphys.dynamics.functions import report_function
from symphys.latest import Latest
from symphys.problem import Problem, problem_of_tables
from symphys.problem.sweeps.points import combined, swept
from symphys.problem.sweeps.reading import read_axes
from symphys.transcription import Transcription, transcribe
from symphys.transcription.sampler import swept_inputs

TOO_HIGH = {"constraint": [{"name": "stays low", "value": "ball.position[2]", "at": "always", "upper": 1.2}]}
SWEEP = ("ball.mass=0.5:0.7:2", "ground.friction=0.2,0.4", "ball.shape.sphere.radius=0.1,0.12")
GRAVITY = "world.gravity=[0,0,-9.81],[0,1,-5]"


def points(*texts: str, tables: dict[str, object] = TOO_HIGH) -> list[Problem]:
    base = problem_of_tables({**TABLES, **tables})
    return list(swept(base, combined(None, base, read_axes(texts)[0])))


@cache
def made(backend: str) -> tuple[Transcription, ...]:
    """The transcriptions of the first, a middle and the last point."""
    found = points(*SWEEP, GRAVITY)
    return tuple(transcribe(found[k], backend=backend, threads=1) for k in (0, 6, len(found) - 1))


def pairs() -> Iterator[tuple[Transcription, Transcription]]:
    return zip(made("simd"), made("casadi"), strict=True)


@pytest.fixture
def Z() -> np.ndarray:
    """Throws to the ground, so that friction and radius matter."""
    return np.random.default_rng(0).normal([1, 0.3, -3, 0, 0, 0], 0.2, (5, 6))


@pytest.mark.slow
@pytest.mark.parametrize("smoothing", [0.0, 0.05])
@few("what", ["value", "gradient", "residuals", "jacobian"], 2)
def test_each_point_is_evaluated_with_its_own_numbers(what: str, smoothing: float, Z: np.ndarray) -> None:
    for shared, own in pairs():
        assert own.shooting.squares
        a, b = (getattr(each.shooting.evaluator, what)(Z, smoothing) for each in (shared, own))
        for name in ("merit", "objective", "errors", "outputs", "gradient", "residuals", "jacobian"):
            one, other = getattr(a, name), getattr(b, name)
            assert (one is None) == (other is None)
            if one is not None:
                np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9, err_msg=name)


def test_each_point_is_judged_with_its_own_numbers(Z: np.ndarray) -> None:
    """Points share steps and formulas, whose numbers are arguments; the same problem by itself shares nothing."""
    verdicts = []
    for shared in made("simd"):
        alone = transcribe(replace(shared.problem, varied=frozenset()), backend="casadi", threads=1)
        for z in Z[:2]:
            one, other = shared.judge(z), alone.judge(z)
            assert one.objective == pytest.approx(other.objective, rel=1e-9)
            assert [each.error for each in one.checks] == pytest.approx([each.error for each in other.checks], rel=1e-8)
            np.testing.assert_allclose(shared.probe.gradient(z), alone.probe.gradient(z), rtol=1e-7, atol=1e-9)
        verdicts.append(round(one.objective, 6))
    assert len(set(verdicts)) == 3, "otherwise any sharing would pass"


@pytest.mark.slow
def test_points_differ(Z: np.ndarray) -> None:
    """Otherwise any binding of the numbers would pass."""
    merits = [each.shooting.evaluator.value(Z[:1], 0.0).merit[0] for each in made("simd")]
    assert len({round(merit, 6) for merit in merits}) == 3


def test_functions_for_ipopt_are_those_of_the_point() -> None:
    z = np.array([1, 0.3, -3, 0.1, 0.2, 0.3])
    for shared, own in pairs():
        nlp, expression = shared.shooting.nlp, own.shooting.nlp.expression
        assert nlp.value is not None and nlp.gradient is not None and nlp.jacobian is not None
        objective, constraints = expression(z, 0.0)
        np.testing.assert_allclose(np.array(nlp.value(z, 0.0)[0]), np.array(objective), rtol=1e-9)
        np.testing.assert_allclose(np.array(nlp.value(z, 0.0)[1]), np.array(constraints), rtol=1e-9, atol=1e-12)
        slopes = np.array(nlp.gradient(z, 0.0)[1]).ravel()
        np.testing.assert_allclose(slopes, np.array(own.functions.gradient(z, 0.0)[3]).ravel(), rtol=1e-6, atol=1e-6)
        assert nlp.jacobian(z, 0.0)[1].shape == (constraints.shape[0], 6)


def test_one_kernel_is_compiled_for_all_points() -> None:
    first, *others = made("simd")
    assert [(each.backend.cached, each.backend.seconds) for each in others] == [(True, 0.0)] * 2
    kernels = {id(each.shooting.evaluator.make().evaluator) for each in made("simd")}  # type: ignore[attr-defined]
    assert len(kernels) == 1
    program = first.shooting.evaluator.make().evaluator.kernel.program  # type: ignore[attr-defined]
    assert program.z.size == 6 + 6  # mass, friction, radius, gravity


@pytest.mark.slow
def test_points_that_differ_in_more_have_kernels_of_their_own() -> None:
    """Here in a tolerance, which is a number of the program."""
    found = points("ball.mass=0.5,0.7", "target.there.tolerance=0.01,0.02", tables={})
    one, other = (transcribe(found[k], backend="simd", threads=1).shooting.evaluator for k in (0, 3))
    Z = np.zeros((1, 6))
    ratio = one.value(Z, 0.0).errors / other.value(Z, 0.0).errors
    np.testing.assert_allclose(ratio, 2, rtol=1e-9)


def test_steps_are_built_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path))  # where no earlier test has left them
    monkeypatch.setattr(warm_start, "LATEST", Latest(16))
    built: list[object] = []

    def counted(world: object, *more: object) -> object:
        built.append(world)
        return report_function(world, *more)  # type: ignore[arg-type]

    monkeypatch.setattr("symphys.dynamics.functions.report_function", counted)
    found = points("ball.mass=0.5:0.7:3", "simulation.dt=0.02,0.05", tables={})
    motions = [transcribe(point, backend="casadi").simulate(np.zeros(6)) for point in found]
    assert len(built) == 2  # one for each time step
    assert {len(motion.time) for motion in motions} == {11, 26}


def test_what_a_variable_sets_is_no_input() -> None:
    mass = {"name": "weight", "sets": "ball.mass", "lower": 0.1, "upper": 2}
    found = points("ball.mass=0.5,1", "ground.friction=0.2,0.4", tables={"variable": [*TABLES["variable"], mass]})
    assert [slot.name for each in swept_inputs(found[0]) for slot in each.slots] == ["ground.friction"]


def test_a_problem_by_itself_has_a_kernel_of_its_own() -> None:
    assert swept_inputs(problem_of_tables(TABLES)) == ()
    assert swept_inputs(points("simulation.dt=0.01,0.02")[0]) == ()
