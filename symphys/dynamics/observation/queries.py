"""What can be asked of a state without taking a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.collision import Contact
from symphys.dynamics.contact.constraint import Moving, at_touch
from symphys.dynamics.context import Scene, make_scene
from symphys.dynamics.functions import arguments_of, inline, parts_of
from symphys.dynamics.prediction import bodies_of, expected_motions, look
from symphys.model.state_layout import Layout
from symphys.model.world import Scheme, World

Expr = Any
"""casadi SX, MX or DM"""


def gap_function(world: World) -> ca.Function:
    """The gaps [m] of a state: x -> (pairs,); candidates that cannot touch as things lie have a large one."""
    scene, (x, *_) = _scene(world, None, (), ())
    gaps = [scene.pieces.value(contact.gap) for contact in _contacts(scene, x)[0]]
    return ca.Function("gaps", [x], [ca.densify(ca.vertcat(ca.SX(0, 1), *gaps))])


def slip_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """How fast surfaces move across their normals [m/s]: (x, u, p) -> (pairs,)."""
    scene, (x, u, p, _) = _scene(world, scheme, inputs, parameters)
    contacts, motions = _contacts(scene, x)
    speeds = []
    for pair, contact in zip(world.pairs, contacts, strict=True):
        moving = tuple(motions[i] for i in bodies_of(pair))
        speeds.append(scene.pieces.value(scene.pieces.do(_slip, contact, moving)))
    return ca.Function("slip", [x, u, p], [ca.densify(ca.vertcat(ca.SX(0, 1), *speeds))])


def _slip(contact: Contact, motions: Moving) -> Expr:
    velocity, _, normal = at_touch(contact, motions, ca.SX(0))
    return ca.norm_2(velocity - normal * ca.dot(normal, velocity))


def _scene(
    world: World, scheme: Scheme | None, inputs: Sequence[str], parameters: Sequence[Any]
) -> tuple[Scene, list[Expr]]:
    arguments = arguments_of(world, inputs, parameters)
    return make_scene(world, scheme, tuple(inputs), arguments[1], ca.SX(0), inline(world, arguments)), arguments


def _contacts(scene: Scene, x: Expr) -> tuple[list[Contact], list[Any]]:
    duration = ca.SX(scene.setting.scheme.dt)
    motions = expected_motions(scene, parts_of(Layout(scene.world), x), duration)
    return look(scene, motions, duration), motions
