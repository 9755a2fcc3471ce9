"""What can be asked of a state without taking a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.arguments import arguments_of, context_of, inline, parts_of
from symphys.dynamics.collision import Contact
from symphys.dynamics.contact.body_term import Motions, at_touch
from symphys.dynamics.context import StepContext
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.prediction import bodies_of, detect_contacts, predicted_motions
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
        contacts, _ = _contacts(world, context_of(world, None, (), arguments), arguments[0])
    gaps = [tracer.value(contact.gap) for contact in contacts]
    return ca.Function("gaps", arguments[:1], [ca.densify(ca.vertcat(ca.SX(0, 1), *gaps))])


def slip_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """How fast surfaces move across their normals [m/s]: (x, u, p) -> (pairs,)."""
    x, u, p, _ = arguments = arguments_of(world, inputs, parameters)
    tracer = inline(world, arguments)
    with tracing(tracer):
        contacts, motions = _contacts(world, context_of(world, scheme, inputs, [x, u, p, ca.SX(0)]), x)
        moving = (tuple(motions[i] for i in bodies_of(pair)) for pair in world.pairs)
        speeds = [_slip(contact, each) for contact, each in zip(contacts, moving, strict=True)]
    values = map(tracer.value, speeds)
    return ca.Function("slip", [x, u, p], [ca.densify(ca.vertcat(ca.SX(0, 1), *values))])


@traced
def _slip(contact: Contact, motions: Motions) -> Expr:
    velocity, _, normal = at_touch(contact, motions, ca.SX(0))
    return ca.norm_2(velocity - normal * ca.dot(normal, velocity))


def _contacts(world: World, context: StepContext, x: Expr) -> tuple[list[Contact], list[PredictedMotion]]:
    duration = ca.SX(context.settings.scheme.dt)
    motions = predicted_motions(context, parts_of(Layout(world), x), duration)
    return detect_contacts(context, motions, duration), motions
