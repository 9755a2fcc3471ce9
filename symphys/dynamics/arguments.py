"""The arguments of functions of a state, as symbols: x, u, p and smoothing; the parts of x by name.

Numbers of shapes and laws may be arguments of the calls of a step, so that eight feet that lie elsewhere share the
functions of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.context import State, StepContext, make_context
from symphys.dynamics.tracing.decorator import as_arguments
from symphys.dynamics.tracing.trace import InlineTracer
from symphys.model.numbers import numbers_of
from symphys.model.shapes import SolidShape, Surface
from symphys.model.state_layout import Layout, input_symbols
from symphys.model.world import Law, Scheme, World
from symphys.types import Expr


def inline(world: World, arguments: Sequence[Expr], reduces: bool = True) -> InlineTracer:
    """Return a tracer of functions of x, u, p and smoothing.

    X by its parts, so that equal bodies share what they compute.
    """
    (x, *others), tracer = arguments, InlineTracer(reduces)
    for column in (*parts_of(Layout(world), x).values(), *others):
        tracer.take(column)
    return tracer


def context_of(world: World, scheme: Scheme | None, inputs: Sequence[str], arguments: Sequence[Expr]) -> StepContext:
    """Make the symbols of a step with these arguments."""
    return make_context(world, scheme, tuple(inputs), arguments[1], arguments[3])


def parts_of(layout: Layout, x: Expr) -> State:
    """Return the state's parts by name."""
    return {name: x[layout[name]] for name in layout.names()}


def arguments_of(world: World, inputs: Sequence[str], parameters: Sequence[Any]) -> list[Expr]:
    """Return symbols for x, u, p and smoothing."""
    x = ca.SX.sym("x", Layout(world).size)
    return [x, input_symbols(world, inputs), ca.vertcat(ca.SX(0, 1), *parameters), ca.SX.sym("smoothing")]


def surface_as_arguments(surface: Surface) -> Surface:
    """Return a surface whose numbers are arguments; corners of hulls and tables of terrains stay constants."""
    if not isinstance(surface, SolidShape) or not surface.parameters:
        return surface
    sizes, centre = as_arguments((surface.sizes, surface.centre))
    return replace(surface.resized(sizes), centre=centre)


def law_as_arguments(law: Law) -> Law:
    """Return a law whose numbers are arguments."""
    return replace(law, **as_arguments({name: getattr(law, name) for name in numbers_of(law)}))
