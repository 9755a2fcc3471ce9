"""What each shipped problem must show: one row a problem and solver, with the options of the file.

A row bounds the work, and says what holds of the answer: numbers, an objective, the same at half the time step, and a
law of physics that the engine has no part in. What takes no time runs every time, whole solves are slow, and seeds
beyond the first are for ``make thorough``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from data.shipped import met, shipped, solve, work
from numpy.typing import ArrayLike
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation
from worlds import flights, hops, slides, swings
from worlds.plate import Plate

from symphys import problems
from symphys.codegen.backends import BEST
from symphys.solvers import Outcome, Status
from symphys.trajectory import Trajectory
from symphys.transcription import Assessment, Transcription
from symphys.types import Array
from symphys.verification.refinement import FINER_DT, finer_problem

GRAVITY = 9.81


@dataclass(frozen=True)
class Found:
    """What a solver found for a problem from a seed."""

    made: Transcription
    outcome: Outcome
    seed: int

    @property
    def z(self) -> Array:
        return self.outcome.z

    @cached_property
    def motion(self) -> Trajectory:
        return self.made.simulate(self.z)

    @cached_property
    def verdict(self) -> Assessment:
        return self.made.judge(self.z)

    @property
    def halved(self) -> Transcription:
        """The problem at half its time step."""
        return finer_problem(self.made, FINER_DT)


def last(motion: Trajectory, *names: str) -> Array:
    """(len(names),): the last numbers of these columns."""
    return np.array([motion[name][-1] for name in names]).ravel()


Law = Callable[[Found], None]


@dataclass(frozen=True)
class Must:
    """A row.

    Attributes:
        most: gradients and Jacobians that the solver takes, or rollouts where there are none.
        solved: whether the exact rollout meets all; None where it need not be judged.
        answer: decision variables, each ``within`` so much.
        below: the objective is less.
        law: holds of what was found.
        finer: of what was found, how many meet all at half the time step as well.
        of: with this number of seeds in one test, ``wanted`` of them must meet all.
        polish: the solver goes on when all is met.
        smoothing: stages in place of the file's [m/s].
    """

    problem: str
    solver: str
    most: float = np.inf
    solved: bool | None = True
    answer: ArrayLike | None = None
    within: ArrayLike = 0.0
    below: float = np.inf
    law: Law = lambda found: None
    finer: int = 0
    of: int = 0
    wanted: int = 1
    polish: bool = False
    smoothing: tuple[float, ...] = ()
    settings: tuple[tuple[str, object], ...] = ()
    backend: str = BEST
    seeds: int = 1
    marks: tuple[Any, ...] = field(default=())

    def cases(self) -> Iterable[Any]:
        """One a seed."""
        stages = (f"stages {self.smoothing}",) if self.smoothing else ()
        many = (f"{self.wanted} of {self.of}",) if self.of else ()
        what = "-".join((self.problem, self.solver, *("polished",) * self.polish, *stages, *many))
        for seed in range(self.seeds):
            marks = (pytest.mark.thorough,) if seed else self.marks
            yield pytest.param(self, seed, id=f"{what}-{seed}", marks=marks)

    def found(self, seed: int) -> list[Found]:
        """From this seed, or from those that met all."""
        made = shipped(self.problem, self.backend, self.settings)
        if self.smoothing:
            made = replace(made, shooting=replace(made.shooting, smoothing=self.smoothing))
        if self.of:
            outcomes = met(self.solver, made, self.of, self.wanted)
        else:
            outcomes = [solve(self.solver, made, seed, self.polish)]
        return [Found(made, outcome, seed) for outcome in outcomes]


def rows(problem: str, solvers: dict[str, float] | str, later: str = "", quick: str = "", **must: Any) -> list[Must]:
    """Rows of one problem: for each solver its work.

    Those of ``quick`` run every time, those of ``later`` with ``make thorough``, and the others are slow.
    """
    most = dict.fromkeys(solvers.split(), np.inf) if isinstance(solvers, str) else solvers
    mark = dict.fromkeys(quick.split(), ()) | dict.fromkeys(later.split(), (pytest.mark.thorough,))
    slow = (pytest.mark.slow,)
    return [Must(problem, name, number, marks=mark.get(name, slow), **must) for name, number in most.items()]


def swings_up_pendulum(found: Found) -> None:
    np.testing.assert_allclose(
        last(found.motion, "hinge.angle", "hinge.rate"), swings.PENDULUM.swung(found.z), atol=0.1
    )


def swings_up_acrobot(found: Found) -> None:
    """At half the step its end is off by a fourth, so that both tell the end of the exact motion."""
    assert found.outcome.trace[-1].best < 95.603707 * (1 + 1e-5)
    assert found.outcome.trace[-1].max_violation <= 1
    motions, exact = (found.motion, found.halved.simulate(found.z)), swings.ACROBOT.swung(found.z)
    names = [f"{joint}.{name}" for name in ("angle", "rate") for joint in ("shoulder", "elbow")]
    ends = [last(motion, *names) for motion in motions]
    apart = [np.abs(end - exact).max() for end in ends]
    assert apart[1] < 0.04
    assert apart[0] == pytest.approx(4 * apart[1], rel=0.1)
    np.testing.assert_allclose((4 * ends[1] - ends[0]) / 3, exact, atol=4e-3)


def stands_where_the_cart_began(found: Found) -> None:
    assert found.outcome.trace[-1].max_violation <= 1
    assert np.cos(found.motion["pivot.angle"][-1]) < -0.98 and abs(found.motion["rail.position"][-1]) < 0.1


def swings_up_by_the_equations(found: Found) -> None:
    """Whatever the forces are."""
    assert (np.abs(swings.CART_POLE.swung(found.z) - swings.UPRIGHT) < [0.01, 0.03, 0.03, 0.15]).all()


def takes_the_least_force(found: Found) -> None:
    assert swings.least_effort() == pytest.approx(60.0, abs=0.1)
    assert found.verdict.costs["effort"] / 0.001 == pytest.approx(swings.least_effort(), rel=0.004)


def bounces_off_a_wall_once(found: Found) -> None:
    """The motions agree through the bounce, and until what differs has grown for a second in an unstable motion."""
    places = np.stack([found.motion["cart.position"][:, 0], found.motion["pivot.angle"].ravel()], axis=1)
    other = swings.WALLS.swung(found.z, np.linspace(0, 2, 201))
    np.testing.assert_allclose(places[:60], other[:60, :2], atol=4e-3)
    np.testing.assert_allclose(places[:120], other[:120, :2], atol=4e-2)
    touching = found.motion["pole.position"][:, 0] > 1.0
    assert np.count_nonzero(np.diff(touching.astype(int)) == 1) == 1
    assert np.max(np.abs(other[:, 1])) < 1


def is_the_torque_of_inverse_dynamics(found: Found) -> None:
    (bar,) = found.made.problem.world().bodies
    distance, t = 0.3, np.linspace(0, 2, 41)
    swing = (1 - np.cos(np.pi * t)) / 2
    torque = (float(bar.inertia[0]) + distance**2) * np.pi**2 * np.cos(np.pi * t) / 2
    torque += GRAVITY * distance * np.sin(swing)
    assert np.sqrt(np.mean((found.z - torque)[2:-2] ** 2)) < 0.01 * np.abs(torque).max()
    swing = (1 - np.cos(np.pi * found.motion.time)) / 2
    assert np.abs(found.motion.joint_value[:, 0, 0] - swing).max() < 1e-3


def scores_off_the_board(found: Found) -> None:
    assert np.linalg.norm(flights.basket_missed(found.z)) < 0.0101
    assert found.motion.velocity[found.motion.time > flights.BASKET_TIME, 0, 2].max() < 0
    assert found.motion.position[-1, 0, 2] < flights.RING[2] - flights.BASKET_RADIUS


def is_the_throw_of_the_formulas(found: Found) -> None:
    throw = fsolve(flights.basket_missed, found.made.shooting.start(0), xtol=1e-12)
    np.testing.assert_allclose(throw, [2.156, -1.456, 6.896], rtol=0, atol=5e-4)
    np.testing.assert_allclose(found.z, throw, rtol=0, atol=1e-7)


def curls_into_the_corner(found: Found) -> None:
    """It starts beside the goal and comes back."""

    def air(v: Array) -> Array:
        speed = np.linalg.norm(v)
        return np.asarray((-0.0064 * speed * v + 0.0059 * speed * np.cross(flights.UP, v)) / 0.43)

    flown = flights.flight([0, 0, 0.11, *found.z], air, 1.1)
    assert flown.y[:3, -1] == pytest.approx([25, 3.4, 2.2], abs=2e-4)
    assert found.z[1] < 0


def lands_and_kicks_on(found: Found) -> None:
    """A flight with topspin, a bounce in closed form, and a flight; without spin the same shot misses the table."""
    mass, radius, table = 0.0027, 0.02, 0.76
    disc = 0.6 * np.pi * radius**2

    def air(spin: Array) -> Callable[[Array], Array]:
        return lambda v: (-0.4 * disc * np.linalg.norm(v) * v + 0.6 * radius * disc * np.cross(spin, v)) / mass

    velocity, spin = found.z[:3], found.z[3:]
    start = np.array([-1.6, -0.2, 0.9, *velocity])
    first = flights.flight(start, air(spin), 0.6, table + radius)
    landed = first.y[:, -1]
    assert first.t[-1] == pytest.approx(0.34, abs=2e-3)
    assert landed[:2] == pytest.approx([0.85, 0.3], abs=0.02)
    over = next(y for y in first.sol(np.linspace(0, first.t[-1], 2000)).T if y[0] > -radius)
    assert over[2] > table + 0.1525 + radius
    velocity, spin = flights.bounced(landed[3:], spin, flights.UP, radius, 0.876, 0.2)
    second = flights.flight([*landed[:3], *velocity], air(spin), 0.6 - first.t[-1], table + radius)
    assert second.y[:3, -1] == pytest.approx([2.25, 0.75, 0.91], abs=0.01)
    assert flights.flight(start, air(np.zeros(3)), 1.0, table + radius).y[0, -1] > 2.74 / 2


def brings_bat_and_ball_back(found: Found) -> None:
    """By another motion, whatever the forces are; its bat has the speed of the formula."""
    (bat, ball, rise, speed), before = flights.juggled(found.z)
    assert np.hypot(ball - 1, 0.1 * speed) < 0.012
    assert np.hypot(bat - 0.5, 0.1 * rise) < 0.012
    assert before == [pytest.approx(flights.BAT_SPEED, abs=0.1)]


def meets_the_ball_with_the_speed_of_the_formula(found: Found) -> None:
    assert pytest.approx(0.654, abs=1e-3) == flights.BAT_SPEED
    end, before = flights.juggled(found.z)
    np.testing.assert_allclose(end, [0.5, 1, 0, 0], rtol=0, atol=1e-3)
    assert before == [pytest.approx(flights.BAT_SPEED, abs=2e-3)]


DRIBBLE_BACK = np.sqrt(2 * GRAVITY * (0.9 - 0.12))
"""[m/s] Speed at the ground of a flight back to the hand."""


def dribbled(found: Found) -> list[int]:
    """The samples after the ball turned around near the ground; one in each period, and at its end the ball is up."""
    motion, period = found.motion, 0.65
    height, speed = motion["ball.position"][:, 2], motion["ball.velocity"][:, 2]
    turned = np.flatnonzero((height[1:] < 0.12 + 0.1) & (speed[1:] > 0.5) & (speed[:-1] < -0.5)) + 1
    assert [int(motion.time[k] / period) for k in turned] == [0, 1, 2]
    for top in (round(k * period / 0.01) for k in (1, 2, 3)):
        assert abs(height[top] - 0.9) < 0.02
        assert abs(speed[top]) < 0.2
    return turned.tolist()


def pushes_give_what_bounces_take(found: Found) -> None:
    """A push down to 1 / e of the speed that a flight back takes; a fall from rest has that speed itself."""
    speed = found.motion["ball.velocity"][:, 2]
    for k in dribbled(found):
        assert speed[k] == pytest.approx(DRIBBLE_BACK, abs=0.15)
        assert -speed[k - 1] == pytest.approx(DRIBBLE_BACK / 0.8, abs=0.25)


def rolls_into_the_pocket(found: Found) -> None:
    assert np.abs(slides.pocket_missed(found.z)).max() < 0.0101


def hooks_as_the_formula_says(found: Found) -> None:
    """Rolling begins within a step, so the last digits are those of the time step. A lane is 1.054 m wide."""
    exact = fsolve(slides.pocket_missed, [8, 0, -20], xtol=1e-12)
    np.testing.assert_allclose(found.z, exact, rtol=0, atol=1e-4)
    assert np.abs(found.motion.position[:, 0, 1]).max() + slides.BALL_RADIUS < 1.054 / 2


def goes_along_as_fast(found: Found) -> None:
    """The way of the kick across and its place trade off against each other; its way along does not."""
    assert found.z[0] == pytest.approx(slides.KICK[0], abs=0.02)


def brings_the_plate(within: float, turn: float) -> Law:
    """To its place by the model of a plate on four corners; 2 mrad are missing at this time step."""

    def law(found: Found) -> None:
        place = Plate((0.4, 0.3), 0.01, 0.35).slid(found.z)
        assert (np.abs(place - [2, 0.3, np.pi / 2]) <= [within, within, turn]).all(), place

    return law


def has_geometric_masses(found: Found) -> None:
    """Each mass is the geometric mean of its neighbours."""
    assert found.verdict.objective == pytest.approx(slides.kept_in_row(slides.ROW)[1], rel=1e-6)
    np.testing.assert_allclose(found.z, slides.ROW[1:-1], rtol=5e-3)


def friction_holds_it(found: Found) -> None:
    """Below 3.9 N it stays where it is, so that the gradient is rounding and nothing else."""
    shooting = found.made.shooting
    gradient = shooting.evaluator.gradient(shooting.start(found.seed)[None], 0.0).gradient
    assert gradient is not None and np.abs(gradient).max() < 1e-10
    assert found.outcome.status is Status.CONVERGED and "friction holds" in found.outcome.advice
    assert found.verdict.objective == pytest.approx(1.25, rel=1e-6)


def goes_in_stages(found: Found) -> None:
    assert found.outcome.status is Status.MET
    assert [stage.smoothing for stage in found.outcome.stages] == [0.1, 0.01, 0.0]


def comes_down_to_the_goal(least: float, most: float, iterations: int) -> Law:
    """The optimum is 1.396542, at a kink of the objective; the solver ends by itself there."""

    def law(found: Found) -> None:
        assert least < found.verdict.objective <= most
        assert found.outcome.trace[-1].iteration <= iterations
        assert found.outcome.status is not Status.FAILED

    return law


def is_as_fast_as_friction_allows(found: Found) -> None:
    """Bang-bang control of tray and glass together."""
    assert found.verdict.objective == pytest.approx(2 * np.sqrt(1.0 / (0.95 * 0.3 * GRAVITY)), abs=1e-3)


def slides_within_friction(found: Found) -> None:
    speed = found.motion["box.velocity"][:, 0]
    assert np.abs(np.diff(speed) / np.diff(found.motion.time)).max() < 1.05 * 0.2 * GRAVITY
    assert np.ptp(found.motion["box.position"][:, 2]) < 1e-3


def knocks_the_puck(found: Found) -> None:
    """The pusher's way to the hit is that of its forces to a step, the puck's from there on that of its damping."""
    mass, damping, held, motion = 0.1, 0.1, 0.05, found.motion
    if found.seed == 0:
        assert found.halved.judge(found.z).checks[0].error < 0.1
    touching = np.flatnonzero(np.linalg.norm(motion.contact_force, axis=2).sum(axis=1) > 0)
    first, last = int(touching[0]) - 1, int(touching[-1]) + 1
    times, dt = motion.time[: first + 1], found.made.problem.simulation.dt
    for axis, forces in zip("xy", found.z[:80].reshape(2, 40), strict=True):
        pushed = [np.clip(times - k * held, 0, held) for k in range(40)]
        coasts = [np.maximum(times - k * held - held, 0) for k in range(40)]
        way = sum(f / mass * (t**2 / 2 + t * after) for f, t, after in zip(forces, pushed, coasts, strict=True))
        late = dt * np.abs(motion[f"pusher_{axis}.rate"][: first + 1]).max()
        np.testing.assert_allclose(motion[f"pusher_{axis}.position"].ravel()[: first + 1], way, atol=late)
        slid = motion[f"puck_{axis}.rate"][last] * mass / damping
        slid = slid * (1 - np.exp(-damping / mass * (2.0 - motion.time[last])))
        ended = motion[f"puck_{axis}.position"][-1] - motion[f"puck_{axis}.position"][last]
        np.testing.assert_allclose(ended, slid, rtol=0.02)


def rolls_the_ball(found: Found) -> None:
    rolled = -np.ptp(found.motion["ball.position"][:, 0]) / 0.06
    turned = np.trapezoid(found.motion["ball.angular_velocity"][:, 1], found.motion.time)
    assert turned == pytest.approx(rolled, rel=0.05)


def reaches_the_point(found: Found) -> None:
    """Within 1 cm after 7 s and at the end; servos stay within their limits."""
    motion, dt = found.motion, found.made.problem.simulation.dt
    assert found.made.shooting.n == 17284
    for k in (round(7 / dt), round(8 / dt)):
        w, *axis = motion.orientation[k, 3]
        tip = motion.position[k, 3] + Rotation.from_quat([*axis, w]).apply([0, 0, 0.075])
        assert np.linalg.norm(tip - [0.2, 0.35, 0.3]) < 0.01
    assert np.abs(motion.joint_value).max() < np.pi / 2 + 1e-3
    assert np.abs(motion.joint_torque).max() < 30 + 1e-9


def turns_the_spinner(found: Found) -> None:
    assert found.halved.judge(found.z).checks[0].error < 0.2


def passes_the_wall(found: Found) -> None:
    """The rail's motor takes trolley and load, 7 kg in all, over 4 m from rest to rest: bang-bang is least."""
    load, time = found.motion["load.position"], found.motion.time[-1]
    over = np.abs(load[1:, 0] - 2) < 0.25 - 0.01
    assert over.any() and (load[1:][over, 2] > 1.6 - 0.025).all()
    assert 2 * np.sqrt(4 * 7 / 40) < time < 4.0
    assert found.halved.judge(found.z).worst < 2


