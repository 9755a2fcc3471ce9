"""What can be asked of a state without taking a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.collision import Contact
from symphys.dynamics.contact.constraint import Moving, at_touch
from symphys.dynamics.context import Scene
from symphys.dynamics.functions import arguments_of, inline, parts_of, scene_of
from symphys.dynamics.motion import Motion
from symphys.dynamics.prediction import bodies_of, expected_motions, look
from symphys.dynamics.tracing.decorator import traced, tracing
from symphys.model.state_layout import Layout
from symphys.model.world import Scheme, World

Expr = Any
"""casadi SX, MX or DM"""


def gap_function(world: World) -> ca.Function:
    """The gaps [m] of a state: x -> (pairs,); candidates that cannot touch as things lie have a large one."""
    arguments = arguments_of(world, (), ())
    tracer = inline(world, arguments)
    with tracing(tracer):
        contacts, _ = _contacts(world, scene_of(world, None, (), arguments), arguments[0])
    gaps = [tracer.value(contact.gap) for contact in contacts]
    return ca.Function("gaps", arguments[:1], [ca.densify(ca.vertcat(ca.SX(0, 1), *gaps))])


def slip_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """How fast surfaces move across their normals [m/s]: (x, u, p) -> (pairs,)."""
    x, u, p, _ = arguments = arguments_of(world, inputs, parameters)
    tracer = inline(world, arguments)
    with tracing(tracer):
        contacts, motions = _contacts(world, scene_of(world, scheme, inputs, [x, u, p, ca.SX(0)]), x)
        moving = (tuple(motions[i] for i in bodies_of(pair)) for pair in world.pairs)
        speeds = [_slip(contact, each) for contact, each in zip(contacts, moving, strict=True)]
    values = map(tracer.value, speeds)
    return ca.Function("slip", [x, u, p], [ca.densify(ca.vertcat(ca.SX(0, 1), *values))])


@traced
def _slip(contact: Contact, motions: Moving) -> Expr:
    velocity, _, normal = at_touch(contact, motions, ca.SX(0))
    return ca.norm_2(velocity - normal * ca.dot(normal, velocity))


def _contacts(world: World, scene: Scene, x: Expr) -> tuple[list[Contact], list[Motion]]:
    duration = ca.SX(scene.setting.scheme.dt)
    motions = expected_motions(scene, parts_of(Layout(world), x), duration)
    return look(scene, motions, duration), motions
