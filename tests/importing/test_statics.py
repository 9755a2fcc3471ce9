"""Imported robots at rest: height against MuJoCo's, support against the weight, and the slope on which they stick.

The joints with motors are held by springs and dampers, the same in both engines: at 0, or in the middle of their limits
if these leave 0 out. A slope is gravity that leans: the robot must stay where tan(slope) is below the coefficient of
friction, and slide faster and faster above it, by g (sin(slope) - friction cos(slope)).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from imported_models import Match, begin, grounded, gymnasium_model, imported, matched  # noqa: E402
from imports import rolled  # noqa: E402

from symphys.dynamics.functions import step_function  # noqa: E402
from symphys.model.joints.joint import Limits, Spring  # noqa: E402
from symphys.model.state_layout import Layout  # noqa: E402
from symphys.model.world import Scheme, World  # noqa: E402
from symphys.types import Array  # noqa: E402

pytestmark = pytest.mark.skipif(not gymnasium_model("ant").path.is_file(), reason="gymnasium is not installed")
G = 9.81
DT = 0.004
SETTLED = 8.0
"""[s] until it rests at the latest."""
SLID = 1.0
"""[s] on a slope."""
STIFFNESS, DAMPING = 500.0, 20.0
"""[N m / rad], [N m s / rad] per kg of the robot."""
SWEEPS = 30
FRICTION = 0.2
"""Of the slopes: on steeper ones tall robots fall over before they slide."""


@dataclass(frozen=True)
class Rest:
    """A robot that stands.

    Attributes:
        height, height_there: of the centre of mass [m], here and in MuJoCo.
        sunk_there: how far MuJoCo's deepest point is in the ground [m].
        support: sum of the vertical contact forces by weight, less 1.
        speed: the largest of a body [m/s].
    """

    height: float
    height_there: float
    sunk_there: float
    support: float
    speed: float


@dataclass(frozen=True)
class Slope:
    """A robot on a slope.

    Attributes:
        steepness: tan(slope) by friction.
        acceleration: along the slope, mean of the last half [m/s^2].
        expected: 0 below the cone, g (sin - friction cos) above.
    """

    steepness: float
    acceleration: float
    expected: float


def held(world: World) -> World:
    """Return a world with springs in place of the motors."""
    stiffness = STIFFNESS * float(masses(world).sum())
    damping = stiffness * DAMPING / STIFFNESS
    joints = tuple(
        replace(joint, motor=None, spring=Spring(stiffness, damping, rest_of(joint.limits))) if joint.driven else joint
        for joint in world.joints
    )
    return replace(world, joints=joints)


def rest_of(limits: Limits) -> float:
    """Return 0, or the middle of limits that leave it out."""
    lower, upper = (0.0 if bound is None else float(bound) for bound in (limits.lower, limits.upper))
    return 0.0 if lower <= 0 <= upper else (lower + upper) / 2


def posed(match: Match, qpos: Array) -> Array:
    """Return MuJoCo's coordinates with the held joints at rest."""
    found = qpos.copy()
    for joint in match.world.joints:
        if joint.driven:
            q = match.model.jnt_qposadr[match.joints[joint.name]]
            found[q] = match.model.qpos0[q] + rest_of(joint.limits)
    return found


def support(world: World, x: Array) -> Array:
    """Return the sum (3,) of the forces of what stands still on the bodies [N]."""
    layout = Layout(world)
    grounded = [pair.name for pair in world.pairs if pair.second.body is None]
    return np.asarray(sum((x[layout[f"{name}.force"]] for name in grounded), np.zeros(3)))


def masses(world: World) -> Array:
    """Return the masses (bodies,) [kg]."""
    return np.array([float(body.mass) for body in world.bodies])


def centre(world: World, x: Array, field: str = "position") -> Array:
    """Return the position (3,) of the centre of mass, or its velocity."""
    layout = Layout(world)
    places = np.array([x[layout[f"{body.name}.{field}"]] for body in world.bodies])
    return masses(world) @ places / masses(world).sum()


