"""Frames of a joint during a substep, and the directions that it locks and leaves free."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath, StillPath, at_rest
from symphys.dynamics.contact.body_term import BodyTerm, Motions, point_jacobian
from symphys.dynamics.joints.joint_impulse import Directions
from symphys.dynamics.tracing.decorator import traced
from symphys.maths import rotation
from symphys.model.joints import Coordinate, Joint, PlacedFrames
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class JointFrames:
    """The paths of both frames' points and axes; arms from the centres of mass, the world's from its origin."""

    joint: Joint
    centres: tuple[Parabola, Parabola]
    arms: tuple[Parabola, Parabola]
    axes: tuple[tuple[Parabola, ...], tuple[Parabola, ...]]

    def placed(self, t: Expr) -> PlacedFrames:
        """Return both frames at time t."""
        a, b = (ca.horzcat(*(axis.at(t) for axis in axes)) for axes in self.axes)
        first, second = (centre + arm for centre, arm in zip(self.centres, self.arms, strict=True))
        return PlacedFrames(a, b, (first - second).at(t))

    def lever_arms(self, t: Expr) -> tuple[Expr, Expr]:
        """Return the arms (3,) from the centres of mass to the frames; to the first frame for a joint that slides."""
        first, second = self.arms[0].at(t), self.arms[1].at(t)
        if self.joint.kind.travels:
            second += self.placed(t).apart
        return first, second

    def common_arms(self, t: Expr) -> tuple[Expr, Expr]:
        """Return the arms (3,) to one point midway between the frames, so that impulses make no spin."""
        first, second = self.lever_arms(t)
        if self.joint.kind.travels:
            return first, second
        half = self.placed(t).apart / 2
        return first - half, second + half

    def terms(self, motions: Motions, seen: Expr, given: Expr) -> tuple[BodyTerm, ...]:
        """Return the bodies of constraints that see the frames at one time and give impulses at another."""
        arms, impulse_arms = self.lever_arms(seen), self.common_arms(given)
        return tuple(
            BodyTerm(
                1 - 2 * k,
                1 / motion.mass,
                motion.inverse_inertia(seen),
                arms[k],
                impulse_arms[k],
                point_jacobian(motion, seen, arms[k], impulse_arms[k]),
            )
            for k, motion in enumerate(motions)
        )


@traced
def joint_frames(joint: Joint, motions: Motions) -> JointFrames:
    """Return the frames of a joint whose bodies have these motions."""
    return joint_frames_on(joint, [motion.predicted_path() for motion in motions])


def joint_frames_on(joint: Joint, body_paths: Sequence[PredictedPath]) -> JointFrames:
    """Return the frames of a joint whose bodies have these paths."""
    body_paths = [*body_paths, *([at_rest(body_paths[0].dt)] if joint.second is None else [])]
    axes = []
    for body_path, frame in zip(body_paths, joint.frames, strict=True):
        turned = rotation.matrix(ca.SX(ca.vertcat(*frame.orientation)))
        axes.append(tuple(body_path.arm(tuple(turned[i, j] for i in range(3))) for j in range(3)))
    centres = body_paths[0].centre(), body_paths[1].centre()
    arms = body_paths[0].arm(joint.frames[0].point), body_paths[1].arm(joint.frames[1].point)
    return JointFrames(joint, centres, arms, (axes[0], axes[1]))


def joint_frames_at(joint: Joint, poses: tuple[tuple[Expr, Expr], ...]) -> JointFrames:
    """Return the frames of a joint whose bodies are at these positions and orientations."""
    zero = ca.SX.zeros(3)
    return joint_frames_on(
        joint, [StillPath(p, rotation.matrix(q), zero, zero, zero, zero, ca.SX(0), None, None) for p, q in poses]
    )


def locked(joint: Joint, placed: PlacedFrames) -> Directions:
    """Return the directions that a joint locks."""
    return Directions(*joint.kind.locks(placed))


def free(coordinate: Coordinate, placed: PlacedFrames) -> Directions:
    """Return the direction of a coordinate."""
    return Directions(*coordinate.along(placed))