def turns_the_door(found: Found) -> None:
    """A round finger without friction pushes along a line through its centre: its moment, spring, damper turn it."""
    motion, (pair,) = found.motion, found.made.rollout.world.pairs
    sign = 1 if found.made.rollout.world.bodies[pair.first.body].name == "door" else -1
    middle = (motion["finger.position"][1:] + motion["finger.position"][:-1]) / 2
    force = sign * motion.contact_force[:, 0]
    moment = middle[:, 0] * force[:, 1] - middle[:, 1] * force[:, 0]
    angle, rate = (motion[f"hinge.{name}"].ravel() for name in ("angle", "rate"))
    inner = moment - (angle[1:] + angle[:-1]) / 2 - 0.5 * (rate[1:] + rate[:-1]) / 2
    inertia = 4 * (0.4**2 + (0.8**2 + 0.04**2) / 12)
    gained = np.cumsum(inner) * found.made.rollout.dt / inertia
    assert gained == pytest.approx(rate[1:], abs=0.03 * np.abs(rate).max())


def flies_from_the_bar(found: Found) -> None:
    """Between bar and ground the centre of mass falls freely, and the gymnast ends on the feet, head up."""
    motion = found.motion
    centre = (30 * motion["torso.position"] + 20 * motion["legs.position"]) / 50
    aloft = (motion.time[1:-1] > 0.92) & (np.abs(motion.contact_force[1:]).max(axis=(1, 2)) == 0)
    aloft &= np.cumsum(~aloft & (motion.time[1:-1] > 0.92)) == 0
    falls = np.diff(centre, 2, axis=0)[aloft] / found.made.rollout.dt**2
    assert len(falls) > 10
    assert falls == pytest.approx(np.tile([0, 0, -GRAVITY], (len(falls), 1)), abs=0.05)
    assert motion["torso.position"][-1, 2] > motion["legs.position"][-1, 2] + 0.5


