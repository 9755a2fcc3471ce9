"""A step in pieces is the step as one expression; equal parts share their functions; sweeps are copied."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from symphys.shapes import Plane, Sphere
from symphys.state import Layout, initial_state
from symphys.step import Piece, Recording, Slot, record_step, step_function
from symphys.step.record import Recorder
from symphys.world import Body, Law, Scheme, World, make_world

INPUTS = ("a.force",)


def worlds() -> dict[str, World]:
    balls = [Body.ball(name, 0.1, 1.0) for name in "abc"]
    rod = Body("a", 2.0, (0.1, 0.1, 0.02), (Sphere(0.1, (0.2, 0, 0)), Sphere(0.1, (-0.2, 0, 0))))
    floor, wall = Plane.ground(), Plane("wall", (-1.0, 0, 0), -0.5)
    return {
        "one ball": make_world(balls[:1], [floor], Law(0.5, 0.5)),
        "cut steps": make_world(balls, [floor, wall], Law(0.5, 0.5, torsion=0.01, rolling=0.01)),
        "compound": make_world([rod, balls[1]], [floor], Law(0.3, 0.2)),
        "soft": make_world(balls, [floor], Law(0.5, 0.0, frequency=5.0)),
    }


def evaluate(piece: Piece, values: dict[Slot, np.ndarray]) -> np.ndarray:
    """What a piece gives."""
    (result,) = piece.function.call([ca.DM(values[slot]) for slot in piece.inputs])
    return np.array(ca.DM(result)).ravel()


def run(recording: Recording, layout: Layout, x: np.ndarray, u: np.ndarray, knob: float) -> np.ndarray:
    """The next state, piece by piece."""
    values: dict[Slot, np.ndarray] = {}
    after = np.zeros(layout.size)
    for piece in recording.pieces:
        for slot in piece.inputs:
            if slot.name in layout:
                values[slot] = x[layout[slot.name]]
            elif slot.name:
                values[slot] = {"u": u, "p": np.zeros(0), "smoothing": np.array([knob])}[slot.name]
        values[piece.output] = evaluate(piece, values)
        if piece.output in recording.results:
            after[recording.results[piece.output]] = values[piece.output]
    return after


@pytest.mark.parametrize("name", worlds())
@pytest.mark.parametrize("scheme", [Scheme(sweeps=5), Scheme(sweeps=2, warm_start=False), Scheme(sweeps=1)])
def test_pieces_give_the_whole_step(name: str, scheme: Scheme) -> None:
    world = worlds()[name]
    layout = Layout(world)
    whole, pieces = step_function(world, scheme, INPUTS), record_step(world, scheme, INPUTS)
    rng = np.random.default_rng(1)
    x = np.array(initial_state(world, {f"{b.name}.position": [0.25 * i, 0, 0.1] for i, b in enumerate(world.bodies)}))
    x = x.ravel()
    for k in range(12):
        u = rng.normal(0, 5, 3)
        expected = np.array(whole(x, u, [], 1e-3 * (k % 2))).ravel()
        got = run(pieces, layout, x, u, 1e-3 * (k % 2))
        assert got == pytest.approx(expected, rel=1e-9, abs=1e-9), k
        x = expected
        x[layout["a.velocity"]] += rng.normal(0, 0.5, 3)


def test_equal_parts_share_their_functions() -> None:
    """Twenty balls that roll on the ground need no more functions than two, nor do many sweeps."""

    def distinct(count: int, sweeps: int) -> int:
        balls = [Body.ball(f"ball{i}", 0.1, 1.0) for i in range(count)]
        ground = make_world(balls, [Plane.ground()], Law(0.5, 0.5))
        apart = World(ground.bodies, ground.statics, tuple(p for p in ground.pairs if p.second.body is None))
        return len({piece.function.__hash__() for piece in record_step(apart, Scheme(sweeps=sweeps)).pieces})

    assert distinct(20, 10) == distinct(2, 10) == distinct(2, 40)


def test_what_is_kept_is_computed_once() -> None:
    recorder = Recorder()
    x = recorder.argument("x", 2)
    square = x[0] ** 2
    kept = recorder.keep({"a": (square, x[1]), "b": [ca.vertcat(square, 3.0)]})
    assert len(recorder.pieces) == 1
    assert recorder.pieces[0].output.size == 1
    assert kept["a"][1].element_hash() == x[1].element_hash()
    assert kept["b"][0][0].element_hash() == kept["a"][0].element_hash()
    assert recorder.keep(kept) is kept


def test_sweeps_that_change_places_are_not_copied() -> None:
    """Where a state's numbers change their order from one time to the next, copying pieces would be wrong."""
    recorder = Recorder()
    x = recorder.argument("x", 2)

    def turn(state: ca.SX) -> ca.SX:
        return recorder.keep(ca.vertcat(state[1] + 1, 2 * state[0]))

    recorder.give("next", recorder.repeat(6, turn, x))
    values = np.array([1.0, 2.0])
    memory = {slot: values for piece in recorder.pieces for slot in piece.inputs if slot.name == "x"}
    for piece in recorder.pieces:
        memory[piece.output] = evaluate(piece, memory)
    expected = values
    for _ in range(6):
        expected = np.array([expected[1] + 1, 2 * expected[0]])
    assert memory[recorder.pieces[-1].output] == pytest.approx(expected)
