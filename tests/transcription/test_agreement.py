"""Every feature of problem files in every way to evaluate: they agree with each other, and slopes with differences."""

from __future__ import annotations

from collections.abc import Container
from functools import cache

import numpy as np
import pytest
from worlds.features import FEATURES
from worlds.toys import require

import symphys
from symphys.problem import problem_of_tables
from symphys.transcription import Transcription, transcribe
from symphys.transcription.staged.linearization import Linearization
from symphys.types import Array

HEAVY = {"loop of joints", "orientation", "reactions of joints", "soft joint", "a leg that lands"}
"""What takes seconds to build."""
COMPILED = {"impacts with friction", "smoothed contact", "references"}
"""What is compiled in every run of the tests; kernels of the others in those of ``make test-all``."""


LONGEST = {"load on two boards", "inertia and centre of mass"}
"""What takes half a minute; ``soft joint`` has the longest compile."""


def every(later: Container[str], last: Container[str] = LONGEST) -> pytest.MarkDecorator:
    """All features; those in ``later`` with ``make test-all``, those in ``last`` with ``make thorough``."""
    marks = {
        name: [pytest.mark.thorough] if name in last else [pytest.mark.slow] if name in later else []
        for name in FEATURES
    }
    return pytest.mark.parametrize("name", [pytest.param(name, marks=marks[name]) for name in FEATURES])


@cache
def made(name: str, backend: str = "casadi") -> Transcription:
    """The problem, in one thread."""
    require(backend)
    return transcribe(problem_of_tables(FEATURES[name]), backend=backend, threads=1)


def widest(name: str) -> float:
    """The smoothing [m/s] that the problem asks for."""
    return max(made(name).problem.simulation.smoothing)


def merit_and_slope(name: str, backend: str) -> tuple[Array, Array]:
    """(2,), (2, n) at the guess and at a start beside it."""
    shooting = made(name).shooting
    found = made(name, backend).shooting.evaluator.gradient(
        np.stack([shooting.start(0), shooting.start(1)]), widest(name)
    )
    assert found.gradient is not None
    return found.merit, found.gradient


@every(later=FEATURES.keys() - COMPILED, last=LONGEST | {"soft joint", "a leg that lands", "loop of joints"})
def test_a_kernel_gives_what_the_virtual_machine_gives(name: str) -> None:
    merit, slope = merit_and_slope(name, "casadi")
    compiled, compiled_slope = merit_and_slope(name, "simd")
    assert compiled == pytest.approx(merit, rel=1e-11)
    np.testing.assert_allclose(compiled_slope, slope, rtol=1e-8, atol=1e-9 * np.abs(slope).max())


@every(later=HEAVY)
def test_slopes_are_those_of_differences(name: str) -> None:
    """At the guess, where each counts."""
    evaluator, h = made(name).shooting.evaluator, 1e-6
    z, slope = made(name).shooting.start(0), merit_and_slope(name, "casadi")[1][0]
    ahead, behind = (evaluator.value(z + sign * h * np.eye(z.size), widest(name)).merit for sign in (1, -1))
    np.testing.assert_allclose((ahead - behind) / (2 * h), slope, rtol=1e-5, atol=1e-7 * np.abs(slope).max())
    assert np.abs(slope).min() > 0


@every(later=HEAVY)
def test_steps_give_what_the_whole_gives(name: str) -> None:
    problem, whole = made(name), made(name).shooting
    assert whole.by_steps is not None
    z, smoothing = np.stack([whole.start(0), whole.start(1)]), widest(name)
    found, expected = whole.by_steps.gradient(z, smoothing), merit_and_slope(name, "casadi")
    values, wanted = whole.by_steps.value(z, smoothing), problem.shooting.evaluator.value(z, smoothing)
    for each in ("merit", "objective", "errors", "outputs"):
        np.testing.assert_allclose(getattr(values, each), getattr(wanted, each), rtol=1e-10, atol=1e-13)
    assert whole.by_steps.value(z, 0.0).probe == pytest.approx(problem.probe.values(z), rel=1e-10)
    assert whole.staged is not None
    staged, nothing = whole.staged(), np.zeros(len(whole.constraint_lower))
    plain = staged.expand(staged.roll_out(z[0], smoothing), nothing, nothing)
    assert plain.value == pytest.approx(wanted.objective[0], rel=1e-10)
    assert found.gradient is not None
    np.testing.assert_allclose(found.gradient, expected[1], rtol=1e-8, atol=1e-8 * np.abs(expected[1]).max())


def test_a_kernel_whose_steps_lead_elsewhere_does_not_judge(monkeypatch: pytest.MonkeyPatch) -> None:
    """The virtual machine takes each recorded step too, and all of them from then on."""
    problem = symphys.load("ball_throw")
    honest, wrong = (transcribe(problem, backend="casadi") for _ in range(2))
    z, own = honest.shooting.start(0), Linearization.states

    def off(self: Linearization, Z: Array, smoothing: float) -> Array:
        found = own(self, Z, smoothing)
        found[:, 5:] += 1e-3
        return found

    expected = honest.record(z), honest.judge(z)
    with monkeypatch.context() as changed:
        changed.setattr(Linearization, "states", off)
        assert not np.allclose(wrong.arrays(z).x, expected[0].arrays.x)
        taken = wrong.record(z)
        assert np.array_equal(taken.motion.position, expected[0].motion.position)
        assert wrong.judge(z).worst == expected[1].worst