def quiet_steps(motion: Trajectory) -> Array:
    """(N,) whether nothing touches anything in a step, nor hits it in the steps beside it."""
    force = np.abs(motion.contact_force).max(axis=(1, 2), initial=0.0)
    return np.asarray(np.convolve(force, [1.0, 1.0, 1.0], "same") == 0)


def falls_freely(found: Found, centre: Array, least: int) -> None:
    """A centre of mass (N + 1, 3), where nothing touches anything, in at least so many pairs of steps."""
    quiet = quiet_steps(found.motion)
    falls = np.diff(centre, 2, axis=0)[quiet[:-1] & quiet[1:]] / found.made.rollout.dt**2
    assert len(falls) >= least
    assert falls == pytest.approx(np.tile([0, 0, -GRAVITY], (len(falls), 1)), abs=0.05)


def turns_in_the_air(found: Found) -> None:
    """Out of the pan the cake falls freely and turns at one rate, by more than a quarter of a turn in all."""
    motion, quiet = found.motion, quiet_steps(found.motion)
    falls_freely(found, motion["pancake.position"], 10)
    rate = motion["pancake.angular_velocity"][:, 1]
    assert np.abs(np.diff(rate)[quiet]).max() < 1e-6 * np.abs(rate).max()
    assert abs(rate[1:][quiet].sum()) * found.made.rollout.dt > np.pi / 2


