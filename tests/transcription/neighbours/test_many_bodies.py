"""Steps of many bodies, of which only the pairs that are near are computed, against steps with all pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from symphys import Body, Law, Plane, Scheme
from symphys.codegen import compile_program
from symphys.codegen.errors import ProgramError
from symphys.codegen.neighbours.kernel import CrowdKernel, compile_crowd
from symphys.codegen.runtime.kernel import ProcessorKernel
from symphys.dynamics import pgs
from symphys.dynamics.functions import trace_step
from symphys.dynamics.step import splits_of
from symphys.errors import SymphysError
from symphys.model.shapes import Terrain
from symphys.model.state_layout import Layout
from symphys.model.world import World, all_pairs
from symphys.transcription.neighbours.program import crowd_of, step_program

Array = NDArray[np.float64]
BODY = 19
"""Numbers of a body in a state."""
PLANES = (Plane("ground", (0, 0, 1), 0.0), Plane("wall", (1, 0, 0), -0.3))
LAW = Law(friction=0.4, restitution=0.5)
SCHEME = Scheme(newton_start=False, dt=0.01, sweeps=6)


def bodies(kinds: Sequence[str]) -> tuple[Body, ...]:
    """Spheres and capsules beside and above each other."""
    found = []
    for i, kind in enumerate(kinds):
        place = (0.24 * (i % 2) - 0.12, 0.24 * (i // 2 % 2), 0.15 + 0.24 * (i // 4))
        if kind == "sphere":
            found.append(Body.ball(f"b{i}", radius=0.1, mass=1.0, position=place))
        else:
            found.append(Body.capsule(f"b{i}", radius=0.06, length=0.2, mass=1.0, position=place))
    return tuple(found)


def starts(world: World, rows: int) -> Array:
    """(rows, numbers of a state): at different velocities."""
    random = np.random.default_rng(3)
    found = np.zeros((rows, len(world.bodies), BODY))
    found[:, :, :3] = [body.start["position"] for body in world.bodies]
    found[:, :, 3] = 1
    found[:, :, 7:10] = random.uniform(-1.5, 1.5, (rows, len(world.bodies), 3))
    return np.concatenate([found.reshape(rows, -1), np.zeros((rows, 1))], axis=1)


def in_order(world: World, law: Law) -> World:
    """With all pairs, in the order in which those of a crowd are computed."""
    count = len(world.bodies)
    species = [body.shapes[0].kind == "capsule" for body in world.bodies]

    def turn(pair: Any) -> tuple[int, ...]:
        a, b = pair.first.body, pair.second.body
        if b is None:
            return 0, species[a], pair.second.shape, a, pair.point
        return 1, species[a], species[b], (a + b) % count, a, pair.point

    return replace(world, pairs=tuple(sorted(all_pairs(world.bodies, world.statics, law), key=turn)))


class AllPairs:
    """Steps with all pairs, one by one."""

    def __init__(self, world: World, law: Law, scheme: Scheme) -> None:
        """Compile the step."""
        world = in_order(world, law)
        traced = trace_step(world, replace(scheme, cuts=splits_of(world, scheme)), exact=True)
        program, _ = step_program(world, traced.calls, {"u": 0, "p": 0, "smoothing": 1})
        self.kernel: ProcessorKernel = compile_program(program, lanes=1, threads=1, seeded=["x"])
        ends = [vector for call in traced.calls for vector in call.outputs if vector.name == "next"]
        self._order = np.concatenate([np.arange(traced.results[v].start, traced.results[v].stop) for v in ends])
        self.size, self.shown = Layout(world).size, BODY * len(world.bodies)

    def rollout(self, start: Array, steps: int) -> Array:
        """(steps + 1, size): all states."""
        states = np.zeros((steps + 1, self.size))
        states[0, : self.shown] = start[:-1]
        for k in range(steps):
            states[k + 1, self._order] = self.kernel.forward(states[k], [0.0])["x"].ravel()
        return states

    def slopes(self, states: Array, weights: Array) -> Array:
        """The gradient of the weighed last state by the first one's bodies."""
        gained = np.zeros(self.size)
        gained[: self.shown] = weights
        for state in states[-2::-1]:
            _, slopes = self.kernel.gradient(state, gained[self._order], [0.0])
            gained = slopes.ravel()
        return gained[: self.shown]


