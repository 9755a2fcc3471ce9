"""Jacobians of one-step programs: those of casadi, whatever the block of a row and the batch of a point."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from symphys.codegen import Cache, FunctionCall, MemoryLayout, Program, ProgramError
from symphys.codegen.slopes import SlopeKernel, compile_slopes, plan
from symphys.codegen.slopes import kernel as slopes
from symphys.codegen.slopes.plan import slope_plan
from symphys.codegen.toolchain.cache import PLAN_SUFFIX
from symphys.codegen.toolchain.warm_start import ProgramSource

SIZE, ROWS = 5, 11


def chain(steps: int = 1) -> tuple[Program, ca.Function]:
    """Three calls, of which some rows need one only; and the whole as a function of (z, parameter)."""
    z, a, y = ca.SX.sym("z", SIZE), ca.SX.sym("a"), ca.SX.sym("y", 3)
    first = ca.Function("first", [z, a], [ca.vertcat(ca.sin(z[0] * z[1]), a * z[2] ** 3, ca.fmax(z[3], 0.1))])
    second = ca.Function("second", [y], [ca.vertcat(ca.sqrt(1 + ca.sumsqr(y)), y[0] / (2 + y[1]), ca.exp(-y[2]))])
    last = ca.Function("last", [z, y], [ca.vertcat(*(z[k % SIZE] * y[k % 3] for k in range(ROWS - 3)), z[0], 0, z[4])])
    at = MemoryLayout()
    place, given = at.take(SIZE), at.take(1)
    middle, end, out = at.take(3), at.take(3), at.series(ROWS, 1)
    calls = (
        FunctionCall(first, (place, given), (middle,)),
        FunctionCall(second, (middle,), (end,)),
        FunctionCall(last, (place, end), (out,)),
    )
    program = Program(at.size, place, given, steps, {"out": out.still()}, body=calls)
    return program, ca.Function("whole", [z, a], [last(z, second(first(z, a)))])


@pytest.fixture(scope="module")
def kernel() -> SlopeKernel:
    return compile_slopes(chain()[0], "out", threads=2)


def test_jacobians_are_casadis(kernel: SlopeKernel) -> None:
    rng = np.random.default_rng(0)
    Z, A = rng.normal(size=(19, SIZE)), rng.uniform(1, 2, (19, 1))
    whole, z, a = chain()[1], ca.SX.sym("z", SIZE), ca.SX.sym("a")
    exact = ca.Function("exact", [z, a], [ca.densify(ca.jacobian(whole(z, a), z))])
    found = kernel.jacobians(Z, A)
    for row, given, jacobian in zip(Z, A, found, strict=True):
        assert jacobian == pytest.approx(np.array(exact(row, given)), abs=1e-14)
    assert np.array_equal(kernel.jacobians(Z, A, columns=2), found[:, :, :2])
    assert np.array_equal(kernel.jacobians(Z[:3], A[:3]), found[:3])
    assert np.array_equal(kernel.jacobians(Z, A[0])[0], found[0])
    assert kernel.jacobians(Z[:0], A[:0]).shape == (0, ROWS, SIZE)


def test_calls_that_follow_each_other_are_merged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six steps of a pendulum: calls of four and of two, with the same Jacobian."""
    monkeypatch.setattr(plan, "MIN_INSTRUCTIONS", 0)
    y, a = ca.SX.sym("y", 2), ca.SX.sym("a")
    swing = ca.Function("swing", [y, a], [y + 0.1 * ca.vertcat(y[1], -a * ca.sin(y[0]))])
    at = MemoryLayout()
    start, given = at.take(2), at.take(1)
    places = [start, *(at.take(2) for _ in range(5)), at.series(2, 1)]
    calls = tuple(FunctionCall(swing, (x, given), (after,)) for x, after in pairwise(places))
    program = Program(at.size, start, given, 1, {"end": places[-1].still()}, body=calls)
    assert len(plan.merged(program)) == 2
    found = compile_slopes(program, "end", threads=1).jacobians([[0.3, 0.1]], [2.0])[0]
    whole = y
    for _ in range(6):
        whole = swing(whole, a)
    assert found == pytest.approx(np.array(ca.Function("exact", [y, a], [ca.jacobian(whole, y)])([0.3, 0.1], 2)))


def test_a_number_that_is_none_stays_in_its_point(kernel: SlopeKernel) -> None:
    Z, A = np.ones((4, SIZE)), np.ones((4, 1))
    Z[1, 0] = np.nan
    found = kernel.jacobians(Z, A)
    assert np.isnan(found[1]).any() and np.isfinite(found[[0, 2, 3]]).all()


def test_rows_take_only_the_calls_that_reach_them() -> None:
    """The two rows that are entries of z, and the one that is 0, need no call but the last."""
    blocks = slope_plan(chain()[0], "out", 4).blocks
    assert sorted(row for block in blocks for row in block.rows) == list(range(ROWS))
    apart = next(block for block in blocks if ROWS - 1 in block.rows)
    assert set(apart.rows) == {ROWS - 3, ROWS - 2, ROWS - 1} and apart.taken.sum() == 1


def test_what_is_wrong_is_said(kernel: SlopeKernel) -> None:
    with pytest.raises(ProgramError, match="one step"):
        slope_plan(replace(chain()[0], steps=0, body=(), outputs={"out": chain()[0].z}), "out", 4)
    with pytest.raises(ProgramError, match=r"\(batch, 5\)"):
        kernel.jacobians(np.ones((2, 3)), np.ones((2, 1)))
    with pytest.raises(ProgramError, match="differ"):
        kernel.jacobians(np.ones((2, SIZE)), np.ones((3, 1)))


def test_a_second_start_plans_nothing_and_gives_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own, z, given = Cache(tmp_path / "kernels"), np.random.default_rng(0).normal(size=(3, SIZE)), np.array([2.0])
    cold = compile_slopes(ProgramSource(lambda: chain()[0], "a"), "out", own, threads=1)
    expected = cold.jacobians(z, given)
    with monkeypatch.context() as patch:
        patch.setattr(slopes, "slope_plan", lambda *_: pytest.fail("it is planned again"))
        source = ProgramSource(lambda: pytest.fail("the program is made again"), "a")
        warm = compile_slopes(source, "out", own, threads=1)
    np.testing.assert_array_equal(warm.jacobians(z, given), expected)
    assert warm.report.cached
    assert replace(cold.report, cached=True, seconds=0) == replace(warm.report, seconds=0)


@pytest.mark.parametrize("other", ["identity", "library", "damaged"])
def test_what_has_changed_is_planned_again(tmp_path: Path, other: str) -> None:
    own, made = Cache(tmp_path / "kernels"), list[int]()

    def make() -> Program:
        made.append(1)
        return chain()[0]

    compile_slopes(ProgramSource(make, "a"), "out", own, threads=1)
    if other in ("library", "damaged"):
        (path,) = own.folder.glob("*.so" if other == "library" else f"*{PLAN_SUFFIX}")
        path.unlink() if other == "library" else path.write_bytes(path.read_bytes()[:-7])
    source = ProgramSource(make, "b" if other == "identity" else "a")
    compile_slopes(source, "out", own, threads=1)
    assert len(made) == 2