def folds_to_turn(found: Found) -> None:
    """The centre of mass falls, and the angular momentum about it stays; without folding it would be 5.6 rad."""
    motion = found.motion
    parts = {"trunk": (35.0, 1.8), "arms": (6.0, 0.3), "legs": (22.0, 1.6)}
    mass = sum(each for each, _ in parts.values())
    place, speed = (
        sum(each * motion[f"{name}.{what}"] for name, (each, _) in parts.items()) / mass
        for what in ("position", "velocity")
    )
    falls_freely(found, place, 100)
    turning = sum(
        inertia * motion[f"{name}.angular_velocity"]
        + each * np.cross(motion[f"{name}.position"] - place, motion[f"{name}.velocity"] - speed)
        for name, (each, inertia) in parts.items()
    )[:, 1]
    assert turning == pytest.approx(np.full_like(turning, turning[0]), rel=5e-3)
    assert motion["hip.angle"].min() < -0.5


def climbs_by_its_motors(found: Found) -> None:
    """They work at least what lifts 4 kg by 6 cm, and all that the cart gains is theirs."""
    motion, dt = found.motion, found.made.rollout.dt
    power = sum(motion[f"{axle}.torque"] * (motion[f"{axle}.rate"][1:] + motion[f"{axle}.rate"][:-1]) / 2
                for axle in ("axle_r", "axle_f"))  # fmt: skip
    assert np.sum(power) * dt > 4 * GRAVITY * 0.06
    assert motion["front.position"][-1, 2] == pytest.approx(0.16, abs=0.01)


