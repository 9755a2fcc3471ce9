"""Starts of joints that vary: as a file has it that states them, with exact slopes, for every kind of solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few
from worlds import joint_texts
from worlds.joint_texts import SLIDER, UNIVERSAL, joint

from symphys.dynamics.observation.joint_coordinates import readings
from symphys.errors import ProblemError
from symphys.model.state_layout import initial_state
from symphys.problem import Problem, begin
from symphys.solvers import solver
from symphys.transcription import transcribe
from symphys.transcription.sampler import QuantitySampler

Load = Callable[..., Problem]
Refused = Callable[..., ProblemError]
Names = Callable[[ProblemError, str, str], None]

TIME = "[simulation]\nduration = 0.2\ndt = 0.01\n"


def body(name: str, z: float, more: str = "") -> str:
    return joint_texts.body(name, z, more, inertia="[0.1, 0.2, 0.3]")


def variable(name: str, sets: str, guess: str) -> str:
    return f'[[variable]]\nname = "{name}"\nsets = "{sets}"\nguess = {guess}\n'


MOVES = "velocity = [1, 0.5, -2]\nangular_velocity = [0.3, 1, -0.5]"
BODIES = body("torso", 1.5, MOVES) + body("thigh", 0.75, MOVES) + body("shin", 0.25) + body("arm", 1.9)


def robot(hip: str = "", knee: str = "", ankle: str = "", held: bool = False) -> str:
    """A torso with a leg and an arm; ``ankle`` is a universal joint above it all, first of what moves both ways."""
    rail = joint("rail", "world torso", 1.5, "start = 0.2", SLIDER) if held else ""
    arm = joint("arm_root", "arm torso", 1.7, ankle, UNIVERSAL)
    return TIME + BODIES + rail + joint("hip", "torso thigh", 1, hip) + arm + joint("knee", "thigh shin", 0.5, knee)


COST = '[[cost]]\nname = "far"\nat = "always"\nvalue = "shin.position[0] + 0.1 * thigh.velocity[2] + 0.01 * hip.rate"\n'
VARIED = (
    variable("bend", "hip.start", "0.4")
    + variable("lean", "arm_root.start", "[0.5, -0.7]")
    + variable("swing", "hip.start_rate", "1.5")
    + variable("twist", "arm_root.start_rate[1]", "-2.0")
)


@pytest.mark.parametrize("held", [False, True])
def test_as_a_file_that_states_them(load: Load, held: bool) -> None:
    """Of a moving robot with joints in both directions, free or on a rail, where the file has starts of its own."""
    stated = load(text=robot("start = 0.4", "start_deg = -60", "start = [0.5, -0.7]", held))
    nominal = load(text=robot("start = -0.3", "start_deg = -60", "start = [0.1, 0.2]", held))
    starts = {"hip.start": ca.DM(0.4), "arm_root.start": ca.DM([0.5, -0.7])}
    found = begin(nominal.parametric, starts, {name: ca.DM(value) for name, value in nominal.initial.items()})
    for name, value in stated.initial.items():
        assert np.array(found[name]).ravel() == pytest.approx(value, abs=1e-13)


@few("held", [False, True], 1)
def test_joints_read_what_was_set(load: Load, held: bool) -> None:
    """Coordinates are those that were set; rates come on top of what bodies' velocities give; nothing comes apart."""
    made = transcribe(load(text=robot("", "start = 0.9", "start = [0.1, 0.2]", held) + VARIED), backend="casadi")
    z = made.shooting.start(0)
    slow, fast = made.simulate(z * [1, 1, 1, 0, 0]), made.simulate(z)
    assert fast["hip.angle"][0] == pytest.approx(0.4, abs=1e-12)
    assert fast["knee.angle"][0] == pytest.approx(0.9, abs=1e-12)
    assert fast["arm_root.angle"][0] == pytest.approx([0.5, -0.7], abs=1e-12)
    assert fast["hip.rate"][0] - slow["hip.rate"][0] == pytest.approx(1.5, abs=1e-12)
    assert fast["knee.rate"][0] == pytest.approx(slow["knee.rate"][0], abs=1e-12)
    assert fast["arm_root.rate"][0] - slow["arm_root.rate"][0] == pytest.approx([0, -2], abs=1e-12)
    start = {name: fast[name][0] for name in made.problem.initial}
    world = made.problem.world()
    for reading in readings(world, initial_state(world, start)).values():
        assert float(ca.DM(reading.separation)) == pytest.approx(0, abs=1e-12)


def test_slopes_are_exact(load: Load) -> None:
    """Against differences in complete motions, of a cost along them."""
    made = transcribe(load(text=robot("", "start = 0.9", "start = [0.1, 0.2]") + VARIED + COST), backend="casadi")
    z, h = made.shooting.start(0), 1e-5
    exact = made.shooting.evaluator.gradient(z[None], 0.0).gradient[0]
    steps = h * np.eye(z.size)
    values = made.shooting.evaluator.value(np.concatenate([z + steps, z - steps]), 0.0).objective
    assert exact == pytest.approx((values[: z.size] - values[z.size :]) / (2 * h), rel=1e-7, abs=1e-9)
    assert np.all(np.abs(exact[:3]) > 1e-6)


