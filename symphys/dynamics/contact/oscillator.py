"""A spring with a damper over one step: the impulse that a leapfrog step needs to move as the exact oscillator does.

Letters: w = 2 pi frequency [rad/s], z damping ratio, e deviation [m], a acceleration by everything else, d duration of
the step, d_ that of the step before (0 where leapfrog begins anew), u the mean velocity over the step, u_ that over the
step before, v velocity at the start. Of e'' = a - w^2 e - 2 z w e' the exact solution over d is

    d u = d sigma v + d^2 P / 2 (a - w^2 e),   v_end = d sigma (a - w^2 e) + D v,
    D = 1 - (w d)^2 P / 2 - 2 z w d sigma

with P, sigma -> 1 for w d -> 0. Backwards over d_ (z -> -z: P_, sigma_) it gives u_ = sigma_ v - d_ P_ / 2 (a - w^2 e).
Without v this is the impulse that acts beside a over kick = (d + d_) / 2,

    impulse = -mass (kick w^2 e + b u + c u_),    b = kick d / Q - 1,  c = 1 - kick r / Q
    Q = d (d P + d_ P_ sigma / sigma_) / 2,   r = d sigma / sigma_

so that one oscillator is exact at any step, and several on one body are leapfrog with heavier masses and with dampers
on mean velocities, which keeps energy and is stable. N of them are stable where (b - c) / 2 >= kick w^2 d / 4 - 1 / N;
beyond w d of about 1, b is larger and c smaller by what that lacks for N = 6. From w d = 1.5 to 2.5 the law becomes
implicit Euler, which damps what a step cannot resolve.
"""

from __future__ import annotations

import casadi as ca

from symphys.maths.smoothing import clip
from symphys.records import dataclass
from symphys.types import Expr

MAX_ANGLE = 2.5
"""[rad] Largest w d for which the exact solution is computed: less than half a turn."""
MAX_DAMPING = 15.0
"""Largest z w d for which it is computed, since the solution backwards grows like exp(2 z w d)."""
DOUBLINGS = 7
"""Doublings of the time that lead from the power series to the whole time."""
TERMS = 7
"""Terms of the power series."""
MIN_B = 1e-12
"""Smallest b, by which the softness of a constraint divides."""
RESOLVED, UNRESOLVED = 1.5, 2.5
"""[rad] w d up to which the law is exact, and from which on it is implicit Euler."""
INVERSE_COUNT = 1 / 6
"""One over the number of equal oscillators on one body that are stable at any duration of the step."""


@dataclass(frozen=True)
class Response:
    """P and sigma of the exact solution over a time [s]; see the module."""

    time: Expr
    omega: Expr
    ratio: Expr
    p: Expr
    sigma: Expr

    def mean_velocity(self, velocity: Expr, push: Expr) -> Expr:
        """Return the mean of the velocity over the time, from ``velocity`` and push = a - w^2 e at its start."""
        return self.sigma * velocity + self.time * self.p / 2 * push

    def end_velocity(self, velocity: Expr, push: Expr) -> Expr:
        """Return the velocity at the end of the time."""
        return self.time * self.sigma * push + self.kept * velocity

    @property
    def kept(self) -> Expr:
        """Return D of the module: the share of a velocity that is left at the end of the time."""
        angle = self.omega * self.time
        return 1 - angle**2 * self.p / 2 - 2 * self.ratio * angle * self.sigma


def response(omega: Expr, ratio: Expr, time: Expr) -> Response:
    """Return the exact solution over ``time`` [s].

    ``ratio`` < 0 for backwards. By power series and doubling of the time.
    """
    angle = omega * time
    longest = ca.fmin(MAX_ANGLE, MAX_DAMPING / ca.fmax(ca.fabs(ratio), 1))
    held = ca.fmin(ca.fmax(angle, 0), longest)
    x = held / 2**DOUBLINGS
    series = [ca.SX(1)]
    before = ca.SX(0)
    for n in range(1, TERMS):
        series.append((-2 * ratio * n * series[-1] - before) / ((n + 1) * n))
        before = series[-2]
    p, sigma = ca.SX(0), ca.SX(0)
    for n in reversed(range(TERMS)):
        p, sigma = p * x + 2 * series[n] / (n + 2), sigma * x + series[n]
    for _ in range(DOUBLINGS):
        moved = 1 - x * x * p / 2
        p, sigma = p * (1 + moved) / 4 + sigma * sigma / 2, sigma * (moved - ratio * x * sigma)
        x = 2 * x
    share = ca.if_else(angle > longest, longest / ca.fmax(angle, longest), 1)
    return Response(time, omega, ratio, p * share**2, sigma * share)


@dataclass(frozen=True)
class SpringLaw:
    """The impulse -mass (stiff e + b u + c u_) of a spring and damper over a step, and its force at the end.

    Attributes:
        stiff: kick w^2 [1/s].
        b, c: of the mean velocity over the step, and over the step before.
        end, end_before: of the same in the force impulse / kick - mass (end u + end_before u_) that goes on acting
            [1/s^2]. With it the velocity at the end of the step is exact; the next step takes it off again.
    """

    stiff: Expr
    b: Expr
    c: Expr
    end: Expr
    end_before: Expr


def spring_law(forward: Response, backward: Response) -> SpringLaw:
    """Return the law from the exact solution over the step, and backwards over the step before."""
    d, before, share = forward.time, backward.time, forward.sigma / backward.sigma
    kick, half = (d + before) / 2, d / 2
    q = (d * forward.p + before * backward.p * share) / 2
    stiff, b, c = kick * forward.omega**2, ca.fmax(kick / q - 1, MIN_B), 1 - kick * share / q
    heavier = ca.fmax(stiff * d / 4 - INVERSE_COUNT - (b - c) / 2, 0)
    b, c = b + heavier, c - heavier
    # v_end = pushed (a - w^2 e) + kept u_, with a = ((1 + b) u - (1 - c) u_) / kick + w^2 e
    kept = forward.kept / backward.sigma
    pushed = d * forward.sigma + kept * before * backward.p / 2
    gained = (pushed / half - 1) / kick
    end, end_before = 1 / half - gained * (1 + b), gained * (1 - c) - kept / half

    # beyond a step's reach: implicit Euler, which sweeps that have not settled do not drive apart
    damper = forward.omega * (forward.omega * d + 2 * forward.ratio)
    share = clip((forward.omega * d - RESOLVED) / (UNRESOLVED - RESOLVED), 0, 1, 0)
    resolved = 1 - share
    return SpringLaw(
        stiff=stiff,
        b=resolved * b + share * kick * damper,
        c=resolved * c,
        end=resolved * (end - b / kick),
        end_before=resolved * (end_before - c / kick),
    )
