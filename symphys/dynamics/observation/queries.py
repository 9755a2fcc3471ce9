"""What can be asked of a state without taking a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.arguments import arguments_of, context_of, inline, parts_of
from symphys.dynamics.collision import Contact, collide
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.contact.body_term import Motions, at_touch
from symphys.dynamics.context import StepContext
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.prediction import along_paths, bodies_of, detect_contacts, free_motions, predicted_motions
from symphys.dynamics.tracing.decorator import traced, tracing
from symphys.model.shapes import Surface
from symphys.model.state_layout import Layout
from symphys.model.world import Scheme, World
from symphys.types import Expr


def gap_function(world: World, parameters: Sequence[Any] | None = None) -> ca.Function:
    """The gaps [m] of a state: x -> (pairs,); candidates that cannot touch as things lie have a large one.

    With SX ``parameters`` of the world, also none, it is a function of (x, p).
    """
    arguments = arguments_of(world, (), parameters or ())
    tracer = inline(world, arguments, reduces=False)
    with tracing(tracer):
        context = context_of(world, None, (), arguments)
        duration = ca.SX(context.settings.scheme.dt)
        motions = free_motions(context, parts_of(Layout(world), arguments[0]), duration)  # a gap is of positions alone
        gaps = map(tracer.value, along_paths(_gaps, context, motions, duration))
    taken = [arguments[0]] if parameters is None else [arguments[0], arguments[2]]
    return ca.Function("gaps", taken, [ca.densify(ca.vertcat(ca.SX(0, 1), *gaps))])


def slip_function(
    world: World, scheme: Scheme | None = None, inputs: Sequence[str] = (), parameters: Sequence[Any] = ()
) -> ca.Function:
    """Return the slip speeds of surfaces [m/s]: (x, u, p) -> (pairs,)."""
    x, u, p, _ = arguments = arguments_of(world, inputs, parameters)
    tracer = inline(world, arguments, reduces=False)
    with tracing(tracer):
        context = context_of(world, scheme, inputs, [x, u, p, ca.SX(0)])
        motions, duration = _motions(world, context, x)
        contacts = detect_contacts(context, motions, duration)
        moving = (tuple(motions[i] for i in bodies_of(pair)) for pair in world.pairs)
        speeds = [_slip(contact, each) for contact, each in zip(contacts, moving, strict=True)]
    values = map(tracer.value, speeds)
    return ca.Function("slip", [x, u, p], [ca.densify(ca.vertcat(ca.SX(0, 1), *values))])


@traced
def _slip(contact: Contact, motions: Motions) -> Expr:
    velocity, _, normal = at_touch(contact, motions, ca.SX(0))
    return ca.norm_2(velocity - normal * ca.dot(normal, velocity))


@traced
def _gaps(first: Surface, second: Surface, a: PredictedPath, b: PredictedPath) -> list[Expr]:
    """Return the gaps alone: the function is small, however large the code for the instant of touch."""
    return [contact.gap for contact in collide(first, second, a, b)]


def _motions(world: World, context: StepContext, x: Expr) -> tuple[list[PredictedMotion], Expr]:
    duration = ca.SX(context.settings.scheme.dt)
    return predicted_motions(context, parts_of(Layout(world), x), duration), duration