POLE = (
    TIME.replace("0.2", "0.5")
    + '[[body]]\nname = "pole"\nshape = { sphere = { radius = 0.05 } }\nmass = 1\nposition = [0, 0, -1]\n'
    + joint("pivot", "world pole", 0, "start = 0.2")
    + variable("angle", "pivot.start", "0.2")
    + variable("rate", "pivot.start_rate", "0.0")
    + '[[target]]\nname = "turned"\nvalue = "end.pivot.angle + start.pivot.angle"\ntolerance = 1e-5\n'
    + '[[target]]\nname = "fast"\nvalue = "end.pivot.rate - 1"\ntolerance = 1e-5\n'
)
"""A pendulum that should pass from one side to the other, where it has 1 rad/s."""


@few("method", ["least_squares", "ilqr", "multiple_shooting"], 1)
def test_solvers_choose_them(load: Load, method: str) -> None:
    """A motion from -a to a in half a second with 1 rad/s there: by symmetry it begins with 1 rad/s too."""
    made, chosen = transcribe(load(text=POLE), backend="casadi"), solver(method)
    found = chosen.solve(made.shooting, made.shooting.start(0), chosen.Options(), 0)
    assert made.judge(found.z).solved
    angle, rate = found.z
    assert rate == pytest.approx(1, abs=1e-4)
    motion = made.simulate(found.z)
    assert motion["pivot.angle"][0] == pytest.approx(angle, abs=1e-9)
    assert motion["pivot.angle"][-1] == pytest.approx(-angle, abs=1e-5)


def test_a_sweep_sets_them(load: Load) -> None:
    """A start in the file, and the guess of a variable: both are settings."""
    problem = load(text=POLE)
    moved = problem.set({"joint.0.start": 0.5, "variable.0.guess": 0.7})
    made = transcribe(moved, backend="casadi")
    assert made.simulate(made.shooting.start(0))["pivot.angle"][0] == pytest.approx(0.7, abs=1e-12)
    bare = POLE.replace('sets = "pivot.start"\nguess = 0.2', 'sets = "pivot.start"')
    made = transcribe(load(text=bare), backend="casadi")
    assert made.shooting.start(0)[0] == 0.2


LOOP = joint("loop", "torso shin", 0.25)


@pytest.mark.parametrize(
    ("text", "sets", "reason"),
    [
        (robot() + LOOP, "hip.start", "hip.start cannot vary: the joint is part of a loop, so that what it carries"),
        (robot("frequency = 5"), "hip.start_rate", "hip.start_rate cannot vary: the joint gives way"),
        (robot(), "hip.begin", "there is no quantity"),
        (robot(), "hip.start[1]", "reaches beyond hip.start, which has 1 components"),
    ],
)
def test_what_cannot_vary(refused: Refused, names: Names, text: str, sets: str, reason: str) -> None:
    names(refused(text=text + variable("bend", sets, "0.0")), 'variable "bend".sets', reason)


def test_bounds_are_the_limits_of_the_joint(load: Load, refused: Refused, names: Names) -> None:
    """Where the file states none; beyond them no motion begins."""
    text = robot("limits = [-0.5, 1]") + variable("bend", "hip.start", "0.4")
    (bend,) = load(text=text).variables
    assert (bend.lower[0], bend.upper[0]) == (-0.5, 1)
    names(refused(text=text + "upper = 2"), 'variable "bend".upper', "hip.start must be at most 1")
    names(refused(text=text.replace("0.4", "1.4")), 'variable "bend".guess', "is outside the bounds -0.5 to 1")


def test_samples_begin_elsewhere(load: Load) -> None:
    """A scenario draws the start of a joint, and all that hangs on it is carried along."""
    drawn = '[[scenario]]\nname = "bent"\nsets = ["hip.start"]\nshift = 0.2\n'
    bend = variable("bend", "knee.start", "0.3")
    problem = load(text=robot("start = 0.1") + bend + COST + drawn)
    assert problem.scenarios is not None
    sampler = QuantitySampler(problem, problem.scenarios.quantities[0])
    draws = sampler.draw(np.random.default_rng(0), 3, 1.0)[:, 0]
    assert np.all(np.abs(draws - 0.1) < 0.2) and len(set(draws)) == 3
    made = transcribe(replace(problem, variables=(*problem.variables, *sampler.variables)), backend="casadi")
    motion = made.simulate(np.array([0.5, draws[0]]))
    assert motion["hip.angle"][0] == pytest.approx(draws[0], abs=1e-12)
    assert motion["knee.angle"][0] == pytest.approx(0.5, abs=1e-12)
