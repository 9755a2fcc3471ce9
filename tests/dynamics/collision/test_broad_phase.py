"""Pairs that are far give no impulse; that changes no motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from tools.repeats import thorough
from worlds.heaps import heap

import symphys
from symphys import step_function
from symphys.dynamics.collision import broad_phase
from symphys.dynamics.collision.broad_phase import near_pairs
from symphys.dynamics.context import StepContext, make_context
from symphys.model import Body, Law, Layout, Plane, Scheme, initial_state, make_world
from symphys.model.shapes import Box, Capsule


def world_of(places: list[tuple[float, float, float]]) -> symphys.model.World:
    balls = [Body.ball(f"b{i}", 0.1, 1.0, position=place) for i, place in enumerate(places)]
    return make_world(balls, [Plane.ground()], Law(0.5, 0.5))


def near(world: symphys.model.World, smoothing: float = 0.0, velocity: tuple[float, ...] = (0, 0, 0)) -> dict[str, int]:
    context = make_context(world, Scheme(dt=0.01), (), ca.SX(0, 1), ca.SX(smoothing))
    layout, x = Layout(world), initial_state(world, {"b0.velocity": velocity})
    found = near_pairs(context, {name: ca.SX(x[layout[name]]) for name in layout.names()})
    return {pair.name: int(each) for pair, each in zip(world.pairs, found, strict=True)}


LINE = [(0.0, 0.0, 0.1), (0.0, 0.0, 0.35), (0.0, 0.0, 0.9), (5.0, 0.0, 3.0), (5.0, 5.0, 3.0)]


def test_what_is_apart_by_more_than_the_way_of_a_step_is_far() -> None:
    found = near(world_of(LINE))
    assert {name for name, each in found.items() if each} == {"b0-ground"}


def test_speed_brings_pairs_near() -> None:
    found = near(world_of(LINE), velocity=(0, 0, 4))
    assert {name for name, each in found.items() if each} == {"b0-ground", "b0-b1"}


def rods(places: list[tuple[float, float, float]]) -> symphys.model.World:
    """Upright capsules, 0.4 m from end to end."""
    rod = Body("rod", 1.0, (0.02, 0.02, 0.005), (Capsule(0.05, 0.15),))
    bodies = [replace(rod, name=f"b{i}", start={"position": place}) for i, place in enumerate(places)]
    return make_world(bodies, [Plane.ground()], Law(0.5, 0.5))


def test_of_capsules_the_points_that_may_touch_are_near() -> None:
    """The spheres around them overlap, but only neighbouring ends and what is between are within reach."""
    apart = [(0, 0, 3), (0.3, 0, 3), (0.01, 0, 3.405), (5, 0, 1), (5, 5, 1), (9, 5, 1)]
    found = near(rods(apart), velocity=(0, 0, 0.5))
    assert {name for name, each in found.items() if each} == {"b0-b2:1", "b0-b2:2", "b0-b2:4"}


def test_a_corner_over_the_ground_is_near_by_itself() -> None:
    box = Body("b0", 1.0, (0.02, 0.02, 0.02), (Box((0.1, 0.1, 0.1)),))
    balls = [Body.ball(f"b{i}", 0.1, 1.0, position=(2.0 * i, 0, 3)) for i in range(1, 5)]
    world = make_world([box, *balls], [Plane.ground()], Law(0.5, 0.5))
    x, layout = np.array(initial_state(world)).ravel(), Layout(world)
    x[layout["b0.position"]], half = (0, 0, 0.13), np.radians(20) / 2
    x[layout["b0.orientation"]] = (np.cos(half), np.sin(half), 0, 0)
    context = make_context(world, Scheme(dt=0.01), (), ca.SX(0, 1), ca.SX(0))
    found = near_pairs(context, {name: ca.SX(x[layout[name]]) for name in layout.names()})
    words = [int(each) for pair, each in zip(world.pairs, found, strict=True) if pair.first.body == 0]
    assert sum(words[:8]) == 2
    assert sum(words[8:]) == 0


def test_with_smoothing_all_are_near() -> None:
    assert all(near(world_of(LINE), smoothing=1e-3).values())


def test_a_frame_without_mass_brings_nothing_near() -> None:
    """Its mass divides nothing: reaches are numbers, and what is far stays far."""
    bodies = [Body.ball(f"b{i}", 0.1, 1.0, position=place) for i, place in enumerate(LINE)]
    frame = Body.frame("frame", position=(9.0, 0.0, 1.0))
    bob = Body.ball("bob", 0.1, 1.0, position=(9.0, 0.0, 1.0))
    along = symphys.model.Slider("along", ("world", "frame"), axis=(1, 0, 0))
    up = symphys.model.Slider("up", ("frame", "bob"), axis=(0, 0, 1))
    world = make_world([*bodies, frame, bob], [Plane.ground()], Law(0.5, 0.5), joints=[along, up])
    found = near(world)
    assert (found["b0-ground"], found["b0-b1"]) == (1, 0)


def test_where_there_are_few_pairs_nothing_is_looked_at() -> None:
    world = world_of(LINE[:3])
    context: StepContext = make_context(world, Scheme(), (), ca.SX(0, 1), ca.SX(0))
    assert near_pairs(context, {}) == ()


@pytest.mark.slow
@pytest.mark.parametrize("kinds", [["sphere"] * 6, thorough(["capsule", "box", "sphere", "sphere", "capsule"])])
def test_motions_are_those_without_a_broad_phase(
    kinds: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bodies that fall, hit each other and walls, and come to lie on each other."""
    path = tmp_path / "heap.toml"
    path.write_text(heap(kinds), "utf-8")
    world = symphys.load(path).world()
    states = []
    for fewest in (broad_phase.MIN_PAIRS, 1000):
        monkeypatch.setattr(broad_phase, "MIN_PAIRS", fewest)
        step, layout = step_function(world, Scheme(dt=0.01, sweeps=6)), Layout(world)
        random = np.random.default_rng(7)
        start = initial_state(world, {f"b{i}.velocity": random.uniform(-2, 2, 3) for i in range(len(kinds))})
        x = [np.array(ca.DM(start)).ravel()]
        for _ in range(60):
            x.append(np.array(step(x[-1], [], [], 0)).ravel())
        states.append(np.array(x))
    assert np.ptp(states[0][:, layout["b0.position"]], axis=0).max() > 0.1
    assert states[0] == pytest.approx(states[1], abs=1e-12)
