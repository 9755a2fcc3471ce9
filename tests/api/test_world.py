"""Worlds that were built in Python become problems: the same bodies, contacts and joints, which move alike."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from worlds.mixed import mixed

import symphys
from symphys import Problem, SymphysError
from symphys.dynamics.functions import step_function
from symphys.model import Body, Box, Capsule, Fixture, Law, Plane, Scheme, Terrain, World, make_world
from symphys.model.heightfield import Heightfield
from symphys.model.joints import HINGE, Joint, JointFrame
from symphys.model.state_layout import Layout, initial_state

TURNED = (np.cos(0.3), 0.0, np.sin(0.3), 0.0)


def scene() -> World:
    """Every kind of shape and of what stands still, and two laws."""
    bodies = [
        Body.ball("ball", 0.1, 0.5),
        Body("die", 1.0, (0.02, 0.03, 0.04), (Box((0.2, 0.15, 0.1)),)),
        Body("club", 0.7, (0.02, 0.02, 0.01), (Capsule(0.05, 0.2, (0, 0.02, 0)), Box((0.1, 0.1, 0.1), (0.2, 0, 0)))),
    ]
    hills = Terrain("hills", Heightfield(((0.0, 0.1), (0.2, 0.0)), (1.0, 1.0), (-0.5, -0.5)))
    slab, wall = Fixture("slab", Box((1, 1, 0.2), (3, 0, 0))), Plane("wall", (-1.0, 0.0, 0.0), -3.0)
    world = make_world(bodies, [Plane.ground(-0.5), wall, slab, hills], Law(0.4, 0.3, torsion=0.01), gravity=(0, 0, -5))
    pairs = [replace(pair, law=Law(0.1)) if pair.name.startswith("ball-slab") else pair for pair in world.pairs]
    return replace(world, pairs=tuple(pair for pair in pairs if not pair.name.startswith("ball-wall")))


@pytest.mark.slow
def test_a_world_is_what_the_file_says() -> None:
    """The same shapes, masses, laws and gravity; who may touch whom."""
    world, start = scene(), {f"{name}.position": [k, -k, 2.0] for k, name in enumerate(("ball", "die", "club"))}
    start |= {"die.orientation": list(TURNED), "club.velocity": [1, 0, 0]}
    made = Problem.from_world(world, start, duration=0.1)
    found = made.world()
    assert {pair.name: pair.law for pair in found.pairs} == {pair.name: pair.law for pair in world.pairs}
    assert tuple(map(float, found.gravity)) == (0, 0, -5)
    some = list(dict.fromkeys(pair.name.partition(":")[0] for pair in world.pairs))[::5]  # all would take half a minute
    kept = [tuple(pair for pair in each.pairs if pair.name.partition(":")[0] in some) for each in (world, found)]
    few = [replace(each, pairs=pairs) for each, pairs in zip((world, found), kept, strict=True)]
    states = [np.array(initial_state(*each)) for each in zip(few, (start, made.initial), strict=True)]
    assert np.allclose(states[0], states[1], atol=1e-15)
    steps = [step_function(each, Scheme(dt=0.01, cuts=0)) for each in few]
    after = [np.array(step(x, [], [], 0)) for step, x in zip(steps, states, strict=True)]
    assert np.allclose(*after, rtol=0, atol=1e-12)


@pytest.mark.thorough
def test_joints_move_alike() -> None:
    """Of every kind, on either side of bodies, with motors, springs and limits; thirty steps, all bent at the start."""
    world, start = mixed()
    made = Problem.from_world(world, start, duration=0.3)
    commands = [f"{joint.name}.command" for joint in world.joints if joint.driven]
    states = [np.array(initial_state(*each)) for each in ((world, start), (made.world(), made.initial))]
    layout = Layout(world)
    poses = [name for name in layout.names() if not name.endswith(".unwrapped")]  # these tell whole turns only
    assert all(np.allclose(*(x[layout[name]] for x in states), rtol=0, atol=1e-12) for name in poses)
    ends = []
    for each, x in zip((world, made.world()), states, strict=True):
        step = step_function(each, Scheme(dt=0.01, sweeps=5), commands)
        for _ in range(30):
            x = step(x, np.full(len(commands), 0.5), [], 0)
        ends.append(np.array(x[Layout(each)["b4.position"]]))
    assert np.allclose(*ends, rtol=0, atol=1e-9)
    assert {joint.name: joint.limits for joint in made.world().joints} == {j.name: j.limits for j in world.joints}


def test_joints_that_do_not_hold_are_refused() -> None:
    """A body beside its joint; a loop whose coordinates are not 0."""
    world, start = mixed()
    with pytest.raises(SymphysError, match=r"joint 'hinge0': .*0\.1 m"):
        Problem.from_world(world, start | {"b1.position": start["b1.position"] + [0.1, 0, 0]}, duration=0.3)
    rod = Body("rod", 1.0, 0.1)
    frames = (JointFrame((0, 0, 0.5)), JointFrame())
    loop = World((rod,), joints=tuple(Joint(name, HINGE, 0, None, frames) for name in ("one", "other")))
    turned = {"rod.orientation": [np.cos(0.2), np.sin(0.2), 0, 0]}
    turned["rod.position"] = [0, 0.5 * np.sin(0.4), -0.5 * np.cos(0.4)]
    with pytest.raises(SymphysError, match=r"'other': .*loop"):
        Problem.from_world(loop, turned, duration=0.3)


def test_what_a_file_cannot_say_is_named() -> None:
    ball = Body.ball("ball", 0.1, 0.5)
    for world, said in (
        (make_world([Body.ball("ball", ca.SX.sym("r"), 1.0)]), "no number"),
        (make_world([ball], [Terrain("hills", lambda x, y: ca.if_else(x > 0, x, 0))]), "hills"),
    ):
        with pytest.raises(SymphysError, match=said):
            Problem.from_world(world, duration=1.0)
    with pytest.raises(SymphysError, match=r"bal\.position"):
        Problem.from_world(make_world([ball]), {"bal.position": [0, 0, 1]}, duration=1.0)


def test_further_tables_and_formulas() -> None:
    made = Problem.from_world(
        make_world([Body.ball("ball", 0.1, 0.5)], [Plane.ground()]),
        {"ball.position": [0, 0, 1]},
        duration=0.5,
        dt=0.02,
        variables={"throw": {"sets": "ball.velocity", "guess": [1, 0, 1]}},
        costs={"effort": "sumsqr(throw)"},
        outputs={"height": "ball.position[2]"},
        solver={"gradient": {"iterations": 1}},
        name="thrown",
    )
    assert (made.name, made.simulation.dt, made.solver_tables["gradient"]) == ("thrown", 0.02, {"iterations": 1})
    assert symphys.solve(made, "gradient", backend="casadi").run.iterations == 1