def tips_over_its_edge(found: Found) -> None:
    """Its centre rises to half the diagonal of its side, less what its round edge takes, and ends at half its width."""
    height = found.motion["box.position"][:, 2]
    assert np.hypot(0.05, 0.1) - 0.005 < height.max() < np.hypot(0.05, 0.1) + 0.003
    assert height[-1] == pytest.approx(0.05, abs=2e-3)


def leaves_the_ground(found: Found) -> None:
    """Aloft the centre of mass falls freely."""
    masses = {"trunk": 40.0, "thigh": 16.0, "shank": 8.0, "foot": 2.0}
    centre = sum(each * found.motion[f"{name}.position"] for name, each in masses.items()) / sum(masses.values())
    falls_freely(found, np.asarray(centre), 10)


def flies_by_newton_and_euler(found: Found) -> None:
    """To second order in the step; the poles are passed half a metre to their sides."""
    wanted = flights.quadrotor(found.z.reshape(4, -1), 4.5)
    ends = [motion.position[-1, 0] for motion in (found.motion, found.halved.simulate(found.z))]
    assert np.abs(ends[1] - wanted[:3]).max() < 0.02
    np.testing.assert_allclose((4 * ends[1] - ends[0]) / 3, wanted[:3], atol=2e-3)
    sides = [np.interp(x, found.motion.position[:, 0, 0], found.motion.position[:, 0, 1]) for x in (1.5, 3, 4.5)]
    assert np.abs(sides - np.array([0.5, -0.5, 0.5])).max() < 0.1


def closes_the_gait(found: Found) -> None:
    """By the exact rollout, at 1 m/s; its cost of transport is that of the motion's own columns.

    To 1e-6 from the guess; from other starts IPOPT may end at a point that it has passed and that is better, and
    closes to a thousandth of what is tolerated.
    """
    motion, close = found.motion, 1e-6 if found.seed == 0 else 2e-5
    status = found.outcome.status
    assert status == Status.CONVERGED or (found.seed > 0 and status == Status.STALLED)
    for name in hops.PERIODIC:
        assert motion[name][-1] == pytest.approx(motion[name][0], abs=close)
    moved = motion["torso.position"][-1, 0] - motion["torso.position"][0, 0]
    assert moved == pytest.approx(found.z[0], abs=close)
    losses = 0.02 * motion["thruster.command"] ** 2 + 0.2 * motion["hip.command"] ** 2
    cost = (motion.time[1] - motion.time[0]) * losses[:200].sum() / (GRAVITY * sum(hops.GAIT.values()) * moved)
    assert found.verdict.objective == pytest.approx(float(cost), rel=1e-6)
    assert found.verdict.objective == pytest.approx(0.016935, rel=2e-3)


