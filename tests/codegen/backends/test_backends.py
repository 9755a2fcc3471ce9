"""Every backend gives the same numbers, row by row, whatever the batch; what is wrong in one row stays there."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few, thorough
from worlds.pushed import PUSHED
from worlds.toys import require

from symphys.codegen import compile_program
from symphys.codegen.backends import BACKENDS, BEST, NAMES
from symphys.problem import load_problem
from symphys.problems import find
from symphys.shooting import Values
from symphys.trajectory import NotFinite
from symphys.transcription import Transcription, rollout_program, transcribe

KINDS = ("value", "gradient", "residuals", "jacobian")
FIELDS = ("merit", "objective", "errors", "gradient", "residuals", "jacobian")


@cache
def throw(backend: str, threads: int = 2) -> Transcription:
    require(backend)
    return transcribe(load_problem(find("ball_throw"), {"simulation.duration": 1.0}), backend=backend, threads=threads)


def points(count: int) -> np.ndarray:
    return np.array([throw("casadi").shooting.start(seed) for seed in range(count)])


def evaluated(transcription: Transcription, kind: str, Z: np.ndarray, smoothing: float = 0.0) -> Values:
    values: Values = getattr(transcription.shooting.evaluator, kind)(Z, smoothing)
    return values


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@few("backend", ["simd", "c"], 1)
def test_all_agree(backend: str, kind: str) -> None:
    for smoothing in (0.0, 1e-3):
        expected = evaluated(throw("casadi"), kind, points(5), smoothing)
        found = evaluated(throw(backend), kind, points(5), smoothing)
        for name in FIELDS:
            a, b = getattr(expected, name), getattr(found, name)
            assert (a is None) == (b is None)
            if a is not None:
                assert b.shape == a.shape
                assert b == pytest.approx(a, rel=1e-9, abs=1e-11 * (1 + np.abs(a).max()))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_single_precision_is_off_by_no_more_than_it_says(kind: str) -> None:
    expected, found = (evaluated(throw(backend), kind, points(8)) for backend in ("casadi", "simd32"))
    for name in FIELDS:
        a, b = getattr(expected, name), getattr(found, name)
        if a is not None:
            assert b == pytest.approx(a, rel=1e-4, abs=1e-5 * (1 + np.abs(a).max()))
    assert throw("simd32").backend.precision == "single"
    assert throw("simd32").backend.lanes == 2 * throw("simd").backend.lanes


@pytest.mark.slow
@few("kind", KINDS, 1)
@few("backend", BACKENDS, 1)
def test_a_row_does_not_depend_on_its_batch(backend: str, kind: str) -> None:
    Z = points(11)
    together, alone = (evaluated(throw(backend, threads), kind, Z) for threads in (2, 1))
    rows = [evaluated(throw(backend), kind, z[None]) for z in Z]
    for name in FIELDS:
        whole = getattr(together, name)
        if whole is not None:
            assert np.array_equal(whole, getattr(alone, name))
            assert np.array_equal(whole, np.concatenate([getattr(row, name) for row in rows]))


@pytest.mark.parametrize("kind", KINDS)
@few("backend", BACKENDS, 3)
def test_a_row_that_is_not_finite_leaves_the_others_alone(backend: str, kind: str) -> None:
    Z = points(9)
    good = evaluated(throw(backend), kind, Z)
    spoiled = Z.copy()
    spoiled[3] = 1e308
    found = evaluated(throw(backend), kind, spoiled)
    others = np.arange(9) != 3
    assert not np.isfinite(found.merit[3])
    for name in FIELDS:
        if getattr(good, name) is not None:
            assert np.array_equal(getattr(found, name)[others], getattr(good, name)[others])


@pytest.mark.slow
def test_the_first_bad_step_is_named_and_so_is_the_body() -> None:
    """By the kernel, and by the exact rollout that users hear of, where a number of the motion overflows."""
    require("simd")
    exact = throw("casadi")
    kernel = compile_program(rollout_program(exact.rollout), seeded=("merit",), threads=1)
    z = exact.shooting.start(0)
    assert kernel.first_bad(z, [0.0]) is None
    z[:3] = 1e308
    bad = kernel.first_bad(z, [0.0])
    assert bad is not None and bad.phase == "body"
    with pytest.raises(NotFinite, match=r"step \d+ .*'ball'") as raised:
        exact.simulate(z)
    assert bad.step < int(str(raised.value).split("from step ")[1].split()[0])


@pytest.mark.slow
@pytest.mark.parametrize("backend", [thorough("c"), "simd"])
def test_constraints_and_their_derivatives_reach_nlp_solvers(backend: str, tmp_path: Path) -> None:
    """A constraint at every step, and costs of controls that share lanes."""
    require(backend)
    file = tmp_path / "pushed.toml"
    squares = PUSHED.replace('value = "puck.position[0] + time"', 'squares = "puck.position[0] + time"')
    file.write_text(squares, encoding="utf-8")
    problem = load_problem(file, {"simulation.dt": 0.05})  # casadi's C grows with the steps
    exact, compiled = (transcribe(problem, backend=name) for name in ("casadi", backend))
    z = ca.MX.sym("z", exact.shooting.n)
    f, g = exact.shooting.nlp.expression(z, 0)
    at = exact.shooting.start(1)
    expected = [np.array(part) for part in ca.Function("all", [z], [f, g, ca.gradient(f, z), ca.jacobian(g, z)])(at)]
    nlp = compiled.shooting.nlp
    assert nlp.value and nlp.gradient and nlp.jacobian
    found = [*nlp.value(at, 0), nlp.gradient(at, 0)[1], nlp.jacobian(at, 0)[1]]
    for a, b in zip(expected, found, strict=True):
        assert np.array(b) == pytest.approx(a, rel=1e-9, abs=1e-12)
    one, other = (evaluated(each, "jacobian", at[None]) for each in (exact, compiled))
    assert other.jacobian == pytest.approx(one.jacobian, rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_two_problems_of_one_shape_keep_their_numbers_apart() -> None:
    require("simd")
    settings = [{"simulation.duration": 1.0, "body.ball.mass": mass} for mass in (1.0, 2.0)]
    goals = [
        {**each, "target.0.value": f"ball.position[0:2] - [{x}, 0]"} for each, x in zip(settings, (5, 9), strict=True)
    ]
    pair = [transcribe(load_problem(find("ball_throw"), each), backend="simd") for each in goals]
    z = pair[0].shooting.start(0)
    values = [float(each.shooting.nlp.value(z, 0)[0]) for each in pair]
    assert values == pytest.approx([float(each.functions.nlp(z, 0)[0]) for each in pair], rel=1e-12)
    assert values[0] != pytest.approx(values[1])


def test_what_evaluates_is_told() -> None:
    told = throw("simd").backend
    assert (told.name, told.threads, told.precision, told.note) == ("simd", 2, "double", "")
    assert told.lanes >= 2 and told.compiler and told.cached is not None and told.seconds > 0
    assert "simd" in str(told)


@pytest.mark.parametrize("backend", ["auto", "c", "simd"])
def test_without_a_compiler_casadi_takes_over(backend: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path))
    problem = load_problem(find("ball_throw"), {"simulation.duration": 0.2})
    for environment in ({"CC": "/nonexistent"}, {"CC": "", "PATH": ""}):
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
        told = transcribe(problem, backend=backend).backend
        monkeypatch.undo()
        monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path))
        assert (told.name, told.cached) == ("casadi", None)
        assert "ziglang" in told.note and "gcc" in told.note
        assert "\n" not in told.note


def test_a_compiler_that_fails_is_no_obstacle_either(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    failing = tmp_path / "cc"
    failing.write_text('#!/bin/sh\n[ "$1" = --version ] && echo cc 1.0 && exit 0\nexit 3\n', encoding="utf-8")
    failing.chmod(0o755)
    monkeypatch.setenv("CC", str(failing))
    told = transcribe(load_problem(find("ball_throw"), {"simulation.duration": 0.2}), backend=BEST).backend
    assert told.name == "casadi"
    assert "failed with code 3" in told.note


def test_names() -> None:
    assert set(NAMES) == {"auto", "casadi", "c", "simd", "simd32", "cuda", "cuda32"}


@pytest.mark.slow
def test_an_exact_kernel_refuses_smoothing() -> None:
    """It has no parameters: an answer to another question would be worse than none."""
    require("simd")
    made = transcribe(load_problem(find("ball_throw"), {"simulation.duration": 0.2}), exact=True, backend="simd")
    Z = made.shooting.start(0)[None]
    assert np.isfinite(made.shooting.evaluator.value(Z, 0.0).merit).all()
    with pytest.raises(ValueError, match="smoothing 0"):
        made.shooting.evaluator.value(Z, 0.1)
