"""A problem step by step: what methods see that use the structure of time.

States live on a manifold (orientations are quaternions, joints bind bodies), so a state ``x`` (nx,) is never added to:
small changes of it are ``n`` numbers in the robot's own coordinates, its tangent, and ``retract`` and ``difference``
lead there and back. The tangent holds all that a step carries on: places, velocities, and the forces from which the
next step's sweeps begin. So a linearisation is that of the real step.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np

from symphys.records import dataclass
from symphys.types import Array, Ints

Sparse = Any
"""scipy.sparse.csr_array"""
Followed = tuple[Array, Array, Array, Array | None]
"""States (B, N + 1, nx), inputs (B, N, m), new knots (B, N, w) and merits (B,) of motions under a policy.

A merit is the objective with the squared violations of the limits times their ``penalties``; None where it is unknown.
"""


@dataclass(frozen=True)
class StagedMotion:
    """A rollout, state by state.

    Attributes:
        z: (len(z),) decision vector.
        x: (N + 1, nx) states.
        u: (N, m) inputs of all steps, as the variables give them.
        smoothing: at which it was simulated.
        gapless: whether each state is known to be what the step before it leads to.
    """

    z: Array
    x: Array
    u: Array
    smoothing: float
    gapless: bool = False


@dataclass(frozen=True)
class Linearized:
    """Slopes of all steps about a motion, in tangents of its states.

    A motion may have gaps: state k + 1 is not what step k leads to. The slopes are then by the tangent of state k, and
    of the tangent of what step k leads to from there.

    Attributes:
        a: (N, n, n) the next state by the state.
        b: (N, n, m) the next state by the inputs.
        c: (N, n, s) the next state by the static entries of z, without what these do to the first state.
        start: (n, s) the first state by the static entries of z.
    """

    a: Array
    b: Array
    c: Array
    start: Array


@dataclass(frozen=True)
class Expansion:
    """The augmented objective about a motion, to second order: of state k and inputs k, and of the static entries.

    Second derivatives are those of Gauss and Newton for squares, and made positive semidefinite for other costs.

    Attributes:
        value: the augmented objective.
        x, xx: (N + 1, n) and (N + 1, n, n).
        u, uu, ux: (N, m), (N, m, m) and (N, m, n).
        uy: (N, m, n) by inputs k and by the state after them, k + 1.
        s, ss: (s,) and (s, s).
        sx, su: (N + 1, s, n) and (N, s, m).
    """

    value: float
    x: Array
    xx: Array
    u: Array
    uu: Array
    ux: Array
    uy: Array
    s: Array
    ss: Array
    sx: Array
    su: Array


@dataclass(frozen=True)
class AffinePolicy:
    """Knots of controls as affine functions of the state, step by step.

    In each step at most o knots are old: they were decided before and still act. At most w are new. Where there are
    fewer, the numbers of the others are 0.

    Attributes:
        x: (N, nx) states about which it is.
        old, new: (N, o) and (N, w) the knots there.
        ahead: (N, w) what a whole step adds to the new ones.
        back: (N, w, n + o + s) how they answer the state's tangent, old knots and static entries.
        weights: (N, m, o + w) the inputs of a step by its knots.
        keep: (N, o, o + w) the old knots of the next step by those of this one.
        lower, upper: (N, w) bounds of the new ones.
    """

    x: Array
    old: Array
    new: Array
    ahead: Array
    back: Array
    weights: Array
    keep: Array
    lower: Array
    upper: Array


class CompiledRecursion(Protocol):
    """Recursions over a run of steps, compiled: costates, and Riccati's within bounds; see ``solvers.ddp``."""

    def costates(self, a: Array, slopes: Array, last: Array) -> tuple[Array, Array]:
        """Return the costates (K, n) after K steps, and that before them: slopes[k] + costate @ a[k].

        Of ``a`` (K, n, n), slopes (K, n) of costs by the states before the steps, and the last costate (n,).
        """
        ...

    def suits(self, through: Array) -> bool:
        """Whether it is the faster way for steps of this shape (K, r, r + w)."""
        ...

    def __call__(
        self,
        through: Array,
        slope: Array,
        curve: Array,
        bounds: tuple[Array, Array, Array],
        cost: tuple[Array, Array],
    ) -> tuple[Array, Array, tuple[float, float], tuple[Array, Array]] | None:
        """Take K steps, the last one first; None where a Hessian by decisions is not positive definite.

        Args:
            through: (K, r', r + w) the state after each step by (state, decisions); r' = r unless K = 1.
            slope: (K, r + w) of the costs of the steps.
            curve: (K, r + w, r + w) likewise.
            bounds: lower, upper and damping, (K, w) each.
            cost: slope (r',) and curvature (r', r') of the cost to go after the run.

        Returns:
            Decisions (K, w) and gains (K, w, r); a and b of the fall a t + b t^2 that is expected of a step length t;
            slope (r,) and curvature (r, r) of the cost to go before the run.
        """
        ...