def jumps_half_a_metre(found: Found) -> None:
    """Aloft for 0.1 s at least, landing on its foot, the leg within its limits."""
    motion = found.motion
    foot, torso = (motion.body_names.index(name) for name in ("foot", "torso"))
    assert np.linalg.norm(motion.position[-1, foot] - [0.5, 0, 0.05]) < 0.05
    assert np.linalg.norm(motion.position[0, foot] - [0, 0, 0.05]) < 1e-6
    force = np.linalg.norm(motion.contact_force, axis=2).sum(axis=1)
    assert np.max(np.diff(np.flatnonzero(force > 0))) >= 10
    assert motion.position[np.flatnonzero(force == 0), foot, 2].max() > 0.1
    assert motion.position[:, torso, 2].min() > 0.3
    leg = motion.joint_value[:, motion.joint_names.index("thruster"), 0]
    assert leg.min() > -0.15 - 1e-3 and leg.max() < 1e-3


def flies_a_parabola(found: Found) -> None:
    """To its place, with a flight in which the centre of mass falls freely."""
    motion = found.motion
    assert motion["torso.position"][-1, 0] == pytest.approx(0.5, abs=0.05)
    aloft = hops.clearance(motion) > 2e-3
    assert aloft.sum() > 20
    inside = np.flatnonzero(aloft[:-2] & aloft[1:-1] & aloft[2:])
    fall = np.diff(hops.of_centre(motion, hops.PLANAR_HOPPER, "position"), 2)[inside]
    np.testing.assert_allclose(fall / found.made.problem.simulation.dt**2, -GRAVITY, atol=0.05)


def hops_three_times(found: Found) -> None:
    """Three flights, and a foot that is where it should land and stands; it rolls a little."""
    motion, foot = found.motion, found.motion["foot.position"]
    assert len(hops.flights(motion)) == 3
    for k, (leaves, lands) in enumerate(zip((0.05, 0.65, 1.25), (0.6, 1.2, 2.0), strict=True)):
        aloft = (motion.time > leaves) & (motion.time < lands)
        assert foot[aloft, 2].max() - 0.04 > 0.07
        at = int(np.argmin(np.abs(motion.time - lands)))
        assert foot[at] == pytest.approx([0.3 * (k + 1), 0, 0.04], abs=0.03)
        assert foot[at - 10] == pytest.approx(foot[at], abs=2e-3)


def lifts_every_foot(found: Found) -> None:
    heights = np.stack([found.motion[f"{leg}_shank.position"][:, 2] for leg in hops.LEGS], axis=1)
    assert (np.ptp(heights, axis=0) > 0.01).all()


def shifts_its_torso(found: Found) -> None:
    """To 5 mm, on feet that stay where they are."""
    motion = found.motion
    assert np.abs(motion.position[-1, 0] - [0.03, 0.03, 0.55]).max() < 0.005
    assert np.abs(motion.velocity[-1, 0]).max() < 0.02
    assert (motion.contact_force[-1, :, 2] > 5).sum() >= 3
    legs = [motion.body_names.index(f"{leg}_lower") for leg in hops.LEGS]
    w, *axis = np.moveaxis(motion.orientation[-1, legs], 1, 0)
    feet = motion.position[-1, legs] + Rotation.from_quat(np.stack([*axis, w], axis=1)).apply([0, 0, -0.15])
    assert np.abs(feet[:, :2] - [[0.3, 0.2], [0.3, -0.2], [-0.3, 0.2], [-0.3, -0.2]]).max() < 0.02
    assert np.abs(motion.joint_torque).max() < 30 + 1e-9


def bounces_for_ever(found: Found) -> None:
    """What meets the target, 1e-3 m/s, may be off by 2e-4 m, 3.9 m/s at the ground over 2 g."""
    assert found.z == pytest.approx([0.1 + GRAVITY * 0.8**2 / 8, 1.2 / 0.8], abs=1e-4)


def costs_least_transport(found: Found) -> None:
    """The push falls linearly."""
    assert found.verdict.objective == pytest.approx(2 * np.sqrt(3 * 5 * 0.02) / (4 * GRAVITY), rel=1e-4)
    first = np.sqrt(3 * 5 / 0.02)
    assert found.z == pytest.approx(np.linspace(first, 0, 21), abs=0.01 * first)


def is_bang_bang(found: Found) -> None:
    assert found.z[0] == pytest.approx(2 * np.sqrt(1.5 * 2 / 10), abs=1e-6)
    assert found.z[1:] == pytest.approx(np.repeat([10.0, -10.0], 10), abs=1e-4)
    assert found.motion.time[-1] == pytest.approx(found.z[0])


def pushes_less_and_less(found: Found) -> None:
    """Before the flight the push falls linearly."""
    slope = 3 * 2 * (0.5 + GRAVITY / 2) / (1 - 0.6**3)
    middles = (np.arange(20) + 0.5) / 50
    assert found.z[:20] == pytest.approx(slope * (1 - middles), abs=0.05)
    assert found.z[20:] == pytest.approx(0, abs=1e-3)


def brakes_between_two_speeds(found: Found) -> None:
    """Coasting, an exponential decay, coasting: the way of the decay is that of the logarithmic mean."""
    speed, strength = found.z
    mean = (speed - 0.5) / np.log(speed / 0.5)
    assert 0.4 * speed + 0.4 * mean + 0.2 * 0.5 == pytest.approx(1.5, abs=2e-4)
    assert strength == pytest.approx(2 * np.log(speed / 0.5) / 0.4, rel=1e-3)