def rest(match: Match, qpos: Array, grounded: mujoco.MjModel, seconds: float = SETTLED) -> tuple[Rest, Array]:
    """Return how a robot rests that falls from MuJoCo's coordinates ``qpos``, and its state (nx,) at rest here."""
    world, qpos = held(match.world), posed(match, qpos)
    step = step_function(world, Scheme(dt=DT, sweeps=SWEEPS, cuts=0))
    end = rolled(step, match.x(qpos, np.zeros(match.model.nv), world), (), round(seconds / DT))
    layout = Layout(world)
    speed = max(float(np.linalg.norm(end[layout[f"{body.name}.velocity"]])) for body in world.bodies)
    data = rested_there(match, grounded, qpos, seconds)
    weight, moving = masses(world).sum() * G, match.moving()
    height = float(grounded.body_mass[moving] @ data.xipos[moving, 2] / grounded.body_mass[moving].sum())
    sunk = max((-float(contact.dist) for contact in data.contact), default=0.0)
    found = Rest(float(centre(world, end)[2]), height, sunk, float(support(world, end)[2] / weight - 1), speed)
    return found, end


def rested_there(match: Match, grounded: mujoco.MjModel, qpos: Array, seconds: float) -> mujoco.MjData:
    """Return MuJoCo's robot at rest, held likewise."""
    stiffness = STIFFNESS * float(masses(match.world).sum())
    grounded.opt.timestep = DT
    grounded.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    grounded.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    for joint in match.world.joints:
        if joint.driven:
            j = match.joints[joint.name]
            grounded.jnt_stiffness[j] = stiffness
            grounded.dof_damping[grounded.jnt_dofadr[j]] = stiffness * DAMPING / STIFFNESS
            q = grounded.jnt_qposadr[j]
            grounded.qpos_spring[q] = grounded.qpos0[q] + rest_of(joint.limits)
    data = mujoco.MjData(grounded)
    data.qpos[:] = qpos
    mujoco.mj_step(grounded, data, round(seconds / DT))
    mujoco.mj_kinematics(grounded, data)
    return data


def slopes(world: World, x: Array, steepness: tuple[float, ...] = (0.9, 0.98, 1.02, 1.1)) -> list[Slope]:
    """Return how the held robot that rests in ``x`` moves on slopes about the edge of the cone."""
    pull, weight, found = ca.SX.sym("pull"), ca.SX.sym("weight"), list[Slope]()
    pairs = tuple(replace(pair, law=replace(pair.law, friction=FRICTION)) for pair in world.pairs)
    leaning = replace(world, pairs=pairs, gravity=(pull, 0.0, -weight))
    step = step_function(leaning, Scheme(dt=DT, sweeps=SWEEPS, cuts=0), parameters=[pull, weight])
    for share in steepness:
        slope = float(np.arctan(share * FRICTION))
        along, down = G * float(np.sin(slope)), G * float(np.cos(slope))
        half = round(SLID / 2 / DT)
        middle = rolled(step, x, (along, down), half)
        end = rolled(step, middle, (along, down), half)
        speeds = [centre(world, state, "velocity")[0] for state in (middle, end)]
        found.append(Slope(share, float(2 * (speeds[1] - speeds[0]) / SLID), max(0.0, along - FRICTION * down)))
    return found


@pytest.mark.thorough
def test_ant_stands_by_statics() -> None:
    model = gymnasium_model("ant")
    robot = imported(model, self_collision=False)
    match = matched(robot.problem.world(), robot.placed, model.reference())
    found, x = rest(match, begin(match, robot), grounded(model, robot), seconds=1.0)
    assert abs(found.support) < 1e-6
    assert found.speed < 1e-6
    # MuJoCo's contacts act from the margins of the geoms on, 2 cm above the ground
    assert found.height - found.sunk_there == pytest.approx(found.height_there, abs=2e-3)
    below, above = slopes(held(match.world), x, (0.95, 1.05))
    assert abs(below.acceleration) < 0.1 * above.expected
    assert above.acceleration == pytest.approx(above.expected, rel=0.01)
