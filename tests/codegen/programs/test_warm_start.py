"""What was built once is used again where nothing that it depends on has changed, and nowhere else."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few
from worlds.toys import require

from symphys.codegen import Cache, FunctionCall, MemoryLayout, Program
from symphys.codegen.toolchain import warm_start
from symphys.codegen.toolchain.cache import PLAN_SUFFIX
from symphys.codegen.toolchain.identity import identity_of
from symphys.codegen.toolchain.warm_start import ProgramSource, compile_source
from symphys.dynamics.kept import structure
from symphys.expression import parse
from symphys.latest import Latest
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.transcription import transcribe
from symphys.transcription.identities import program_identity
from symphys.transcription.rollout import symbolic_rollout

Z = np.array([[1.0, 2.0], [0.3, -1.0]])


def fall(factor: float = 0.1) -> Program:
    """A state that is multiplied five times, with a constant and a guard-free body."""
    x, c = ca.SX.sym("x", 2), ca.SX.sym("c")
    step = ca.Function("step", [x, c], [x + c * ca.sin(x) * factor])
    size = ca.Function("size", [x], [x[0] ** 2 + x[1]])
    at = MemoryLayout()
    state, fixed, nothing, merit = at.series(2, 6), at.take(1), at.take(0), at.take(1)
    return Program(
        size=at.size,
        z=state.still(),
        parameters=nothing,
        steps=5,
        body=(FunctionCall(step, (state, fixed), (state.later(),)),),
        epilogue=(FunctionCall(size, (state.later(5),), (merit,)),),
        outputs={"merit": merit},
        constants=((fixed, (1 / 3,)),),
    )


class Made:
    """A source that counts how often its program is made."""

    def __init__(self, identity: str | None = "a", make: Callable[[], Program] = fall) -> None:
        self.count, self._make = 0, make
        self.source = ProgramSource(self._made, identity)

    def _made(self) -> Program:
        self.count += 1
        return self._make()


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return Cache(tmp_path / "kernels")


def test_a_second_start_makes_no_program_and_gives_the_same_bits(cache: Cache) -> None:
    cold, warm = Made(), Made()
    kernels = [compile_source(each.source, ("merit", "residuals"), 1, cache=cache) for each in (cold, warm)]
    assert (cold.count, warm.count) == (1, 0)
    (a, slopes), (b, again) = (kernel.gradient(Z, [1.0]) for kernel in kernels)
    np.testing.assert_array_equal(a["merit"], b["merit"])
    np.testing.assert_array_equal(slopes, again)
    assert kernels[1].report.cached
    assert replace(kernels[0].report, cached=True, seconds=0) == replace(kernels[1].report, seconds=0)


def test_calls_are_made_when_somebody_asks_for_them(cache: Cache) -> None:
    compile_source(Made().source, ("merit",), 1, cache=cache)
    warm = Made()
    kernel = compile_source(warm.source, ("merit",), 1, cache=cache)
    bad = kernel.first_bad([np.inf, 0.0])
    assert bad is not None
    assert bad.phase == "inputs"
    assert [call.function.name() for call in kernel.program.calls] == ["step", "size"]
    assert warm.count == 1


@few("other", ["identity", "package", "seeded", "precision", "library", "damaged", "none"], 2)
def test_what_has_changed_is_built_again(cache: Cache, other: str, monkeypatch: pytest.MonkeyPatch) -> None:
    compile_source(Made().source, ("merit",), 1, cache=cache)
    again = Made({"identity": "b", "none": None}.get(other, "a"))
    if other == "package":
        monkeypatch.setattr(warm_start, "package_stamp", lambda: "another")
    if other in ("library", "damaged"):
        (path,) = cache.folder.glob("*.so" if other == "library" else f"*{PLAN_SUFFIX}")
        path.unlink() if other == "library" else path.write_bytes(path.read_bytes()[:-7])
    seeded = ("merit", "objective") if other == "seeded" else ("merit",)
    compile_source(again.source, seeded, 1, "single" if other == "precision" else "double", cache)
    assert again.count == 1


@pytest.mark.slow
def test_a_folder_that_others_may_write_to_is_not_used(cache: Cache) -> None:
    compile_source(Made().source, ("merit",), 1, cache=cache)
    cache.folder.chmod(0o777)
    again = Made()
    compile_source(again.source, ("merit",), 1, cache=cache)
    assert again.count == 1


@dataclass(frozen=True)
class Pair:
    first: Any
    second: Any = None


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (1.0, np.nextafter(1.0, 2.0)),
        (1.0, 1),
        (0.0, -0.0),
        (True, 1),
        ("1", 1),
        ((1, 2), [1, 2]),
        (("ab", "c"), ("a", "bc")),
        (((1,), 2), ((1, 2),)),
        (Pair(1, 2), Pair(2, 1)),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}),
        (np.zeros(2), np.zeros((2, 1))),
        (np.zeros(2), np.zeros(2, np.float32)),
        (ca.SX(1), ca.SX(2)),
        (parse("a + b"), parse("a - b")),
        (parse("a[0]"), parse("a[1]")),
        (partial(ca.sin), partial(ca.cos)),
    ],
)
def test_data_that_differ_have_other_identities(a: Any, b: Any) -> None:
    assert identity_of(a) == identity_of(a) is not None
    assert identity_of(b) not in (None, identity_of(a))


def test_a_function_of_somebody_has_no_identity() -> None:
    assert identity_of(Pair(lambda x: x)) is None
    assert identity_of({"deep": (1, [cache])}) is None
    assert identity_of(object()) is None


@pytest.mark.slow
def test_another_process_has_the_same_identity() -> None:
    code = (
        "from symphys.problem import load_problem; from symphys.problems import find;"
        "from symphys.transcription.identities import program_identity;"
        "print(program_identity(load_problem(find('cart_pole')), True))"
    )
    told = [
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for seed in "12"
    ]
    assert told[0] == told[1] == program_identity(load_problem(find("cart_pole")), True)


CHANGES = {
    "ball.mass": 2.5,
    "ground.friction": 0.123,
    "simulation.dt": 0.005,
    "simulation.sweeps": 7,
    "throw.guess": [1.0, 0.0, 1.0],
}


@pytest.mark.parametrize("key", CHANGES)
def test_every_number_of_a_problem_is_part_of_its_identity(key: str) -> None:
    problem = load_problem(find("ball_throw"))
    found = program_identity(problem, True)
    assert found is not None
    assert found not in (None, program_identity(problem.set(key, CHANGES[key]), True), program_identity(problem, False))
    assert found == program_identity(replace(problem, title="another", text="# a comment"), True)


def test_a_problem_with_a_python_function_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load_problem(find("ball_throw"))
    assert program_identity(replace(problem, parameters={"own": lambda: 1}), True) is None  # type: ignore[dict-item]


@pytest.mark.slow
@few("name", ["ball_throw", "cart_pole_walls"], 1)
def test_a_second_start_of_a_problem_is_the_first(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require("simd")
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path / "kernels"))
    problem: Problem = load_problem(find(name))
    cold = transcribe(problem, exact=True, threads=1)
    cold.backend.finish()
    monkeypatch.setattr("symphys.dynamics.functions.trace_step", None)
    warm = transcribe(problem, exact=True, threads=1)
    z = cold.shooting.start(0)[None]
    first, second = (made.shooting.evaluator.gradient(z, 0.0) for made in (cold, warm))
    np.testing.assert_array_equal(first.gradient, second.gradient)
    np.testing.assert_array_equal(first.errors, second.errors)
    np.testing.assert_array_equal(warm.shooting.constraint_lower, cold.terms.lower)
    np.testing.assert_array_equal(warm.shooting.constraint_upper, cold.terms.upper)
    assert warm.shooting.constraint_names == cold.terms.names
    assert warm.backend.cached


def many_terms(factor: float) -> ca.Function:
    x = ca.SX.sym("x")
    y = x
    for k in range(3000):
        y = ca.sin(y) + factor / (1 + k)
    return ca.Function("terms", [x], [y])


def test_a_function_of_casadi_is_kept_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path / "kernels"))
    made = list[float]()

    def make(factor: float) -> ca.Function:
        made.append(factor)
        return many_terms(factor)

    monkeypatch.setattr(warm_start, "LATEST", Latest(0))  # so that files are read
    first = warm_start.kept_function(partial(make, 1 / 3), "a")
    again = warm_start.kept_function(partial(make, 1 / 3), "a")
    other = warm_start.kept_function(partial(make, 1 / 7), "b")
    assert made == [1 / 3, 1 / 7]
    assert float(again(0.1)) == float(first(0.1)) != float(other(0.1))
    warm_start.kept_function(partial(make, 0.5), None)  # without an identity it is made each time
    (kept, _) = sorted((tmp_path / "kernels").glob("*.plan"))
    kept.write_bytes(kept.read_bytes()[:-9])
    for identity, factor in (("a", 1 / 3), ("b", 1 / 7)):
        warm_start.kept_function(partial(make, factor), identity)
    assert len(made) == 4, "what is damaged is made again"


def test_a_small_function_of_casadi_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path / "kernels"))
    x = ca.SX.sym("x")
    warm_start.kept_function(lambda: ca.Function("square", [x], [x * x]), "a")
    assert not (tmp_path / "kernels").exists()


@pytest.mark.parametrize(
    "change",
    [{"ball.mass": 2.5}, {"simulation.dt": 0.005}, {"simulation.sweeps": 9}, {"ground.friction": 0.123}],
    ids=lambda change: next(iter(change)),
)
def test_steps_of_unequal_worlds_are_not_the_same(change: dict[str, float]) -> None:
    problem = load_problem(find("ball_throw"))

    def identity(problem: Problem) -> str | None:
        rollout = symbolic_rollout(problem)
        scheme = rollout.parameters.scheme(problem.simulation)
        return identity_of(structure(rollout.world, rollout.parameters.symbols, scheme), rollout.inputs)

    assert identity(problem) is not None
    assert identity(problem) != identity(problem.set(change))
    assert identity(problem) == identity(problem.set({"simulation.duration": problem.simulation.duration / 2}))