def stops_on_asphalt(found: Found) -> None:
    """v - mu g t / 2 on ice, then w^2 / 2 mu' g."""
    speed, roughness = found.z
    assert speed == pytest.approx(2 + 0.05 * GRAVITY / 2, abs=2e-4)
    assert found.verdict.outputs["speed at the edge [m/s]"] == pytest.approx(speed - 0.05 * GRAVITY, rel=1e-9)
    assert roughness == pytest.approx((2 - 0.05 * GRAVITY / 2) ** 2 / GRAVITY, abs=2e-4)


STROKE = [1.1299, 0.5717, 7.55, -18.18]
"""Velocity [m/s] and spin [rad/s] of the bank shot, pursued to the last digit by least squares."""
PUTT = [2.3215, -1.1838]
"""Where the putt goes as the time step goes to 0, from 10 ms, 5 ms and 2.5 ms: its changes halve."""

TABLE = [
    *rows("acrobot", "ilqr multiple_shooting", "ilqr multiple_shooting", solved=None, law=swings_up_acrobot, seeds=20),
    *rows("air_hockey", "ilqr", "ilqr", law=knocks_the_puck, seeds=5),
    *rows("arm_ball", "ilqr", "ilqr", below=0.5, finer=1, law=rolls_the_ball),
    *rows("arm_reach", {"gradient": 150}, "gradient", solved=None, law=reaches_the_point,
          settings=(("simulation.dt", 0.02),)),
    *rows("arm_reach", {"gradient": 150}, "gradient", solved=None, law=reaches_the_point, seeds=3),
    *rows("bank_shot", {"gradient": 25, "least_squares": 4, "ipopt": 14, "cma": 350}, "gradient least_squares",
          seeds=2),
    *rows("basket", {"least_squares": 5}, quick="least_squares", law=is_the_throw_of_the_formulas, polish=True,
          backend="casadi"),
    *rows("basket", {"gradient": 12, "ipopt": 16, "cma": 300}, law=scores_off_the_board, seeds=2, backend="casadi"),
    *rows("bounce_cycle", "ilqr multiple_shooting least_squares", "multiple_shooting least_squares",
          law=bounces_for_ever, polish=True),
    *rows("bowling", {"least_squares": 7}, quick="least_squares", law=hooks_as_the_formula_says, polish=True),
    *rows("bowling", {"gradient": 100, "ipopt": 40, "cma": 700}, law=rolls_into_the_pocket, seeds=2),
    *rows("cart_double_pendulum", "ilqr", "ilqr", solved=None, law=stands_where_the_cart_began),
    *rows("cart_pole", {"gradient": 150, "least_squares": 8, "ipopt": 25, "cma": 6000},
          law=swings_up_by_the_equations, seeds=2),
    *rows("cart_pole", "least_squares", law=takes_the_least_force, polish=True),
    *rows("cart_pole_walls", "ilqr", "ilqr", below=0.4702 * 1.001, law=bounces_off_a_wall_once, seeds=3),
    *rows("catch", "ilqr", "ilqr", below=0.07, of=5, wanted=5, finer=3),
    *rows("cost_of_transport", "ilqr multiple_shooting ipopt", "multiple_shooting ipopt",
          law=costs_least_transport),
    *rows("crane", "race", "race", law=passes_the_wall),
    *rows("dismount", "race", "race", law=flies_from_the_bar),
    *rows("door", "race ilqr", "race ilqr", law=turns_the_door, finer=1),
    *rows("dribble", "cma", "cma", of=2, law=pushes_give_what_bounces_take),
    *rows("eddy_brake", "ilqr multiple_shooting least_squares", "multiple_shooting least_squares",
          quick="ilqr", law=brakes_between_two_speeds, backend="casadi"),
    *rows("fast_tray", "ilqr", "ilqr", law=is_as_fast_as_friction_allows),
    *rows("fastest_move", "ilqr ipopt", "ipopt", law=is_bang_bang),
    *rows("fastest_move", "multiple_shooting", "multiple_shooting", law=is_bang_bang,
          settings=(("solver.multiple_shooting.tolerance", 1e-8),)),
    *rows("follow_swing", "ilqr multiple_shooting least_squares", "multiple_shooting least_squares",
          solved=None, law=is_the_torque_of_inverse_dynamics),
    *rows("free_kick", "least_squares", quick="least_squares", law=curls_into_the_corner, polish=True),
    *rows("hopper_gait", "ipopt", "ipopt", law=closes_the_gait, finer=1, seeds=2),
    *rows("hopper_jump", "gradient", "gradient", of=3, law=jumps_half_a_metre),
    *rows("hopper_jump", "gradient", "gradient", of=5, wanted=2, law=jumps_half_a_metre),
    *rows("ice_and_asphalt", "least_squares ilqr", "least_squares ilqr", law=stops_on_asphalt),
    *rows("juggle", {"gradient": 60, "least_squares": 6, "ipopt": 30, "cma": 1500}, law=brings_bat_and_ball_back,
          seeds=2, backend="casadi"),
    *rows("juggle", "least_squares", law=meets_the_ball_with_the_speed_of_the_formula,
          polish=True, backend="casadi"),
    *rows("kerb", "race", "race", law=climbs_by_its_motors),
    *rows("knock", {"least_squares": 7}, "least_squares", answer=slides.KICK, within=[1e-4, 2e-3, 1e-4], polish=True),
    *rows("knock", {"gradient": 40, "ipopt": 18, "cma": 350}, "gradient ipopt cma", law=goes_along_as_fast, seeds=2),
    *rows("mini_cheetah_ahead", "ilqr", "ilqr", below=2.0, finer=1, law=lifts_every_foot),
    *rows("pancake", "race", "race", law=turns_in_the_air),
    *rows("parcel", {"least_squares": 6}, "least_squares", answer=[3.6643, 0.5606, 3.7407], within=5e-4,
          law=brings_the_plate(1e-4, 3e-3), polish=True),
    *rows("parcel", {"gradient": 14}, "gradient", law=brings_the_plate(0.01, np.inf), seeds=2),
    *rows("parcel", {"ipopt": 15, "cma": 350}, "ipopt cma", law=brings_the_plate(0.01, np.inf), seeds=2),
    *rows("pendulum", "ilqr", below=44.827183 * (1 + 1e-3), law=swings_up_pendulum, seeds=5),
    *rows("planar_hopper", "ilqr", "ilqr", of=3, law=flies_a_parabola),
    *rows("push_and_fly", "multiple_shooting ilqr ipopt", "ilqr ipopt",
          law=pushes_less_and_less),
    *rows("push_box", "ilqr", "ilqr", finer=1),
    *rows("putt", {"least_squares": 9}, answer=PUTT, within=4e-3, polish=True),
    *rows("putt", {"gradient": 16, "ipopt": 16, "cma": 250}, answer=PUTT, within=[0.012, 0.04], seeds=2),
    *rows("quadrotor_slalom", "ilqr multiple_shooting", "multiple_shooting", law=flies_by_newton_and_euler, finer=1),
    *rows("quadruped_shift", "gradient", "gradient", of=3, law=shifts_its_torso),
    *rows("quadruped_shift", "gradient", "gradient", of=3, wanted=2, law=shifts_its_torso),
    *rows("row_of_balls", {"gradient": 45, "least_squares": 25, "ipopt": 35, "cma": 1000}, solved=None,
          law=has_geometric_masses, seeds=2),
    *rows("sled", "gradient least_squares ipopt", solved=None, law=friction_holds_it, smoothing=(0.0,), seeds=2),
    *rows("sled", {"gradient": 160, "least_squares": 60, "ipopt": 250, "cma": np.inf}, "ipopt", law=goes_in_stages,
          seeds=2),
    *rows("sled", "gradient least_squares", solved=False, smoothing=(0.1,)),
    *rows("somersault", "race", law=folds_to_turn),
    *rows("spinner", "ilqr", "ilqr", below=2.0, law=turns_the_spinner),
    *rows("squat_jump", "race", "race", law=leaves_the_ground),
    *rows("stairs", {"least_squares": 7}, answer=flights.STAIRS, within=1e-9, polish=True,
          backend="casadi"),
    *rows("stairs", {"gradient": 12, "ipopt": 12, "cma": 250}, answer=flights.STAIRS, within=2e-3, seeds=2,
          backend="casadi"),
    *rows("table_tennis", "least_squares", law=lands_and_kicks_on, seeds=3),
    *rows("three_hops", "ipopt", "ipopt", finer=1, law=hops_three_times, seeds=3),
    *rows("tip_over", "race", "race", law=tips_over_its_edge),
    *rows("transport", "ilqr", "ilqr", finer=1, law=slides_within_friction, seeds=3),
    *rows("two_balls", "gradient ipopt", solved=None,
          law=comes_down_to_the_goal(1.3965, 1.3975, 60)),
    *rows("two_balls", "least_squares", "least_squares", solved=None, law=comes_down_to_the_goal(1.3965, 1.3970, 30)),
    *rows("two_balls", "cma", "cma", solved=None, law=comes_down_to_the_goal(1.3965, 1.400, 700)),
]  # fmt: skip


