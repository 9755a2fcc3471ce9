"""The paper's quadruped with its net of 1,296 weights on the ground: sensors, gradient, joints, feet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_worlds import starts, table_problem

from symphys.codegen import Kernel, compile_program
from symphys.model.state_layout import Layout
from symphys.problem import Problem
from symphys.transcription import Rollout, symbolic_rollout
from symphys.transcription.network_rollout.context import RolloutObjectives, start_function
from symphys.transcription.program import rollout_program
from symphys.transcription.simulation import Record, recorder, simulate
from symphys.types import Array

pytestmark = pytest.mark.slow

STEPS = 50
GROWTH_STEPS, DIRECTIONS = 300, 16
"""Steps and random gradients of the growth of adjoints."""


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Half a second of it."""
    return table_problem([], STEPS)


@pytest.fixture(scope="module")
def rollout(problem: Problem) -> Rollout:
    """Of the problem."""
    return symbolic_rollout(problem)


@pytest.fixture(scope="module")
def record(problem: Problem, rollout: Rollout) -> Record:
    """From a point off every symmetry, in casadi's words."""
    return simulate(rollout, recorder(rollout), point(problem), 0.0)


@pytest.fixture(scope="module")
def kernel(rollout: Rollout) -> Kernel:
    """Compiled."""
    return compile_program(rollout_program(rollout, exact=True), seeded=["merit"], threads=1)


def point(problem: Problem) -> Array:
    """(n,) off every symmetry: weights, and a push."""
    rng = np.random.default_rng(2)
    weights = problem.variables[0].guess
    return np.concatenate([weights + 0.05 * rng.standard_normal(weights.size), [0.03, -0.02, 0.01]])


@pytest.mark.slow
def test_sensors(problem: Problem, rollout: Rollout, record: Record) -> None:
    """There are 81, and none is constant while the robot moves."""
    assert sum(sensor.size for sensor in problem.sensors) == 81
    course = record.arrays
    for sensor in problem.sensors:
        read = rollout.control.sensor(sensor)
        columns = np.array([np.array(read(x, course.p, 0.01 * k)).ravel() for k, x in enumerate(course.x)])
        assert (np.ptp(columns, axis=0) > 1e-4).all(), sensor.name


@pytest.mark.thorough
def test_gradient_by_differences(problem: Problem, kernel: Kernel) -> None:
    """Of the distance with respect to weights and start, along random directions and single weights: 1e-5.

    Steps of the differences go down to 1e-8: fifty steps on four feet have kinks within 1e-6.
    """
    z = point(problem)
    gradient = kernel.gradient(z, [1.0], [0.0])[1][0]
    rng = np.random.default_rng(3)
    single = np.eye(z.size)[rng.choice(z.size, 16, replace=False)]
    directions = np.vstack([rng.standard_normal((16, z.size)) / np.sqrt(z.size), single])
    slopes = directions @ gradient
    found = []
    for h in (1e-5, 1e-6, 1e-7, 1e-8):
        ahead, behind = (kernel.forward(z + sign * h * directions, [0.0])["objective"][:, 0] for sign in (1, -1))
        found.append(np.abs((ahead - behind) / (2 * h) - slopes))
    assert np.min(found, axis=0).max() < 1e-5 * np.abs(slopes[:16]).max()


def test_joints_and_feet(record: Record) -> None:
    """At 20 sweeps joints part by less than a millimetre (rms), and feet sink in by less than one."""
    motion = record.motion
    assert np.sqrt(np.mean(motion.joint_separation**2)) < 1e-3
    assert motion.contact_gap.min() > -1e-3
    assert (motion.contact_force[:, :, 2] > 0).any(axis=0).all(), "every foot bears load at some time"


@pytest.mark.thorough
def test_robots_of_a_batch_are_those_alone(problem: Problem, kernel: Kernel) -> None:
    """Bit by bit, in any lane, with or without the gradient."""
    weights = problem.variables[0].guess
    Z = np.hstack([np.tile(weights, (11, 1)), starts(11)])
    together, slopes = kernel.gradient(Z, [1.0], [0.0])
    for k in (0, 3, 10):
        assert np.array_equal(kernel.forward(Z[k], [0.0])["objective"][0], together["objective"][k])
        assert np.array_equal(kernel.gradient(Z[k], [1.0], [0.0])[1][0], slopes[k])


def rollout_of(toi: bool, cuts: int, stride: float) -> tuple[Rollout, Kernel]:
    """Return the robot, its net without effect, and the kernel of one step."""
    problem = table_problem([], GROWTH_STEPS, stride=stride, toi=toi)
    simulation = replace(problem.simulation, cuts=cuts)
    rollout = symbolic_rollout(replace(problem, simulation=simulation))
    program = RolloutObjectives(rollout).stage(rollout, []).program(exact=False)
    return rollout, compile_program(program, seeded=["after"], threads=1)


def grown(rollout: Rollout, kernel: Kernel) -> Array:
    """Return the factors (steps,) by which the longest adjoint grows in each step, the last step first."""
    rows, layout = visited(rollout, kernel), Layout(rollout.world)
    adjoints = np.zeros((DIRECTIONS, int(rollout.x0.shape[0])))
    ends = np.r_[layout["torso.position"], layout["torso.velocity"]]
    adjoints[:, ends] = np.random.default_rng(0).normal(size=(DIRECTIONS, len(ends)))
    adjoints /= np.linalg.norm(adjoints, 2)
    found = np.empty(len(rows))
    for k, row in enumerate(reversed(rows)):
        before = kernel.gradient(np.tile(row, (DIRECTIONS, 1)), adjoints, [0.0])[1][:, : adjoints.shape[1]]
        found[k] = np.linalg.norm(before, 2)
        adjoints = before / found[k]
    return found


def visited(rollout: Rollout, kernel: Kernel) -> list[Array]:
    """Return the inputs of the kernel at each step, with weights zero and the torso pushed a little."""
    z = np.concatenate([0 * rollout.problem.variables[0].guess, [0.02, -0.01, 0.03]])
    x, _, p, _ = (part.full().ravel() for part in start_function(rollout, [])(z))
    rows, still = list[Array](), np.zeros(int(rollout.given.shape[0]))
    for k in range(GROWTH_STEPS):
        times = np.array([k, k + 1]) * rollout.dt
        rows.append(np.concatenate([x, still, p, times, z]))
        x = kernel.forward(rows[-1], [0.0])["after"][0]
    return rows


@pytest.mark.thorough
def test_it_stands_and_so_does_its_gradient() -> None:
    """Put down and pushed, at 20 sweeps, with exact instants of touch: it comes to rest, its adjoint does not grow."""
    standing, kernel = rollout_of(toi=True, cuts=0, stride=0.0)
    layout, last = Layout(standing.world), visited(standing, kernel)[-1]
    for name in (name for name in layout.names() if name.endswith("velocity")):
        assert np.abs(last[layout[name]]).max() < 1e-12, name
    assert np.log10(grown(standing, kernel)).sum() < 1


@pytest.mark.thorough
@pytest.mark.parametrize(("toi", "cuts", "decades"), [(False, 0, 7.5), (True, 1, 6.5), (True, 0, 10)])
def test_trotting_lets_the_adjoint_grow_slowly(toi: bool, cuts: int, decades: float) -> None:
    """Over 3 s; by 13 and 7 decades with instants of touch where pushes leave bodies behind that nothing touches."""
    assert np.log10(grown(*rollout_of(toi, cuts, stride=0.1))).sum() < decades