def given(kernel: CrowdKernel, rows: int) -> Array:
    """Nothing is smoothed."""
    return np.zeros((rows, kernel.crowd.given))


@pytest.fixture(autouse=True)
def _in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pairs are projected in the order in which they are listed."""
    monkeypatch.setattr(pgs, "projection_order", lambda constraints: list(range(len(constraints))))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kinds", "law"),
    [
        (["sphere"] * 6, LAW),
        (["sphere"] * 4, Law(friction=0.6, restitution=0.2, torsion=0.01, rolling=0.01)),
        (["sphere"] * 5 + ["capsule"], LAW),
        pytest.param(["capsule"] * 6, LAW, marks=pytest.mark.thorough),
    ],
    ids=["spheres", "torques", "mixed", "capsules"],
)
def test_near_pairs_are_all_that_matters(kinds: list[str], law: Law) -> None:
    """To the last bit, one scene alone and in lanes, and so are slopes up to rounding."""
    steps, world = 20, World(bodies(kinds), PLANES)
    crowd, every = crowd_of(world, law, SCHEME, exact=True), AllPairs(world, law, SCHEME)
    rows = starts(world, 3)
    wanted = [every.rollout(row, steps) for row in rows]
    random = np.random.default_rng(1)
    weights = np.zeros((len(rows), steps + 1, rows.shape[1]))
    weights[:, -1, :-1] = random.standard_normal((len(rows), every.shown))
    for lanes in (1,) if "capsule" in kinds else (1, 4):
        kernel = compile_crowd(crowd, lanes=lanes, threads=1)
        states, slopes = kernel.adjoints(rows, given(kernel, len(rows)), weights)
        assert (kernel.rollouts(rows, given(kernel, len(rows)), steps) == states).all()
        assert kernel.most[-1] < len(kinds) * (len(kinds) - 1) / 2  # or nothing would be left out
        for k, reference in enumerate(wanted):
            assert (states[k, :, :-1] == reference[:, : every.shown]).all()
            right = every.slopes(reference, weights[k, -1, :-1])
            assert slopes[k, :-1] == pytest.approx(right, abs=1e-9 * np.abs(right).max())


@pytest.mark.thorough
def test_boxes_are_those_of_all_pairs() -> None:
    """To rounding, which their blows magnify."""
    steps, sides = 20, (0.2, 0.2, 0.2)
    boxes = [Body.box(f"b{i}", sides, mass=1.0, position=(0.24 * i - 0.15, 0.02 * i, 0.13)) for i in range(3)]
    world = World(tuple(boxes), PLANES)
    kernel = compile_crowd(crowd_of(world, LAW, SCHEME, exact=True), lanes=1, threads=1)
    every, rows = AllPairs(world, LAW, SCHEME), starts(world, 3)
    weights = np.zeros((len(rows), steps + 1, rows.shape[1]))
    weights[:, -1, :-1] = np.random.default_rng(1).standard_normal((len(rows), every.shown))
    states, slopes = kernel.adjoints(rows, given(kernel, len(rows)), weights)
    for k, row in enumerate(rows):
        reference = every.rollout(row, steps)
        np.testing.assert_allclose(states[k, :, :-1], reference[:, : every.shown], atol=1e-7)
        right = every.slopes(reference, weights[k, -1, :-1])
        np.testing.assert_allclose(slopes[k, :-1], right, atol=1e-6 * np.abs(right).max())


@pytest.mark.slow
def test_room_for_pairs_grows() -> None:
    """More pairs than there is room for at first are computed none the less, with slopes, and in all lanes."""
    places = [(0.12 * (i % 3), 0.12 * (i // 3), 0.1) for i in range(9)]
    close = [Body.ball(f"b{i}", radius=0.1, mass=1.0, position=place) for i, place in enumerate(places)]
    world = World(tuple(close), PLANES[:1])
    kernel = compile_crowd(crowd_of(world, LAW, SCHEME, exact=True), lanes=4, threads=1)
    before = kernel.crowd.rooms[-1].members
    rows = starts(world, 5)
    weights = np.ones((5, 11, rows.shape[1]))
    states, slopes = kernel.adjoints(rows, given(kernel, 5), weights)
    assert kernel.most[-1] > before
    assert kernel.crowd.rooms[-1].members >= kernel.most[-1]
    for row, own, slope in zip(rows, states, slopes, strict=True):
        alone = kernel.adjoints(row[None], given(kernel, 1), weights[:1])
        assert (alone[0][0] == own).all()
        assert (alone[1][0] == slope).all()


@pytest.mark.slow
def test_no_number_is_read_before_it_is_computed() -> None:
    """Memories of work that hold no numbers give the same."""
    world = World(bodies(["sphere"] * 6), PLANES)
    rows, found = starts(world, 2), []
    for spoiled in (False, True):
        kernel = compile_crowd(crowd_of(world, LAW, SCHEME, exact=True), lanes=2, threads=1)
        if spoiled:
            kernel.prepare = lambda memory: memory.fill(np.nan)
        weights = np.zeros((2, 21, rows.shape[1]))
        weights[:, -1] = 1
        found.append((kernel.rollouts(rows, given(kernel, 2), 20), *kernel.adjoints(rows, given(kernel, 2), weights)))
    for one, other in zip(*found, strict=True):
        assert np.isfinite(one).all()
        assert (one == other).all()
    with pytest.raises(ProgramError, match=r"\(2, 3\).*\(batch, 115\)"):
        kernel.rollouts(rows[:, :3], given(kernel, 2), 1)


@pytest.mark.slow
def test_momentum_and_energy_stay() -> None:
    """A cloud of elastic spheres without friction and gravity: laws that hold however many bodies meet."""
    random, count = np.random.default_rng(5), 40
    places = [0.3 * np.array([i % 4, i // 4 % 4, i // 16]) for i in range(count)]
    balls = [Body.ball(f"b{i}", radius=0.1, mass=1.0, position=tuple(place)) for i, place in enumerate(places)]
    world = World(tuple(balls), gravity=(0.0, 0.0, 0.0))
    kernel = compile_crowd(crowd_of(world, Law(friction=0.0, restitution=1.0), SCHEME, exact=True), lanes=1, threads=1)
    start = starts(world, 1)
    start[0, :-1].reshape(count, BODY)[:, 7:10] = random.uniform(-2, 2, (count, 3))
    states = kernel.rollouts(start, given(kernel, 1), 60)[0, :, :-1].reshape(61, count, BODY)
    velocities = states[:, :, 7:10]
    momentum, turning = velocities.sum(axis=1), np.cross(states[:, :, :3], velocities).sum(axis=1)
    energy = (velocities**2).sum(axis=(1, 2)) / 2
    assert (velocities[-1] != velocities[0]).any(axis=1).sum() > count / 2
    assert momentum == pytest.approx(np.tile(momentum[0], (61, 1)), abs=1e-11)
    assert turning == pytest.approx(np.tile(turning[0], (61, 1)), abs=1e-11)
    assert energy == pytest.approx(energy[0], rel=1e-12)


def test_what_cannot_be_is_refused() -> None:
    """By the name of the body or the surface."""
    balls = bodies(["sphere"] * 3)
    heavy = Body.ball("heavy", radius=0.1, mass=100.0, position=(0, 0, 1))
    with pytest.raises(SymphysError, match=r"masses .*20"):
        crowd_of(World((*balls, heavy)), LAW, SCHEME)
    hills = Terrain("hills", lambda x, y: 0.1 * x * y)
    with pytest.raises(SymphysError, match=r'"hills" .*plane'):
        crowd_of(World(balls, (hills,)), LAW, SCHEME)
