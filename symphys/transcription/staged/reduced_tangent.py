"""A tangent without forces: coordinates, velocities less half kicks, and forces of soft contacts and joints.

Forces at the end of a step matter to the next one in two ways. The velocity has half a step of them in it, which the
next step takes back (``lag``); and they are where its sweeps begin. A velocity without these half kicks holds the first
exactly. The second matters little where sweeps settle, and is left out here. Forces of soft contacts and joints have a
memory of their own, and stay. The next step counts the commands of motors anew, so these are no part of the kicks.

Jacobians have fewer rows (a planar quadruped on a crate 15 in place of 52), and a descent is not led by forces that the
next step corrects. Slopes are not exact where sweeps do not settle, so the last digits of an objective are better found
with forces (benchmarks/notes/tangents_without_forces.md).
"""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import casadi as ca

from symphys.dynamics.articulated.forward_dynamics import consistent
from symphys.dynamics.context import make_context
from symphys.dynamics.joints.warm_start import add_joint_forces
from symphys.dynamics.motion import inverse_inertia
from symphys.dynamics.unknowns import Momentum
from symphys.maths import rotation
from symphys.records import dataclass
from symphys.transcription.staged.tangent import POSES, JointCoordinateChart, Moving, Parts, Tangent
from symphys.types import Expr


@dataclass(frozen=True, eq=False)
class ReducedTangent(Tangent):
    """``Tangent`` without the forces of rigid contacts, joints and couplings; retract leaves these as they are."""

    kind: ClassVar[str] = "without forces"

    @cached_property
    def _left_out(self) -> frozenset[str]:
        world = self.rollout.world
        rigid = {f"{pair.name}.{field}" for pair in world.pairs if not pair.law.soft for field in ("force", "torque")}
        locked = [joint.name for joint in world.joints if not joint.soft] + [each.name for each in world.couplings]
        acting = {f"{joint.name}.{part}" for joint in world.joints for part in (*joint.acting, joint.drive)}
        return frozenset(rigid | acting | {f"{name}.lock" for name in locked})

    @cached_property
    def _independent_reactions(self) -> tuple[str, ...]:
        return ()

    def _kick_change(self, old: Parts, new: Parts, index: int, chart: JointCoordinateChart | None) -> Expr:
        before, after = (self._kick(state, index, chart) for state in (old, new))
        return after - before

    def _kick(self, state: Parts, index: int, chart: JointCoordinateChart | None) -> Expr:
        """Return velocities (6,) or rates (size,) by what acts on the bodies, but commands of motors, for ``lag``."""
        world, lag = self.rollout.world, state["lag"]
        poses = [self._pair(state, i, POSES) for i in range(len(world.bodies))]
        commanded = [(ca.SX.zeros(3), ca.SX.zeros(3)) for _ in world.bodies]
        context = make_context(world, self.rollout.problem.simulation.scheme(), (), ca.SX(0, 1), ca.SX(0))
        add_joint_forces(context, self._commands(state), poses, commanded)

        def momentum(i: int) -> Momentum:
            body = world.bodies[i]
            force, torque = (
                state[f"{body.name}.{name}"] - known
                for name, known in zip(("reaction_force", "reaction_torque"), commanded[i], strict=True)
            )
            return Momentum(lag * force / (1 if body.massless else body.mass), lag * torque)

        if chart is None:
            own, body = momentum(index), world.bodies[index]
            spin = ca.mtimes(inverse_inertia(body.inertia, rotation.matrix(poses[index][1])), own.angular)
            return ca.vertcat(own.velocity, spin)
        bodies, joints = (
            chart.tree.bodies,
            tuple(None if k.joint is None else world.joints[k.joint] for k in chart.tree.links),
        )
        found = consistent(
            chart.tree,
            joints,
            tuple((world.bodies[i].mass, world.bodies[i].inertia) for i in bodies),
            tuple(poses[i] for i in bodies),
            tuple(momentum(i) for i in bodies),
            tuple(
                None if joint is None or not joint.armature else ca.SX.zeros(link.count)
                for joint, link in zip(joints, chart.tree.links, strict=True)
            ),
        )
        kicks: dict[int, Moving] = {i: (each[0], each[1]) for i, each in zip(bodies, found, strict=True)}
        return chart.rates({i: poses[i] for i in bodies}, kicks)

    def _commands(self, state: Parts) -> dict[str, Expr]:
        """Return the entries of joints and couplings as ``add_joint_forces`` takes them: commands of motors alone."""
        found = dict[str, Expr]()
        for joint in self.rollout.world.joints:
            for part in ("lock", *joint.acting):
                name = f"{joint.name}.{part}"
                if name in state:
                    driven = part == "motor" and joint.drive is not None
                    found[name] = state[f"{joint.name}.{joint.drive}"] if driven else ca.SX.zeros(state[name].shape[0])
            if joint.unwrapped is not None:
                found[joint.unwrapped] = state[joint.unwrapped]
        for coupling in self.rollout.world.couplings:
            found[f"{coupling.name}.lock"] = ca.SX.zeros(state[f"{coupling.name}.lock"].shape[0])
        return found
