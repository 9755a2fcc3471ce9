"""What steps have in common is built once, and each is the one that is built alone, to the bit."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import thorough

from symphys.dynamics.functions import report_function, step_function, trace_step
from symphys.dynamics.tracing import trace
from symphys.model.shapes import Plane
from symphys.model.state_layout import initial_state
from symphys.model.world import Body, Law, Scheme, World, make_world

INPUTS = ("a.force",)
SCHEME = Scheme(dt=0.02, sweeps=3, position_sweeps=1, cuts=0)
OTHERS = [replace(SCHEME, sweeps=6), replace(SCHEME, dt=0.01)]


def world_of(name: str) -> World:
    """Balls, or a ball and a box, that touch the floor or nearly do."""
    floor, wall = Plane.ground(), Plane("wall", (-1.0, 0, 0), -0.5)
    ball = Body.ball("a", 0.1, 1.0, position=(0.5, 0, 0.12))
    if name == "balls":
        other = Body.ball("b", 0.1, 1.0, position=(0.25, 0, 0.1))
        return make_world([ball, other], [floor, wall], Law(0.5, 0.5, torsion=0.01, rolling=0.01))
    box = Body.box("b", (0.2, 0.15, 0.1), 1.0, position=(0, 0, 0.06))
    return make_world([ball, box], [floor], Law(0.5, 0.3))


def same(one: ca.Function, other: ca.Function, world: World) -> None:
    """Both give the same bits, at states of which some touch the floor; some steps differ from standing still."""
    random, start = np.random.default_rng(0), np.array(initial_state(world)).ravel()
    moved = 0
    for _ in range(8):
        x = start + 0.1 * random.standard_normal(start.size)
        found, wanted = (
            np.concatenate([np.array(part).ravel() for part in f.call([x, np.ones(3), [], 0.01])]) for f in (one, other)
        )
        np.testing.assert_array_equal(found, wanted)
        moved += not np.array_equal(found[: start.size], x)
    assert moved


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """What is built from now on, when nothing has been built before."""
    found, build = list[object](), trace.Tracer._build

    def noted(self: trace.Tracer, function: Any, *given: Any) -> trace.Template:
        found.append(function)
        return build(self, function, *given)

    monkeypatch.setattr(trace, "_CACHE", trace.TraceCache())
    monkeypatch.setattr(trace.Tracer, "_build", noted)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", ["balls", thorough("box")])
def test_a_step_of_pieces_that_were_there_is_that_built_alone(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    world, asked = (
        world_of(name),
        [(step_function, SCHEME), (report_function, SCHEME), *product([step_function], OTHERS)],
    )
    together = [make(world, scheme, INPUTS) for make, scheme in asked]
    for (make, scheme), step in zip(asked, together, strict=True):
        monkeypatch.setattr(trace, "_CACHE", trace.TraceCache())
        same(step, make(world, scheme, INPUTS), world)


@pytest.mark.slow
def test_what_steps_have_in_common_is_built_once(builds: list[object]) -> None:
    counts = []
    for scheme in (SCHEME, *OTHERS):
        step_function(world_of("box"), scheme, INPUTS)
        counts.append(len(builds) - sum(counts))
    first, sweeps, dt = counts
    assert sweeps < 0.3 * first and dt < 0.8 * first
    report_function(world_of("box"), SCHEME, INPUTS)
    assert len(builds) - sum(counts) < 0.3 * first


def test_another_world_of_the_same_parts_builds_nothing(builds: list[object], monkeypatch: pytest.MonkeyPatch) -> None:
    """Until so much is kept that the next one begins anew."""
    steps, counts = [], []
    for _ in range(2):
        steps.append(trace_step(world_of("balls"), SCHEME))
        counts.append(len(builds))
    assert counts[0] == counts[1] > 0
    one, other = ([call.function.serialize() for call in step.calls] for step in steps)
    assert one == other
    monkeypatch.setattr(trace, "MAX_TEMPLATES", 0)
    trace_step(world_of("balls"), SCHEME)
    assert len(builds) == 2 * counts[0]
