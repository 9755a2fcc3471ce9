"""An impact between two stretches of a step: no time passes, only velocities change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.collision import Contact
from symphys.dynamics.contact.constraint import UNREACHED, ContactRow, Moving, at_touch, make_sides
from symphys.dynamics.contact.effective_mass import answer_of, effective_masses, inverse_masses, symmetric_mobilities
from symphys.dynamics.contact.local_solver import coupling_of, may_couple
from symphys.dynamics.contact.preparation import SHORTEST, closes_fast, width_of
from symphys.dynamics.contact.projection import ZERO, Impulse
from symphys.dynamics.context import Scene, Setting, State
from symphys.dynamics.impact.restitution import rebound
from symphys.dynamics.joints.assembly import locks_at, make_trees, momenta_of
from symphys.dynamics.momentum import Momentum
from symphys.dynamics.motion import Motion, angular_velocity, apply
from symphys.dynamics.pgs import Row, Solution
from symphys.dynamics.prediction import bodies_of, expected_motions, look
from symphys.dynamics.substep import Phase
from symphys.dynamics.tracing.decorator import traced
from symphys.maths import rotation
from symphys.maths.smoothing import positive
from symphys.model.world import Law

Expr = Any
"""casadi SX, MX or DM"""

TOGETHER = 1e-9
"""Of dt: impacts that are no further apart are one."""
TOUCHING = 1e-3
"""Of the distance a_ref dt^2: surfaces that near to each other take part in an impact of their bodies."""


@dataclass(frozen=True)
class Cut:
    """Where a step is cut in two.

    Attributes:
        impact: 1 if the cut is an impact, 0 if there is none.
        first: length of the first stretch [s].
        fast: per pair: 1 if it closes at speed.
        struck: per pair: 1 if it meets at speed then.
        late: per pair: how much later than the first a struck pair meets [s]: rounding, but with a slope.
    """

    impact: Expr
    first: Expr
    fast: tuple[Expr, ...]
    struck: tuple[Expr, ...]
    late: tuple[Expr, ...]


def find_cut(scene: Scene, x: State, duration: Expr, share: float) -> Cut:
    """The first impact within ``duration`` [s], on paths under the persistent forces of the last step.

    Without an impact the cut is at ``share`` of the duration.
    """
    contacts = look(scene, expected_motions(scene, x, duration), duration)
    fast = [strikes(scene.setting, p.law, c) for p, c in zip(scene.world.pairs, contacts, strict=True)]
    earliest = ca.SX(0), duration
    for contact, closes in zip(contacts, fast, strict=True):
        earliest = _earlier(earliest, closes, contact.hit, contact.time, scene.setting.scheme.dt)
    first = _inside(earliest, duration, share)
    until = _until(earliest[1], first, scene.setting.scheme.dt)
    struck = [_is_struck(c, contact.hit, contact.time, until) for contact, c in zip(contacts, fast, strict=True)]
    late = [_late(earliest[1], s, contact.time) for contact, s in zip(contacts, struck, strict=True)]
    return Cut(earliest[0], first, tuple(fast), tuple(struck), tuple(late))


@traced
def strikes(setting: Setting, law: Law, contact: Contact) -> Expr:
    """1 if a contact's meeting is an impact."""
    return ca.SX(0) if law.soft else closes_fast(setting, contact)


@traced
def _earlier(earliest: tuple[Expr, Expr], closes: Expr, hit: Expr, time: Expr, dt: float) -> tuple[Expr, Expr]:
    """(whether there is an impact, when), with one more contact looked at; at a tie with the slope of this one."""
    meets = ca.logic_and(closes, hit)
    sooner = ca.logic_and(meets, time < earliest[1] + TOGETHER * dt)
    return ca.fmax(earliest[0], meets), ca.if_else(sooner, time, earliest[1])


@traced
def _until(earliest: Expr, first: Expr, dt: float) -> Expr:
    """When the last of the impacts that share the cut may be; none may be left between its instant and the cut."""
    return ca.fmax(earliest, first) + TOGETHER * dt


@traced
def _is_struck(closes: Expr, hit: Expr, time: Expr, until: Expr) -> Expr:
    return ca.logic_and(ca.logic_and(closes, hit), time <= until)


@traced
def _late(earliest: Expr, struck: Expr, time: Expr) -> Expr:
    return ca.if_else(struck, time - earliest, 0)


@traced
def _inside(earliest: tuple[Expr, Expr], duration: Expr, share: float) -> Expr:
    """The length of the stretch before the cut; near an end it is shifted, not clamped, so that its slope stays.

    Surfaces that rounding has put beyond each other meet at a time below 0 (``touch.falls``).
    """
    least, time = SHORTEST * duration, earliest[1]
    early = least * (1 + ca.ceil(ca.fmax(-time, 0) / least))
    shift = ca.if_else(time < least, early, ca.if_else(time > duration - least, -least, 0))
    return ca.if_else(earliest[0], time + shift, share * duration)


