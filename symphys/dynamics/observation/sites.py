"""What can be read off a site in a state: where it is, how it is turned, how it moves."""

from __future__ import annotations

import casadi as ca

from symphys.maths import rotation
from symphys.model.state_layout import Layout
from symphys.model.world import World
from symphys.types import Expr

FIELDS = ("position", "orientation", "velocity")


def site_quantities(world: World, x: Expr) -> dict[str, Expr]:
    """What formulas call them: ``tip.position`` (3,) [m], ``.orientation`` (4,) and ``.velocity`` (3,) [m/s].

    World frame; the quaternion w x y z goes from the site's axes to the world's.
    """
    layout, named = Layout(world), dict[str, Expr]()
    for site in world.sites:
        place, turned = type(x)(ca.vertcat(*site.position)), type(x)(ca.vertcat(*site.orientation))
        if site.body is None:
            values = (place, turned, type(x).zeros(3))
        else:
            body = world.bodies[site.body].name
            p, q, v, w = (
                x[layout[f"{body}.{key}"]] for key in ("position", "orientation", "velocity", "angular_velocity")
            )
            arm = rotation.rotate(q, place)
            values = (p + arm, rotation.multiply(q, turned), v + ca.cross(w, arm))
        named |= {f"{site.name}.{key}": value for key, value in zip(FIELDS, values, strict=True)}
    return named


def site_quantity_names(world: World) -> list[str]:
    """The names of ``site_quantities``."""
    return [f"{site.name}.{key}" for site in world.sites for key in FIELDS]
