"""Equal calls of one level, side by side in the lanes of one rollout: found, and the same to the last bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few
from worlds.graphs import evaluated
from worlds.toys import require

from symphys.codegen import Cache, FunctionCall, MemoryLayout, Program, compile_program
from symphys.codegen.emit.packs import pack_calls, single_lane_plan
from symphys.codegen.emit.plan import plan
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.instructions import graph_of
from symphys.codegen.runtime.widths import suited

STEPS = 3


def limb_program(count: int = 4, crossed: bool = False, odd: bool = False) -> Program:
    """Limbs that hang on a trunk of two words; a limb is moved by the trunk, and the trunk by all limbs in turn.

    ``crossed``: two limbs each have one arm at the same place. ``odd``: the first is bent by a function of its own.
    """
    trunk, own, arm = ca.SX.sym("trunk", 2), ca.SX.sym("own", 3), ca.SX.sym("arm", 3)
    bent = ca.Function("bent", [trunk, own], [ca.sin(own) * trunk[0], ca.if_else(own[0] > 0, own[1], trunk[1] * own)])
    stiff = ca.Function("stiff", [trunk, own], [ca.cos(own) * trunk[1], 0.5 * own]) if odd else bent
    held = ca.Function(
        "held", [own, arm, trunk], [own * arm[0] + ca.sqrt(1 + arm**2) / (2 + own[1] ** 2), trunk * own[2]]
    )
    pulled = ca.Function("pulled", [trunk, own], [0.9 * trunk + 0.1 * own[:2] * own[2]])
    moved = ca.Function("moved", [own, arm], [ca.tanh(own + 0.2 * arm)])
    at = MemoryLayout()
    state = at.series(2 + 3 * count, STEPS + 1)
    z, nothing, end = at.take(2 + 3 * count), at.take(0), at.take(2 + 3 * count)
    part = [replace(state, offset=state.offset + 2 + 3 * k, size=3) for k in range(count)]
    body, now = list[FunctionCall](), replace(state, size=2)
    sines, bents, helds, pushes = ([at.take(size) for _ in range(count)] for size in (3, 3, 3, 2))
    for k in range(count):  # limb by limb, as a recorder would have it
        body.append(FunctionCall(bent if k else stiff, (replace(state, size=2), part[k]), (sines[k], bents[k])))
        arm_of = sines[k // 2] if crossed else sines[k]
        body.append(FunctionCall(held, (bents[k], arm_of, replace(state, size=2)), (helds[k], pushes[k])))
        body.append(FunctionCall(moved, (helds[k], sines[count - 1 - k]), (part[k].later(),)))
    body.sort(key=lambda call: [stiff, bent, held, moved].index(call.function) if crossed else 0)
    if not crossed:
        body = [body[3 * k + i] for i in (0, 1) for k in range(count)] + body[2::3]
    for k in range(count):
        after = replace(state, size=2).later() if k == count - 1 else at.take(2)
        body.append(FunctionCall(pulled, (now, helds[k]), (after,)))
        now = after
    whole = ca.SX.sym("x", 2 + 3 * count)
    same = ca.Function("same", [whole], [whole])
    return Program(
        size=at.size,
        z=z,
        parameters=nothing,
        steps=STEPS,
        outputs={"end": end},
        prologue=(FunctionCall(same, (z,), (state.still(),)),),
        body=tuple(body),
        epilogue=(FunctionCall(same, (state.later(STEPS).still(),), (end,)),),
    )


@few("count", [2, 4, 6], 1)
@few("crossed", [False, True], 1)
@few("odd", [False, True], 1)
def test_one_rollout_alone_gives_the_same_bits(count: int, crossed: bool, odd: bool, tmp_path: Path) -> None:
    require("simd")
    program, cache = limb_program(count, crossed, odd), Cache(tmp_path / "kernels")
    rng = np.random.default_rng(count)
    Z, seeds = rng.normal(size=(5, program.z.size)), rng.normal(size=(5, program.z.size))
    wide = compile_program(program, cache=cache, threads=1, lanes=4)
    single = compile_program(program, cache=cache, threads=1, rows=1)
    assert suited(1, 8) in single.widths.loaded
    values, gradients = wide.gradient(Z, seeds)
    for z, seed, value, gradient in zip(Z, seeds, values["end"], gradients, strict=True):
        found, slope = single.gradient(z, seed)
        assert np.array_equal(found["end"][0], value)
        assert np.array_equal(slope[0], gradient)
        assert np.abs(gradient).min() > 0


def test_equal_calls_are_found_and_no_call_is_lost() -> None:
    """Without teams the law above would say nothing."""
    program = limb_program()
    found = pack_calls(program)
    assert found.packs and min(count for _, count in found.packs) > 1
    assert sorted(found.program.body, key=id) == sorted(program.body, key=id)
    assert pack_calls(replace(program, in_order=True)).packs == ()
    assert single_lane_plan(plan(program, ["end"])) is not None


def test_sums_do_not_wait_for_all_their_terms() -> None:
    x, seed = ca.SX.sym("x", 9), ca.SX.sym("s")
    terms = [x[k] * seed for k in range(8)]
    chain = graph_of(ca.Function("chain", [x, seed], [sum(terms[2:], terms[0] - terms[1]) * x[8]]))
    found = chain.with_early_sums(1)
    assert depth(found) < depth(chain)
    numbers = np.random.default_rng(3).normal(size=10)
    given = np.split(numbers, [9])
    assert evaluated(found, given) == pytest.approx(evaluated(chain, given), rel=1e-14)


def depth(graph: Graph) -> int:
    deep: list[int] = []
    for node in graph.nodes:
        deep.append(1 + max((deep[y] for y in node.operands), default=0))
    return max(deep[x] for result in graph.results for x in result)
