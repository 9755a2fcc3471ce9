"""Small problems step by step, in explicit formulas: a pendulum, an acrobot, the attitude of a rigid body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse as sp
from tools.single_steps import SingleSteps

from symphys.shooting import (
    Expansion,
    Linearized,
    Nlp,
    ShootingProblem,
    StagedMotion,
    Values,
    VariableBlock,
    WithoutResiduals,
)
from symphys.types import Array

TOLERANCE = 1e-6
"""Of limits."""


@dataclass(frozen=True)
class Formulas:
    """A problem in casadi expressions: x state, u inputs, p the static entries of z.

    Attributes:
        sizes: of x, of its tangent, of u, of p.
        step: (x, u, p) -> x.
        start: p -> x.
        residuals: (x, u, p) -> r of each step; the objective is the sum of all squares.
        final: (x, p) -> r of the last state.
        limits: (x, u, p) -> g of each step.
        end: (x, p) -> g of the last state.
        retract, difference: (x, d) -> x and (x, y) -> d.
    """

    sizes: tuple[int, int, int, int]
    step: Callable[[Any, Any, Any], Any]
    start: Callable[[Any], Any]
    residuals: Callable[[Any, Any, Any], Any]
    final: Callable[[Any, Any], Any]
    limits: Callable[[Any, Any, Any], Any] = lambda x, u, p: ca.SX(0, 1)
    end: Callable[[Any, Any], Any] = lambda x, p: ca.SX(0, 1)
    retract: Callable[[Any, Any], Any] = lambda x, d: x + d
    difference: Callable[[Any, Any], Any] = lambda x, y: y - x


class Chain(SingleSteps):
    """A ``StagedProblem`` of formulas; knots are linear between steps, or constant where there is one for each step."""

    def __init__(
        self,
        formulas: Formulas,
        steps: int,
        knots: int,
        limits: tuple[Any, Any] = ((), ()),
        end: tuple[Any, Any] = ((), ()),
    ) -> None:
        """``limits``, ``end``: (lower, upper) of each step's and of the last state's limits."""
        self.steps, self.formulas = steps, formulas
        self.state_size, self.tangent_size, self.input_size, s = formulas.sizes
        m = self.input_size
        self.statics = knots * m + np.arange(s)
        time = np.arange(steps) if knots == steps else np.linspace(0, knots - 1, steps)
        left = np.minimum(time.astype(int), knots - 1)
        right, share = np.minimum(left + 1, knots - 1), time - left
        by_knot = sp.csr_array((1 - share, (np.arange(steps), left)), (steps, knots))
        by_knot = by_knot + sp.csr_array((share, (np.arange(steps), right)), (steps, knots))
        inputs = sp.kron(by_knot, sp.eye_array(m)).tocsr()
        inputs.eliminate_zeros()
        self.weights = sp.hstack([inputs, sp.csr_array((steps * m, s))]).tocsr()
        self.lower, self.upper = (np.array([*list(limits[side]) * steps, *end[side]], float) for side in (0, 1))
        self.squares, self.penalties = True, np.full(len(self.lower), 1e3)
        self._build()

    def _build(self) -> None:
        nx, n, m, s = self.formulas.sizes
        f = self.formulas
        x, y, d, u, p = (ca.SX.sym(name, size) for name, size in (("x", nx), ("y", nx), ("d", n), ("u", m), ("p", s)))
        moved = f.retract(x, d)
        ahead = f.difference(y, f.step(moved, u, p))
        zero = ca.DM.zeros(n)

        def flat(name: str, inputs: list[Any], outputs: list[Any]) -> ca.Function:
            return ca.Function(name, inputs, [ca.densify(ca.substitute(each, d, zero)) for each in outputs])

        self.f_step = ca.Function("step", [x, u, p], [f.step(x, u, p)])
        self.f_start = ca.Function("start", [p], [f.start(p)])
        self.f_retract = ca.Function("retract", [x, d], [moved])
        self.f_difference = ca.Function("difference", [x, y], [f.difference(x, y)])
        slopes = [ca.jacobian(ahead, each) for each in (d, u, p)]
        self.f_slopes = flat("slopes", [x, y, u, p], slopes)
        self.f_first = ca.Function("first", [p, y], [ca.densify(ca.jacobian(f.difference(y, f.start(p)), p))])
        r, rf = f.residuals(moved, u, p), f.final(moved, p)
        self.f_r = flat("r", [x, u, p], [r, *(ca.jacobian(r, each) for each in (d, u, p))])
        self.f_rf = flat("rf", [x, p], [rf, *(ca.jacobian(rf, each) for each in (d, p))])
        g, gf = f.limits(moved, u, p), f.end(moved, p)
        self.f_g = flat("g", [x, u, p], [g, *(ca.jacobian(g, each) for each in (d, u, p))])
        self.f_gf = flat("gf", [x, p], [gf, *(ca.jacobian(gf, each) for each in (d, p))])

    def p(self, z: Array) -> Array:
        """The static entries."""
        return z[self.statics]

    def start(self, Z: Array) -> Array:
        return batch(self.f_start, Z[:, self.statics])

    def step(self, k: int, X: Array, U: Array, Z: Array, smoothing: float) -> Array:
        return batch(self.f_step, X, U, Z[:, self.statics])

    def roll_out(self, z: Array, smoothing: float) -> StagedMotion:
        u = (self.weights @ z).reshape(self.steps, self.input_size)
        x = [self.start(z[None])[0]]
        for k in range(self.steps):
            x.append(self.step(k, x[-1][None], u[k][None], z[None], smoothing)[0])
        return StagedMotion(z, np.array(x), u, smoothing)

    def linearize(self, motion: StagedMotion) -> Linearized:
        p, x, u = self.p(motion.z), motion.x, motion.u
        P = np.tile(p, (self.steps, 1))
        a, b, c = blocks(self.f_slopes, x[:-1], batch(self.f_step, x[:-1], u, P), u, P)
        return Linearized(a, b, c, self.f_first(p, self.f_start(p)).full())

    def retract(self, X: Array, D: Array) -> Array:
        return batch(self.f_retract, X, D)

    def difference(self, X: Array, Y: Array) -> Array:
        return batch(self.f_difference, X, Y)

    @np.errstate(over="ignore", invalid="ignore")
    def measure(self, Z: Array, X: Array, U: Array) -> tuple[Array, Array]:
        objectives, limits = [], []
        for z, x, u in zip(Z, X, U, strict=True):
            P = np.tile(self.p(z), (self.steps, 1))
            r, rf = blocks(self.f_r, x[:-1], u, P)[0], self.f_rf(x[-1], P[0])[0].full()
            objectives.append((r**2).sum() + (rf**2).sum())
            g = blocks(self.f_g, x[:-1], u, P)[0]
            limits.append(np.concatenate([g.ravel(), self.f_gf(x[-1], P[0])[0].full().ravel()]))
        return np.array(objectives), np.array(limits)

    def expand(self, motion: StagedMotion, multipliers: Array, penalties: Array) -> Expansion:
        N, n, s = self.steps, self.tangent_size, len(self.statics)
        P = np.tile(self.p(motion.z), (N, 1))
        r, rx, ru, rp = blocks(self.f_r, motion.x[:-1], motion.u, P)
        rf, fx, fp = (each[0] for each in blocks(self.f_rf, motion.x[-1:], P[:1]))
        x, xx, sx = np.zeros((N + 1, n)), np.zeros((N + 1, n, n)), np.zeros((N + 1, s, n))
        x[:-1], x[-1] = 2 * T(rx, r)[..., 0], 2 * (fx.T @ rf)[:, 0]
        xx[:-1], xx[-1] = 2 * T(rx, rx), 2 * fx.T @ fx
        sx[:-1], sx[-1] = 2 * T(rp, rx), 2 * fp.T @ fx
        found = Expansion(
            value=float((r**2).sum() + (rf**2).sum()),
            x=x,
            xx=xx,
            u=2 * T(ru, r)[..., 0],
            uu=2 * T(ru, ru),
            ux=2 * T(ru, rx),
            uy=np.zeros((N, self.input_size, n)),
            s=2 * T(rp, r)[..., 0].sum(0) + 2 * (fp.T @ rf)[:, 0],
            ss=2 * T(rp, rp).sum(0) + 2 * fp.T @ fp,
            sx=sx,
            su=2 * T(rp, ru),
        )
        return self._augmented(found, motion, multipliers, penalties) if np.any(penalties) else found

    def _augmented(self, costs: Expansion, motion: StagedMotion, multipliers: Array, penalties: Array) -> Expansion:
        """With the augmented Lagrangian of the limits."""
        values, by_x, by_u, by_s = self.limit_slopes(motion)
        moved = values + multipliers / penalties
        beyond = moved - np.clip(moved, self.lower, self.upper)
        weight = sp.diags_array(penalties * (beyond != 0))
        N, n, m, s = self.steps, self.tangent_size, self.input_size, len(self.statics)

        def cut(a: Any, b: Any, rows: int, columns: int, count: int) -> Array:
            whole = (a.T @ weight @ b).toarray()
            return np.array([whole[k * rows : (k + 1) * rows, k * columns : (k + 1) * columns] for k in range(count)])

        def first(by: Any) -> Array:
            return np.asarray(by.T @ (penalties * beyond))

        def crossed(by: Any, size: int) -> Array:
            shape = s, by.shape[1] // size, size
            return np.asarray((by_s.T @ weight @ by).toarray().reshape(shape).transpose(1, 0, 2))

        return replace(
            costs,
            value=costs.value + float(penalties @ beyond**2) / 2,
            x=costs.x + first(by_x).reshape(N + 1, n),
            xx=costs.xx + cut(by_x, by_x, n, n, N + 1),
            u=costs.u + first(by_u).reshape(N, m),
            uu=costs.uu + cut(by_u, by_u, m, m, N),
            ux=costs.ux + cut(by_u, by_x[:, : N * n], m, n, N),
            s=costs.s + first(by_s),
            ss=costs.ss + (by_s.T @ weight @ by_s).toarray(),
            sx=costs.sx + crossed(by_x, n),
            su=costs.su + crossed(by_u, m),
        )

    recursion = None

    def prepare(self, slopes: bool) -> None:
        """Do nothing: there is nothing to compile."""

    def limit_slopes(self, motion: StagedMotion) -> tuple[Array, Any, Any, Any]:
        P = np.tile(self.p(motion.z), (self.steps, 1))
        g, gx, gu, gp = blocks(self.f_g, motion.x[:-1], motion.u, P)
        e, ex, ep = blocks(self.f_gf, motion.x[-1:], P[:1])
        by_input = sp.vstack([sp.block_diag(list(gu)), sp.csr_array((e.shape[1], self.steps * self.input_size))])
        return (
            np.concatenate([g.ravel(), e.ravel()]),
            sp.csr_array(sp.block_diag([*gx, *ex])),
            sp.csr_array(by_input),
            sp.csr_array(np.concatenate([gp.reshape(g.size, len(self.statics)), ep[0]])),
        )


def T(a: Array, b: Array) -> Array:
    """a' b of each."""
    return np.swapaxes(a, -1, -2) @ b


