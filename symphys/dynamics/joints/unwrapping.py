"""Angles of joints that count whole turns, tracked from step to step."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.context import State, StepContext
from symphys.dynamics.joints.assembly import JointPath
from symphys.dynamics.joints.joint_frames import JointFrames, free
from symphys.dynamics.position_correction import CorrectedConfiguration
from symphys.dynamics.tracing.decorator import traced
from symphys.types import Expr


def unwrapped_angles(
    context: StepContext, paths: Sequence[JointPath], closed: CorrectedConfiguration, duration: Expr
) -> State:
    """``Joint.unwrapped`` of all joints that turn, at the end of a substep of ``duration`` [s].

    The coordinate at the start plus its change in the step is its angle to third order in the step. Poses give the
    angle exactly up to whole turns, whose number follows from this estimate, however far a step turns.
    """
    found = State()
    for index, (joint, path) in enumerate(zip(context.world.joints, paths, strict=True)):
        if joint.unwrapped is None:
            continue
        if index in closed.along:
            moved = closed.along[index]
        else:
            moved = _turned(path.frames, tuple(closed.turning[i] for i in joint.bodies), duration)
        found[joint.unwrapped] = _gone_on(path.values, moved)
    return found


@traced
def _gone_on(values: tuple[Expr, ...], moved: Expr) -> Expr:
    return ca.vertcat(*values) + moved


@traced
def _turned(frames: JointFrames, turning: tuple[Expr, ...], duration: Expr) -> Expr:
    """The change (count,) [rad] of the coordinates as the first body turned against the second."""
    middle, zero = frames.placed(duration / 2), ca.SX.zeros(3)
    angular = turning[0] if len(turning) == 1 else turning[0] - turning[1]
    return ca.vertcat(*(free(each, middle).forwards(zero, angular) for each in frames.joint.kind.coordinates))
