"""Steps of one world under several schemes are built together, and are those that are built alone, to the bit."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from symphys.dynamics.functions import InlineSteps, report_function, step_function
from symphys.dynamics.tracing.trace import Tracer
from symphys.model.shapes import Plane
from symphys.model.state_layout import initial_state
from symphys.model.world import Body, Law, Scheme, World, make_world

INPUTS = ("a.force",)
SCHEME = Scheme(dt=0.02, sweeps=3, position_sweeps=1, cuts=0)
OTHERS = {"sweeps": replace(SCHEME, sweeps=6), "dt": replace(SCHEME, dt=0.01)}


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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["balls", "box"])
def test_steps_that_are_built_together_are_those_built_alone(name: str) -> None:
    world = world_of(name)
    steps = InlineSteps(world, INPUTS)
    same(steps.step(SCHEME), step_function(world, SCHEME, INPUTS), world)
    same(steps.report(SCHEME), report_function(world, SCHEME, INPUTS), world)
    for scheme in OTHERS.values():
        same(steps.step(scheme), step_function(world, scheme, INPUTS), world)


@pytest.mark.slow
def test_what_steps_have_in_common_is_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    built, build = 0, Tracer._build

    def counted(*arguments):  # type: ignore[no-untyped-def]
        nonlocal built
        built += 1
        return build(*arguments)

    monkeypatch.setattr(Tracer, "_build", counted)
    counts, steps = [], InlineSteps(world_of("box"), INPUTS)
    for scheme in (SCHEME, OTHERS["sweeps"], OTHERS["dt"]):
        steps.step(scheme)
        counts.append(built)
        built = 0
    first, sweeps, dt = counts
    assert sweeps < 0.3 * first and dt < 0.8 * first
    steps.report(SCHEME)
    assert built < 0.3 * first