def batch(function: ca.Function, *inputs: Array) -> Array:
    """A function of rows, for all rows."""
    return blocks(function, *inputs)[0][..., 0]


def blocks(function: ca.Function, *inputs: Array) -> list[Array]:
    """All outputs of a function of rows, (rows, ...)."""
    count = len(inputs[0])
    if not count:
        return [np.zeros((0, *function.size_out(k))) for k in range(function.n_out())]
    found = mapped(function, count).call([ca.DM(np.ascontiguousarray(each.T)) for each in inputs])
    shapes = [function.size_out(k) for k in range(function.n_out())]
    return [
        each.full().reshape(shape[0], count, shape[1]).transpose(1, 0, 2)
        for each, shape in zip(found, shapes, strict=True)
    ]


MAPPED: dict[tuple[int, int], tuple[ca.Function, ca.Function]] = {}


def mapped(function: ca.Function, count: int) -> ca.Function:
    """For all rows at once."""
    key = (function.__hash__(), count)
    if key not in MAPPED:
        MAPPED[key] = (function, function.map(count))
    return MAPPED[key][1]


class Judge(WithoutResiduals):
    """Values by the single rollout."""

    def __init__(self, chain: Chain) -> None:
        self.chain, self.rollouts = chain, 0

    @np.errstate(over="ignore", invalid="ignore")
    def value(self, Z: Array, smoothing: float) -> Values:
        self.rollouts += len(Z)
        motions = [self.chain.roll_out(z, smoothing) for z in Z]
        X, U = np.array([each.x for each in motions]), np.array([each.u for each in motions])
        objective, limits = self.chain.measure(Z, X, U)
        off = np.maximum(self.chain.lower - limits, limits - self.chain.upper).clip(min=0)
        merit = objective + 1e3 * (off**2).sum(1)
        return Values(merit, objective, off / TOLERANCE)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        raise NotImplementedError


