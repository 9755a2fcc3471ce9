"""Sensors of sites: where a site is, how it is turned, how it moves."""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.observation.sensor_kind import MjcfSensor, SensedState, SensorKind
from symphys.maths import rotation
from symphys.model.site import Site
from symphys.types import Expr


def _of_body(at: SensedState, site: Site, field: str) -> Expr:
    """A field of the body that carries the site."""
    assert site.body is not None
    return at.part(f"{at.world.bodies[site.body].name}.{field}")


def _place(at: SensedState, site: Site) -> Expr:
    """The site's position in the frame of what carries it (3,) [m]."""
    return type(at.x)(ca.vertcat(*site.position))


def _arm(at: SensedState, site: Site) -> Expr:
    """Return the vector from the centre of mass to the site, world frame (3,) [m]."""
    return rotation.rotate(_of_body(at, site, "orientation"), _place(at, site))


def _position(at: SensedState, site: Site) -> Expr:
    return _place(at, site) if site.body is None else _of_body(at, site, "position") + _arm(at, site)


def _orientation(at: SensedState, site: Site) -> Expr:
    turned = type(at.x)(ca.vertcat(*site.orientation))
    return turned if site.body is None else rotation.multiply(_of_body(at, site, "orientation"), turned)


def _velocity(at: SensedState, site: Site) -> Expr:
    if site.body is None:
        return type(at.x).zeros(3)
    return _of_body(at, site, "velocity") + ca.cross(_of_body(at, site, "angular_velocity"), _arm(at, site))


SITE_SENSORS = (
    SensorKind(
        "position",
        "site",
        "of the site, world frame",
        _position,
        unit="m",
        axes="world",
        mjcf=MjcfSensor("framepos", "site"),
    ),
    SensorKind(
        "orientation",
        "site",
        "unit quaternion w, x, y, z: from the site's axes into the world's",
        _orientation,
        size=4,
        mjcf=MjcfSensor("framequat", "site"),
    ),
    SensorKind(
        "velocity",
        "site",
        "of the site, world frame",
        _velocity,
        unit="m/s",
        axes="world",
        mjcf=MjcfSensor("framelinvel", "site"),
    ),
)
"""Every kind of sensor of a site."""
