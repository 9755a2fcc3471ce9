"""A step as one expression has the bits of its calls: casadi simplifies nothing across them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from symphys import Body, Law, Plane, Scheme, step_function
from symphys.codegen.program.interpret import interpret
from symphys.dynamics.functions import trace_step
from symphys.maths.verbatim import verbatim
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import World, all_pairs
from symphys.transcription.neighbours.program import step_program

SCHEME = Scheme(dt=0.01, sweeps=6)
VELOCITIES = np.random.default_rng(3).uniform(-1.5, 1.5, (4, 3))
"""With these the two differed from the fourteenth step on."""


@pytest.mark.slow
def test_a_heap_step_by_step() -> None:
    places = [(0.24 * (i % 2) - 0.12, 0.24 * (i // 2), 0.15) for i in range(4)]
    balls = tuple(Body.ball(f"b{i}", radius=0.1, mass=1.0, position=place) for i, place in enumerate(places))
    planes = Plane.ground(), Plane("wall", (1, 0, 0), -0.3)
    law = Law(friction=0.4, restitution=0.5)
    world = World(balls, planes, all_pairs(balls, planes, law))
    whole, traced, size = step_function(world, SCHEME), trace_step(world, SCHEME), Layout(world).size
    program, _ = step_program(world, traced.calls, {"u": 0, "p": 0, "smoothing": 1})
    ends = [vector for call in traced.calls for vector in call.outputs if vector.name == "next"]
    order = np.concatenate([np.arange(size)[traced.results[vector]] for vector in ends])
    starts = {f"b{i}.velocity": VELOCITIES[i] for i in range(4)}
    x = np.array(ca.DM(initial_state(world, starts))).ravel()
    for _ in range(25):
        after = np.empty(size)
        after[order] = interpret(program, x, [0.0])["x"]
        np.testing.assert_array_equal(np.array(whole(x, [], [], 0)).ravel(), after)
        x = after


def test_verbatim_expressions_may_be_nested() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    back = ca.Function("back", [x, y], [x + y])
    with verbatim():
        with verbatim():
            pass
        kept = back(x - y, y)
    assert kept.n_dep() == 2
    assert ca.is_equal(back(x - y, y), x)
    assert float(ca.Function("kept", [x, y], [kept])(1e-20, 1.0)) == 0