def shooting(chain: Chain, guess: Array, lower: Array, upper: Array, **more: Any) -> ShootingProblem:
    """The problem as the driver takes it."""
    count = len(guess)
    scale = np.ones(count)
    return ShootingProblem(
        name="chain",
        blocks=(VariableBlock("z", 0, (count, 1), guess, lower, upper, scale, 0.1 * scale),),
        evaluator=Judge(chain),
        nlp=Nlp(None),
        squares=False,
        constraint_names=tuple(f"limit {k}" for k in range(len(chain.lower))),
        constraint_lower=chain.lower,
        constraint_upper=chain.upper,
        limits=range(len(chain.lower)),
        stop_when_met=False,
        staged=cache(lambda: chain),
        **more,
    )


def boxed(chain: Chain, bound: float = np.inf, guess: float = 0.0, statics: Any = (), **more: Any) -> ShootingProblem:
    """With |knots| <= bound; ``statics``: guesses, free."""
    knots = chain.weights.shape[1] - len(chain.statics)
    bounds = np.concatenate([np.full(knots, bound), np.full(len(chain.statics), np.inf)])
    return shooting(chain, np.concatenate([np.full(knots, guess), statics]), -bounds, bounds, **more)


def pendulum(steps: int = 40, h: float = 0.05, knots: int = 0, fast: float = np.inf, throw: bool = False) -> Chain:
    """A torque-limited pendulum from hanging, upright at the end; |speed| <= fast; ``throw``: first speed is free."""

    def step(x: Any, u: Any, p: Any) -> Any:
        speed = x[1] + h * (u[0] - 9.81 * ca.sin(x[0]) - 0.1 * x[1])
        return ca.vertcat(x[0] + h * speed, speed)

    formulas = Formulas(
        sizes=(2, 2, 1, int(throw)),
        step=step,
        start=lambda p: ca.vertcat(0, p[0] if throw else 0),
        residuals=lambda x, u, p: np.sqrt(h) * ca.vertcat(0.3 * (x[0] - np.pi), 0.1 * x[1], 0.3 * u),
        final=lambda x, p: ca.vertcat(10 * (x[0] - np.pi), x[1], 0.1 * p),
        limits=(lambda x, u, p: x[1]) if np.isfinite(fast) else (lambda x, u, p: ca.SX(0, 1)),
        end=lambda x, p: x[0] - np.pi,
    )
    limits = ([-fast], [fast]) if np.isfinite(fast) else ((), ())
    return Chain(formulas, steps, knots or steps, limits, ([0.0], [0.0]))