@pytest.mark.parametrize(("must", "seed"), [case for row in TABLE for case in row.cases()])
def test_shipped_problem(must: Must, seed: int) -> None:
    found = must.found(seed)
    for each in found:
        assert work(each.outcome) <= must.most
        if must.solved is not None:
            assert each.verdict.solved == must.solved
        if must.answer is not None:
            assert (np.abs(each.z - must.answer) <= must.within).all(), each.z
        assert must.below == np.inf or each.verdict.objective < must.below
        must.law(each)
    if must.finer:
        assert sum(each.halved.judge(each.z).worst < 1 for each in found) >= must.finer


ELSEWHERE = {
    *("ball_throw", "bounce_recorded"),
    *("ant_walk", "half_cheetah_run", "hopper_run", "walker2d_walk"),
    *("gait_robot_build", "gait_robot_fast", "gait_robot_trot", "quadruped_walk", "quadruped_walk_net"),
    *("mini_cheetah_mpc", "planar_hopper_mpc"),
}
"""What has tests of its own: in ``tests/solvers``, of recordings, imported models and walks, and in ``tests/mpc``."""


def test_every_shipped_problem_has_a_row() -> None:
    assert {row.problem for row in TABLE} == set(problems.catalogue()) - ELSEWHERE


@pytest.mark.thorough
def test_solvers_agree_on_the_bank_shot() -> None:
    """They know nothing of each other."""
    made = shipped("bank_shot")
    found = [solve(name, made, polish=True).z for name in ("least_squares", "ipopt", "gradient")]
    assert found[0] == pytest.approx(STROKE, rel=1e-3)
    assert found[1:] == [pytest.approx(found[0], rel=1e-4)] * 2
