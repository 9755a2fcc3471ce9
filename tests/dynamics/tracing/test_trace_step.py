"""A step in pieces is the step as one expression; equal parts share their functions; sweeps are copied."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import first, thorough

from symphys.dynamics.functions import TracedStep, step_function, trace_step
from symphys.dynamics.tracing.decorator import repeat, shared, traced, tracing
from symphys.dynamics.tracing.recording import (
    MAX_ALIKE_FUNCTIONS,
    Recorder,
    TracedCall,
    TracedVector,
    without_dead_code,
)
from symphys.maths.verbatim import verbatim
from symphys.model.shapes import Box, Capsule, Fixture, Plane, Sphere, Terrain
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Scheme, World, make_world

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


def shapes() -> World:
    """A box on a static box, a capsule on terrain and on the box."""
    box = Body("a", 1.0, (0.02, 0.03, 0.04), (Box((0.2, 0.15, 0.1)),))
    capsule = Body("b", 1.0, (0.02, 0.02, 0.01), (Capsule(0.1, 0.2, (0, 0.02, 0)),))
    hills = Terrain("hills", lambda x, y: 0.1 * ca.sin(3 * x) * ca.cos(2 * y))
    world = make_world([box, capsule], [hills, Fixture("slab", Box((1.0, 1.0, 0.2), (0.5, 0, -0.15)))], Law(0.5, 0.3))
    kept = ("a-slab", "b-hills", "a-b")
    return World(world.bodies, world.statics, tuple(p for p in world.pairs if p.name.split(":")[0] in kept))


def evaluate(piece: TracedCall, values: dict[TracedVector, np.ndarray]) -> dict[TracedVector, np.ndarray]:
    """What a piece gives."""
    results = piece.function.call([ca.DM(values[slot]) for slot in piece.inputs])
    return {slot: np.array(ca.DM(result)).ravel() for slot, result in zip(piece.outputs, results, strict=True)}


def run(
    recording: TracedStep, layout: Layout, x: np.ndarray, u: np.ndarray, smoothing: float, p: Any = ()
) -> np.ndarray:
    """The next state, piece by piece."""
    values: dict[TracedVector, np.ndarray] = {}
    after = np.zeros(layout.size)
    for piece in recording.calls:
        for slot in piece.inputs:
            if slot.name in layout:
                values[slot] = x[layout[slot.name]]
            elif slot.name:
                values[slot] = {"u": u, "p": np.array(p), "smoothing": np.array([smoothing])}[slot.name]
        values |= evaluate(piece, values)
        for slot in recording.results.keys() & set(piece.outputs):
            after[recording.results[slot]] = values[slot]
    return after


@pytest.mark.slow
@pytest.mark.parametrize("name", [thorough(name) if name == "compound" else name for name in worlds()])
@first("scheme", [Scheme(sweeps=5), Scheme(sweeps=2, warm_start=False), Scheme(sweeps=1)])
def test_pieces_give_the_whole_step(name: str, scheme: Scheme) -> None:
    compare(worlds()[name], scheme)


@pytest.mark.thorough
def test_pieces_give_the_whole_step_of_other_shapes() -> None:
    compare(shapes(), Scheme(sweeps=2, cuts=0))


def compare(world: World, scheme: Scheme) -> None:
    """Twelve steps, pushed about, with and without smoothing."""
    layout = Layout(world)
    whole, pieces = step_function(world, scheme, INPUTS), trace_step(world, scheme, INPUTS)
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
    """Many balls that roll on the ground need no more functions than two, nor do many sweeps."""

    def distinct(count: int, sweeps: int) -> int:
        balls = [Body.ball(f"ball{i}", 0.1, 1.0) for i in range(count)]
        ground = make_world(balls, [Plane.ground()], Law(0.5, 0.5))
        apart = World(ground.bodies, ground.statics, tuple(p for p in ground.pairs if p.second.body is None))
        return len({piece.function.__hash__() for piece in trace_step(apart, Scheme(sweeps=sweeps)).calls})

    assert distinct(11, 10) == distinct(2, 10) == distinct(2, 40)
    assert distinct(30, 10) == distinct(20, 10)  # with so many pairs there is a broad phase


def test_feet_at_other_places_share_their_functions() -> None:
    """Feet of one body differ in where they are and how large, not in what is computed."""

    def operations(count: int) -> int:
        feet = tuple(Sphere(0.01 + 0.001 * k, (0.1 + 0.01 * k, 0.2 - 0.03 * k, -0.1 - 0.001 * k)) for k in range(count))
        world = make_world([Body("a", 1.0, (0.02, 0.03, 0.04), feet)], [Plane.ground()], Law(0.5))
        pieces = {piece.function.__hash__(): piece.function for piece in trace_step(world, Scheme(sweeps=4)).calls}
        return sum(function.n_instructions() for function in pieces.values())

    assert operations(8) < 1.08 * operations(6)  # what is left takes sums over all of them


def test_a_shared_function_takes_copies_where_its_arguments_lie_in_many_ways() -> None:
    recorder, columns = Recorder(), [ca.SX.sym("x", size) for size in range(3, 9)]
    for k, column in enumerate(columns):
        recorder.argument(f"x{k}", column)

    @shared
    def product(a: ca.SX, b: ca.SX) -> ca.SX:
        return a * b

    with tracing(recorder):
        for column in columns:
            product(column[0], column[2])
    pieces = [call.function for call in recorder.calls]
    multiplying = [piece for piece in pieces if ca.OP_MUL in map(piece.instruction_id, range(piece.n_instructions()))]
    assert len(multiplying) == len(columns)
    assert len({piece.__hash__() for piece in multiplying}) == MAX_ALIKE_FUNCTIONS + 1  # one takes copies


def test_equal_parts_share_a_function_and_numbers_in_passing_are_no_part_of_it() -> None:
    recorder = Recorder()
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 2)
    recorder.argument("x", x)
    recorder.argument("y", y)

    @traced
    def part(tree: dict[str, ca.SX]) -> tuple[ca.SX, ca.SX, ca.SX]:
        return tree["a"] ** 2, tree["b"], ca.SX(3)

    with tracing(recorder):
        square, passed, constant = part({"a": x[0], "b": x[1]})
        again, *_ = part({"a": y[0], "b": y[1]})
    first, second = recorder.calls
    assert first.function is second.function
    assert (first.outputs[0].size, first.inputs[0].name, second.inputs[0].name) == (1, "x", "y")
    assert recorder.value(passed).element_hash() == x[1].element_hash()
    assert float(recorder.value(constant)) == 3
    assert recorder.value(square).element_hash() != recorder.value(again).element_hash()


def test_members_of_a_tuple_look_alike_to_what_comes_next() -> None:
    recorder, x = Recorder(), ca.SX.sym("x", 4)
    recorder.argument("x", x)
    with tracing(recorder):
        for pair in multiples(x):
            added(*pair)
    _, first, second = recorder.calls
    assert first.function is second.function
    assert first.inputs[0] != second.inputs[0]


@traced
def multiples(x: ca.SX) -> tuple[tuple[ca.SX, ca.SX], ...]:
    return ((2 * x[0], 3 * x[1]), (4 * x[2], 5 * x[3]))


@traced
def added(a: ca.SX, b: ca.SX) -> ca.SX:
    return a + b


def test_what_is_asked_for_twice_is_computed_once() -> None:
    recorder, x = Recorder(), ca.SX.sym("x", 2)
    recorder.argument("x", x)
    with tracing(recorder):
        first, second, other = (added(*pair) for pair in ((x[0], x[1]), (x[0], x[1]), (x[0], 2.0)))
    assert first == second != other
    assert len(recorder.calls) == 2


def test_arithmetic_between_traced_calls_is_traced() -> None:
    """Operators of a traced matrix are parts of their own, on either side; so are named arguments."""
    recorder, x = Recorder(), ca.SX.sym("x", 2)
    recorder.argument("x", x)
    with tracing(recorder):
        a, b = added(x[0], b=1.0), added(x[0], b=x[1])
        results = [a - b, 1 - a, a * 2, ca.SX(3) / b, -b, a < b, a > 1]
    recorder.give("next", results)
    memory = {slot: np.array([3.0, 5.0]) for slot in recorder.calls[0].inputs}
    for piece in recorder.calls:
        memory |= evaluate(piece, memory)
    assert memory[recorder.calls[-1].outputs[0]] == pytest.approx([-4, -3, 8, 3 / 8, -8, 1, 1])


def test_a_traced_function_is_a_plain_one_without_a_tracer() -> None:
    assert added(2.0, 3.0) == 5.0
    assert float(repeat(6, turn, 2.0, ca.DM([1, 2]))[0]) == 15.0


def test_what_nobody_reads_is_left_out() -> None:
    """Of a record of four words one is read, by way of a part of which one result is read; another part not at all."""
    recorder, x = Recorder(), ca.SX.sym("x", 4)
    recorder.argument("x", x)
    with tracing(recorder):
        squares = traced(lambda x: x * x)(x)
        traced(lambda squares: ca.sin(squares))(squares)
        root, _ = traced(lambda squares: (ca.sqrt(squares[2]), ca.exp(squares[1])))(squares)
    recorder.give("next", [root])
    left = without_dead_code(recorder.calls)
    assert [(piece.function.nnz_in(), piece.function.nnz_out()) for piece in left] == [(4, 1), (1, 1), (1, 1)]
    values = {left[0].inputs[0]: np.array([1.0, 2.0, 3.0, 4.0])}
    for piece in left:
        values |= evaluate(piece, values)
    assert values[left[-1].outputs[0]] == pytest.approx([3.0])


@traced
def turn(factor: float, state: ca.SX) -> ca.SX:
    return ca.vertcat(state[1] + 1, factor * state[0])


def test_sweeps_that_change_places_are_right() -> None:
    """Each number moves to another place every time."""
    recorder, x = Recorder(), ca.SX.sym("x", 2)
    recorder.argument("x", x)
    with tracing(recorder):
        turned = repeat(6, turn, 2.0, x)
    recorder.give("next", [turned])
    values = np.array([1.0, 2.0])
    memory = {slot: values for piece in recorder.calls for slot in piece.inputs if slot.name == "x"}
    for piece in recorder.calls:
        memory |= evaluate(piece, memory)
    expected = values
    for _ in range(6):
        expected = np.array([expected[1] + 1, 2 * expected[0]])
    assert memory[recorder.calls[-1].outputs[0]] == pytest.approx(expected)


def test_parameters_in_expressions_have_a_piece() -> None:
    """A mass that follows from a radius is computed, once a step."""
    radius = ca.SX.sym("radius")
    world = make_world([Body.ball("ball", radius, 1000 * radius**3)], [Plane.ground()])
    recording = trace_step(world, parameters=[radius])
    assert run(recording, Layout(world), *start(world), 0.0, np.array([0.1])) == pytest.approx(
        np.array(step_function(world, parameters=[radius])(start(world)[0], [], 0.1, 0)).ravel()
    )


def start(world: World) -> tuple[np.ndarray, np.ndarray]:
    """(x, u) at the start, above the ground."""
    return np.array(initial_state(world, {"ball.position": [0, 0, 0.1]})).ravel(), np.zeros(0)


@pytest.mark.slow
def test_a_step_as_one_expression_has_the_bits_of_its_calls() -> None:
    """Casadi simplifies nothing across them; with these velocities results differed from the fourteenth step on."""
    places = [(0.24 * (i % 2) - 0.12, 0.24 * (i // 2), 0.15) for i in range(4)]
    balls = [Body.ball(f"b{i}", radius=0.1, mass=1.0, position=place) for i, place in enumerate(places)]
    world = make_world(balls, [Plane.ground(), Plane("wall", (1, 0, 0), -0.3)], Law(friction=0.4, restitution=0.5))
    scheme = Scheme(dt=0.01, sweeps=6)
    whole, traced, layout = step_function(world, scheme), trace_step(world, scheme), Layout(world)
    velocities = np.random.default_rng(3).uniform(-1.5, 1.5, (4, 3))
    x = np.array(ca.DM(initial_state(world, {f"b{i}.velocity": velocities[i] for i in range(4)}))).ravel()
    for _ in range(25):
        after = run(traced, layout, x, np.zeros(0), 0.0)
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