def acrobot(steps: int = 40, h: float = 0.05) -> Chain:
    """Two links of 1 m and 1 kg with a motor at the elbow; angles from hanging, the second relative to the first."""
    l1, c1, c2, i1, i2, damping, g = 1.0, 0.5, 1.0, 0.083, 0.33, 0.1, 9.81

    def acceleration(q: Any, v: Any, u: Any) -> Any:
        cos2, sin2 = ca.cos(q[1]), ca.sin(q[1])
        m11 = i1 + i2 + c1**2 + l1**2 + c2**2 + 2 * l1 * c2 * cos2
        m12, m22 = i2 + c2**2 + l1 * c2 * cos2, i2 + c2**2
        bias = l1 * c2 * sin2
        h1, h2 = -bias * (2 * v[0] * v[1] + v[1] ** 2), bias * v[0] ** 2
        g1, g2 = g * (c1 + l1) * ca.sin(q[0]) + g * c2 * ca.sin(q[0] + q[1]), g * c2 * ca.sin(q[0] + q[1])
        t1, t2 = -h1 - g1 - damping * v[0], u[0] - h2 - g2 - damping * v[1]
        det = m11 * m22 - m12 * m12
        return ca.vertcat(m22 * t1 - m12 * t2, m11 * t2 - m12 * t1) / det

    def step(x: Any, u: Any, p: Any) -> Any:
        v = x[2:] + h * acceleration(x[:2], x[2:], u)
        return ca.vertcat(x[:2] + h * v, v)

    goal = ca.DM([np.pi, 0, 0, 0])
    formulas = Formulas(
        sizes=(4, 4, 1, 0),
        step=step,
        start=lambda p: ca.SX.zeros(4),
        residuals=lambda x, u, p: np.sqrt(h) * ca.vertcat(x - goal, np.sqrt(0.1) * u),
        final=lambda x, p: ca.DM([10, 10, 1, 1]) * (x - goal),
    )
    return Chain(formulas, steps, steps)


