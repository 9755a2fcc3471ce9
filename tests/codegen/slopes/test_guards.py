"""Jacobians of a step leave out what is without effect at a point: the same bits as with all calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from worlds.guarded import HEAPS, whole

import symphys
from symphys.codegen import Cache, FunctionCall, MemoryLayout, Place, Program
from symphys.codegen.slopes import SlopeKernel, compile_slopes, kernel
from symphys.codegen.slopes.plan import slope_plan
from symphys.codegen.toolchain import build
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged.linearization import Linearization
from symphys.transcription.staged.linearized_step import LinearizedStep
from symphys.transcription.staged.step_program import step_program


def compiled(program: Program, output: str, cache: Cache) -> SlopeKernel:
    return compile_slopes(program, output, cache, threads=1)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Cache:
    return Cache(tmp_path_factory.mktemp("kernels"))


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["spheres", "capsules", "a box", "soft"])
def test_a_heap_is_that_of_all_calls_to_the_last_bit(name: str, tmp_path: Path, cache: Cache) -> None:
    path = tmp_path / "heap.toml"
    path.write_text(HEAPS[name], "utf-8")
    problem = symphys.load(path)
    made = Linearization(symbolic_rollout(problem), threads=1, exact=True)
    step = LinearizedStep(made.rollout, made.tangent, threads=1, exact=True, parameters=False)
    program = step_program(step.arguments, exact=True, tangent=True)
    x0, u, p = made.start(np.concatenate([variable.guess for variable in problem.variables]))
    states = [x0]
    for k in range(20):
        states.append(made.step.step(k, states[-1][None], u[None, k], p, 0.0)[0])
    varying, given = step.rows(np.arange(20), np.array(states[:-1]), np.array(states[1:]), u[:20], p, 0.0)
    kernels = [compiled(each, "off", cache) for each in (program, whole(program))]
    found, expected = (kernel.jacobians(varying, given) for kernel in kernels)
    assert np.isfinite(expected).all()
    assert np.array_equal(found, expected)
    assert np.array_equal(kernels[0].jacobians(varying[::-1], given[::-1])[::-1], expected)
    planned = slope_plan(program, "off", 8)
    assert len(planned.backward.cells) > 0
    assert np.mean([max(section, guard) >= 0 for _, section, guard, *_ in planned.backward.calls]) > 0.8


COUNT = 6


def pushes(guarded: bool) -> Program:
    """Two numbers pushed at each other where words say so, one after the other; z are the numbers and the words."""
    at = MemoryLayout()
    z, words, values, out = at.take(2 + COUNT), at.take(COUNT), at.take(2), at.series(2, 1)
    a, b, w = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("w")
    both, x = ca.SX.sym("z", 2 + COUNT), ca.SX.sym("x", 2)
    split = ca.Function("split", [both], [both[:2] * both[:2], both[2:] > 0])
    parts = ca.Function("parts", [x], [ca.sin(x[0]), ca.cos(x[1])])
    push = ca.Function("push", [w, a, b], [a + w * ca.sin(b) * a, b - w * a / (1 + b * b)])
    now = [at.take(1), at.take(1)]
    calls = [FunctionCall(split, (z,), (values, words)), FunctionCall(parts, (values,), tuple(now))]
    for k in range(COUNT):
        word, new = Place(words.offset + k, 1), [at.take(1), at.take(1)]
        name = {"guard": "otherwise", "section": "beside"}
        kind = "guard" if k % 3 else "section"
        more = {kind: word, name[kind]: tuple(now)} if guarded else {}
        calls.append(FunctionCall(push, (word, *now), tuple(new), **more))
        now = new
    last = ca.Function("last", [a, b], [ca.vertcat(a * b, a - b)])
    calls.append(FunctionCall(last, tuple(now), (out,)))
    return Program(at.size, z, Place(0, 0), 1, {"out": out.still()}, body=tuple(calls))


def test_every_choice_of_what_is_left_out(cache: Cache) -> None:
    """At neighbouring points different calls are left out: adjoints wait in either of two places."""
    on = np.arange(2**COUNT)[:, None] >> np.arange(COUNT) & 1
    Z = np.concatenate([np.random.default_rng(0).uniform(0.2, 1, (2**COUNT, 2)), 2.0 * on - 1], axis=1)
    given = np.zeros((len(Z), 0))
    with_guards, without = (compiled(pushes(guarded), "out", cache) for guarded in (True, False))
    for order in (np.arange(len(Z)), np.random.default_rng(1).permutation(len(Z))):
        found, expected = (kernel.jacobians(Z[order], given) for kernel in (with_guards, without))
        assert np.array_equal(found, expected)
    assert len(np.unique(expected[:, :, 0])) > 2**COUNT


def test_numbers_that_are_none_stay_at_their_point(cache: Cache) -> None:
    kernel = compiled(pushes(True), "out", cache)
    Z = np.tile([0.5, 0.7, 1, -1, 1, -1, -1, 1], (9, 1))
    expected = kernel.jacobians(Z[:1], np.zeros((1, 0)))
    Z[4, 1] = np.nan
    found = kernel.jacobians(Z, np.zeros((9, 0)))
    assert np.isnan(found[4]).any()
    assert all(np.array_equal(found[k], expected[0]) for k in range(9) if k != 4)


def rooted(guarded: bool) -> Program:
    """x + 3 sqrt(x) where a word says so, else x: what stands for two results are the same zeros."""
    at = MemoryLayout()
    z, none, word, root = at.take(2), at.take(2), at.take(1), at.take(1)
    one, two, out = at.take(1), at.take(2), at.series(1, 1)
    x, r, w, t = ca.SX.sym("x", 2), ca.SX.sym("r"), ca.SX.sym("w"), ca.SX.sym("t", 2)
    more: dict[str, Any] = {"guard": word} if guarded else {}
    others = [(None,), (Place(none.offset, 1), none)] if guarded else [(), ()]
    calls = [
        FunctionCall(ca.Function("above", [x], [x[1] > 0]), (z,), (word,)),
        FunctionCall(ca.Function("root", [x], [ca.sqrt(x[0])]), (z,), (root,), otherwise=others[0], **more),
        FunctionCall(
            ca.Function("times", [w, r, x], [w * r, w * ca.vertcat(r, x[0] / r)]),
            (word, root, z),
            (one, two),
            otherwise=others[1],
            **more,
        ),
        FunctionCall(ca.Function("last", [x, r, t], [x[0] + r + t[0] + t[1]]), (z, one, two), (out,)),
    ]
    return Program(at.size, z, Place(0, 0), 1, {"out": out.still()}, body=tuple(calls))


def test_zeros_may_stand_for_several_results(cache: Cache) -> None:
    """Their call is left out with those that it reads, whose slopes would be none where nothing has computed them."""
    Z = np.array([[4.0, -1.0], [4.0, 1.0]])
    with_guards, without = (compiled(rooted(guarded), "out", cache) for guarded in (True, False))
    found = with_guards.jacobians(Z, np.zeros((2, 0)))
    assert np.array_equal(found[:, 0, 0], [1.0, 1.75])
    assert np.array_equal(found, without.jacobians(Z, np.zeros((2, 0))))
    assert np.isfinite(with_guards.jacobians(Z[:1], np.zeros((1, 0)))).all()


class Later:
    """A compiler that ends when the test says so."""

    running = True

    def __init__(self, parts: Any, texts: str, cache: Cache, done: Any, failed: Any) -> None:
        self.arguments, self.done, self.failed = (parts, cache, texts), done, failed

    def finish(self) -> None:
        with build.shared_library(*self.arguments) as built:
            self.done(built.path)


@pytest.mark.parametrize("guarded", [True, False])
def test_the_interpreter_gives_the_same_bits(
    guarded: bool, tmp_path: Path, cache: Cache, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = pushes(guarded)
    whole = compiled(program, "out", cache)
    monkeypatch.delenv("SYMPHYS_WAIT", raising=False)
    monkeypatch.setattr(build, "MIN_LONG_OPERATIONS", 0)
    monkeypatch.setattr(kernel, "Background", Later)
    interpreted = compile_slopes(program, "out", Cache(tmp_path / "kernels"), threads=1, wait=False)
    given = np.random.default_rng(0).uniform(-1, 1, (7, program.z.size)), np.zeros(program.parameters.size)
    first, library = interpreted.jacobians(*given), interpreted.library
    np.testing.assert_array_equal(first, whole.jacobians(*given))
    interpreted.finish()
    assert interpreted.library is not library
    np.testing.assert_array_equal(interpreted.jacobians(*given), first)