def collide_now(scene: Scene, x: State, cut: Cut) -> Phase:
    """The state after the impacts at ``cut``; leapfrog begins anew there, so ``lag`` is 0. Without one the same x."""
    duration = ca.SX(scene.setting.scheme.dt)
    motions = [Motion.at_start(motion) for motion in expected_motions(scene, x, duration)]
    contacts = look(scene, motions, duration)
    momenta = tuple(_momentum(motion) for motion in motions)
    trees = make_trees(scene, motions, momenta, ca.SX(0))
    rows = []
    for pair, contact, struck in zip(scene.world.pairs, contacts, cut.struck, strict=True):
        bodies = bodies_of(pair)
        moving = tuple(trees.motions[i] for i in bodies)
        coupled = may_couple(scene.world, pair)
        arguments = pair.law, contact, moving, struck, cut.impact, trees.same(bodies), coupled
        rows.append(trees.row(bodies, _row(scene.setting, *arguments)))
    locks = locks_at(scene, trees)
    n, still = len(locks), (*(nothing for _, nothing in locks), *(ZERO for _ in rows))
    every = (*(row for row, _ in locks), *rows)
    solved = rebound(scene, every, Solution(trees.states, still, still), motions, trees)
    after = _with_velocities(scene, x, motions, momenta_of(scene, trees, solved.momenta), cut.impact)
    _delay(scene, after, rows, solved.impulses[n:], cut.late)
    forces = (x[f"{pair.name}.force"] for pair in scene.world.pairs)
    ahead = tuple(_ahead(cut.impact, x["lag"], force) for force in forces)
    changes = tuple(zip(solved.impulses, solved.last, strict=True))
    return Phase(after, tuple(rows), tuple(contacts), solved.impulses[n:], changes, ahead)


@traced
def _momentum(motion: Motion) -> Momentum:
    return Momentum(motion.velocity, motion.momentum_k)


@traced
def _ahead(impact: Expr, lag: Expr, force: Expr) -> Expr:
    return impact * lag * force


@traced
def _row(
    setting: Setting,
    law: Law,
    contact: Contact,
    motions: Moving,
    struck: Expr,
    impact: Expr,
    same: bool,
    coupled: bool,
) -> ContactRow:
    """The row of a contact at the instant of an impact: of it where ``struck``, of its bodies where they touch."""
    now, scheme = ca.SX(0), setting.scheme
    touching = ca.logic_and(impact, contact.gap < TOUCHING * setting.reference * scheme.dt**2)
    velocity, _, normal = at_touch(contact, motions, now)
    speed = law.restitution * positive(-ca.dot(normal, velocity), setting.knob)
    frame = contact.meeting.frame(now)
    sides = make_sides(motions, now, frame, frame)
    resting = ca.if_else(touching, 0, UNREACHED)
    push, twist = symmetric_mobilities(sides, same)
    masses = inverse_masses(sides, frame.normal, push, twist)
    return ContactRow(
        law,
        sides,
        frame.normal,
        frame.normal,
        answer_of(sides, frame.normal, same),
        yields=ca.SX(1),
        **effective_masses(*masses),
        softness=ca.SX(0),
        target=ca.SX(UNREACHED) if law.soft else ca.if_else(struck, speed, resting),
        slip_target=ca.SX.zeros(3),
        delay=ca.SX(0),
        leaving=struck,
        lasts=ca.SX(0),
        load=ca.SX(0),
        slack=ca.SX(0),
        struck=struck,
        width=struck * width_of(setting, contact),
        knob=setting.knob,
        same=same,
        coupling=coupling_of(push, frame.normal, law.friction, ca.SX(0)) if coupled else None,
    )


def _with_velocities(
    scene: Scene, x: State, motions: Sequence[Motion], momenta: Sequence[Momentum], impact: Expr
) -> State:
    values = dict(x)
    for body, motion, momentum in zip(scene.world.bodies, motions, momenta, strict=True):
        names = f"{body.name}.velocity", f"{body.name}.angular_velocity"
        before = tuple(x[name] for name in names)
        values |= zip(names, _after(motion, momentum, before, impact), strict=True)
    values["lag"] = _renewed(impact, x["lag"])
    return values


def _delay(scene: Scene, x: State, rows: Sequence[Row], impulses: Sequence[Impulse], late: Sequence[Expr]) -> None:
    """Take back what each impulse does to positions before its own instant, on bodies without joints.

    Impacts of several bodies at one instant share a cut, but each has an instant with a slope of its own.
    """
    held = {index for joint in scene.world.joints for index in joint.bodies}
    for each, impulse, time in zip(rows, impulses, late, strict=True):
        for k, index in enumerate(each.bodies):
            names = tuple(f"{scene.world.bodies[index].name}.{part}" for part in ("position", "orientation"))
            if index not in held:
                pose = x[names[0]], x[names[1]]
                x |= zip(names, _delayed(pose, each.row, k, impulse, time), strict=True)


@traced
def _delayed(pose: tuple[Expr, Expr], row: ContactRow, k: int, impulse: Impulse, time: Expr) -> tuple[Expr, Expr]:
    side, (position, q) = row.sides[k], pose
    push, twist = impulse.linear(row.impulse_normal), impulse.angular(row.impulse_normal)
    early = -time * side.sign
    turn = early * apply(side.inverse_inertia, ca.cross(side.impulse_arm, push) + twist)
    return position + early * side.inverse_mass * push, q + rotation.multiply(ca.vertcat(0, turn / 2), q)


@traced
def _after(motion: Motion, momentum: Momentum, before: tuple[Expr, ...], impact: Expr) -> tuple[Expr, Expr]:
    """(velocity, angular velocity): as solved if there is an impact, else as before."""
    spin = angular_velocity(motion.inertia, motion.orientation, momentum.angular)
    return ca.if_else(impact, momentum.velocity, before[0]), ca.if_else(impact, spin, before[1])


@traced
def _renewed(impact: Expr, lag: Expr) -> Expr:
    return ca.if_else(impact, 0, lag)