def attitude(steps: int = 30, h: float = 0.1, parameter: bool = False) -> Chain:
    """A body that turns by 180 degrees about its z axis and by 60 about x, from rest to rest.

    The state is a quaternion and the angular velocity in the body; ``parameter``: a scale of the inertia is free.
    """
    inertia = ca.DM([1.0, 2.0, 3.0])
    turn = multiply(exponential(ca.DM([0, 0, np.pi])), exponential(ca.DM([np.pi / 3, 0, 0])))

    def step(x: Any, u: Any, p: Any) -> Any:
        own = inertia * (p[0] if parameter else 1)
        spin = x[4:] + h * (u - ca.cross(x[4:], own * x[4:])) / own
        return ca.vertcat(multiply(x[:4], exponential(h * spin)), spin)

    def off(x: Any) -> Any:
        return ca.vertcat(logarithm(multiply(conjugate(turn), x[:4])), x[4:])

    formulas = Formulas(
        sizes=(7, 6, 3, int(parameter)),
        step=step,
        start=lambda p: ca.SX([1, 0, 0, 0, 0, 0, 0]),
        residuals=lambda x, u, p: np.sqrt(h) * ca.vertcat(0.1 * x[4:], u),
        final=lambda x, p: ca.vertcat(10 * off(x), 3 * (p - 1.5)),
        retract=lambda x, d: ca.vertcat(multiply(x[:4], exponential(d[:3])), x[4:] + d[3:]),
        difference=lambda x, y: ca.vertcat(logarithm(multiply(conjugate(x[:4]), y[:4])), y[4:] - x[4:]),
    )
    return Chain(formulas, steps, steps)


def multiply(a: Any, b: Any) -> Any:
    """Of quaternions."""
    v = a[0] * b[1:] + b[0] * a[1:] + ca.cross(a[1:], b[1:])
    return ca.vertcat(a[0] * b[0] - ca.dot(a[1:], b[1:]), v)


def conjugate(a: Any) -> Any:
    return ca.vertcat(a[0], -a[1:])


def exponential(turn: Any) -> Any:
    """The quaternion of a rotation vector."""
    half = ca.sqrt(ca.sumsqr(turn) / 4 + 1e-30)
    return ca.vertcat(ca.cos(half), ca.sin(half) / half * turn / 2)


def logarithm(a: Any) -> Any:
    """The rotation vector, at most pi long."""
    a = a * ca.if_else(a[0] < 0, -1, 1)
    length = ca.sqrt(ca.sumsqr(a[1:]) + 1e-30)
    return 2 * ca.atan2(length, a[0]) / length * a[1:]