def costates(a: Array, slopes: Array, last: Array, compiled: CompiledRecursion | None) -> tuple[Array, Array]:
    """Return ``CompiledRecursion.costates``, step by step where that is not compiled."""
    if compiled is not None:
        return compiled.costates(a, slopes, last)
    after = np.empty_like(slopes)
    for k in reversed(range(len(a))):
        after[k] = last
        last = slopes[k] + last @ a[k]
    return after, last


class StagedProblem(Protocol):
    """A problem whose horizon is a chain of N equal steps.

    Attributes:
        steps: N.
        state_size, tangent_size, input_size: nx, n and m.
        statics: (s,) the entries of z that are no knots of a control: initial states, parameters.
        weights: (N * m, len(z)) such that u = weights @ z, step after step; 0 for static entries.
        lower, upper: (c,) bounds of the limits: the problem's constraints, in their order.
        penalties: (c,) the weights of their squared violations in the merit, at the time step of the file.
        squares: whether every cost is a sum of squares.
    """

    steps: int
    state_size: int
    tangent_size: int
    input_size: int
    statics: Ints
    weights: Sparse
    lower: Array
    upper: Array
    penalties: Array
    squares: bool

    def start(self, Z: Array) -> Array:
        """Return the first states (B, nx) of Z (B, len(z))."""
        ...

    def step(self, k: int, X: Array, U: Array, Z: Array, smoothing: float) -> Array:
        """Return the states (B, nx) after step k, from X (B, nx), U (B, m) and Z (B, len(z))."""
        ...

    def roll_out(self, z: Array, smoothing: float) -> StagedMotion:
        """Return the motion of ``z`` (len(z),)."""
        ...

    def follow(
        self,
        policy: AffinePolicy,
        about: Array,
        Z: Array,
        lengths: Array,
        smoothing: float,
        shares: Array | float = 1.0,
    ) -> Followed | None:
        """Return the motions of step lengths (B,) under a policy; None where steps must be taken singly.

        ``about``: (len(z),) where the policy was made; ``Z``: (B, len(z)) whose static entries hold; ``shares``: (B,)
        of the feedback.
        """
        ...

    def prepare(self, slopes: bool) -> None:
        """Compile what takes steps; with ``slopes`` begin to compile what linearises, beside other work."""
        ...

    def linearize(self, motion: StagedMotion) -> Linearized:
        """Return slopes of all steps."""
        ...

    def without_forces(self) -> StagedProblem:
        """Return the same steps with tangents without forces; these themselves where there are none.

        Their slopes cost less. They are good for meeting what is asked for, not for the last digits of an objective.
        """
        ...

    def whole_gains(self, motion: StagedMotion, steps: Ints, by_state: Array) -> Array:
        """Return gains by the tangents of all of a state, from those (K, n) by the tangents of ``linearize``.

        They answer the states of the motion before ``steps`` (K,). Where the tangents are those of all of a state, the
        gains are returned as they are.
        """
        ...

    def linearize_from_end(self, motion: StagedMotion) -> Iterator[Linearized]:
        """Yield the slopes in runs of steps, the last run first, each as soon as it is known.

        Slopes are computed in the background from the call on, where there are threads for it.
        """
        ...

    def retract(self, X: Array, D: Array) -> Array:
        """Return the states (B, nx) displaced from X (B, nx) by D (B, n): places, velocities, forces."""
        ...

    def difference(self, X: Array, Y: Array) -> Array:
        """Return D (B, n) with retract(X, D) = Y."""
        ...

    def measure(self, Z: Array, X: Array, U: Array) -> tuple[Array, Array]:
        """Return objectives (B,) and limits (B, c) of Z (B, len(z)), X (B, N + 1, nx) and U (B, N, m)."""
        ...

    def expand(self, motion: StagedMotion, multipliers: Array, penalties: Array) -> Expansion:
        """Return the objective and, for each limit g within [lower, upper], its augmented Lagrangian.

        That is penalty / 2 times the squared distance of g + multiplier / penalty from the bounds; ``multipliers`` and
        ``penalties`` are (c,), and a penalty of 0 leaves a limit out.
        """
        ...

    @property
    def recursion(self) -> CompiledRecursion | None:
        """Return compiled code for the Riccati recursion; None where there is none."""
        ...

    def limit_slopes(self, motion: StagedMotion) -> tuple[Array, Sparse, Sparse, Sparse]:
        """Return limits (c,) and slopes by states (c, (N + 1) * n), inputs (c, N * m), static entries (c, s)."""
        ...
