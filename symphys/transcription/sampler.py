"""Samplers of scenarios: the numbers that differ between samples, or between problems of a sweep, one row each."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from symphys.dynamics.observation import gap_function
from symphys.model.joints.start import placed_frames, spanning_tree, subtree
from symphys.model.state_layout import GIVEN, initial_state
from symphys.problem import Problem, RandomizedPose, RandomizedQuantity, Variable, VariableSlot
from symphys.problem.parametric.joints import ParametricJoint
from symphys.transcription.formula_names import swept_parameters
from symphys.types import Array

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


State = dict[str, Array]
"""Quantities by name, (count, k) each."""


class PoseSampler:
    """Random poses of one table: a rotation of the whole robot, joint by joint, then a lift out of overlaps."""

    def __init__(self, problem: Problem, posed: RandomizedPose) -> None:
        """Find the bodies that each joint carries, and the static surfaces below the robot."""
        self.posed, self.problem, self.world = posed, problem, problem.world()
        self.names = [f"{body}.{field}" for body in posed.bodies for field in GIVEN]
        initial = problem.initial
        self.variables = tuple(
            hidden(
                f"{posed.name}:{name}", "initial", VariableSlot(name, tuple(range(initial[name].size))), initial[name]
            )
            for name in self.names
        )
        tree = spanning_tree(problem.parametric.joints)
        self.hinges = [SampledHinge(joint, subtree(joint.first, joint, tree), initial) for joint in posed.joints]
        robot = {i for i, body in enumerate(self.world.bodies) if body.name in posed.bodies}
        below = [k for k, p in enumerate(self.world.pairs) if p.second.body is None and p.first.body in robot]
        symbols = {name: ca.SX.sym(name, value.size) for name, value in initial.items()}
        gaps = gap_function(self.world)(initial_state(self.world, symbols))
        self.gaps = ca.Function("gaps", [ca.vertcat(*symbols.values())], [ca.vertcat(0, *(gaps[k] for k in below))])

    def draw(self, rng: np.random.Generator, count: int, width: float) -> Array:
        """Draw (count, numbers of the variables)."""
        posed = self.posed
        state = {name: np.tile(value, (count, 1)) for name, value in self.problem.initial.items()}
        turn_all(posed.bodies, width * posed.tilt * rng.uniform(-1, 1, (count, 3)), state)
        for hinge in self.hinges:
            hinge.bend(width * posed.bend * rng.uniform(-1, 1, count), state)
        drift = width * posed.velocity * rng.uniform(-1, 1, (count, 3))
        lift = self.overlap(state)[:, None] * self.up
        for body in posed.bodies:
            state[f"{body}.velocity"] = state[f"{body}.velocity"] + drift
            state[f"{body}.position"] = state[f"{body}.position"] + lift
        return np.concatenate([state[name] for name in self.names], axis=1)

    @property
    def up(self) -> Array:
        """Return the direction (3,) against gravity; zero without gravity."""
        gravity = np.array(self.world.gravity, float)
        return -gravity / max(float(np.linalg.norm(gravity)), 1e-12)

    def overlap(self, state: State) -> Array:
        """Return (count,) [m] the overlap of the robot with static surfaces."""
        gaps = np.array(self.gaps(np.concatenate(list(state.values()), axis=1).T))
        return np.asarray(-gaps.min(axis=0))


class SampledHinge:
    """A joint with all bodies that its first side carries."""

    def __init__(self, joint: ParametricJoint, moved: list[str], initial: State) -> None:
        """Compute axis and pivot in the frame of the second side."""
        assert joint.second is not None, "a robot hangs on nothing"
        self.base, self.moved = joint.second, moved
        placed, pivot = placed_frames(joint, initial)
        still = rotations(initial[f"{self.base}.orientation"]).inv()
        (coordinate,) = joint.kind.coordinates
        self.axis = still.apply(np.asarray(coordinate.direction(placed), float).ravel())
        self.pivot = still.apply(pivot - initial[f"{self.base}.position"])

    def bend(self, angles: Array, state: State) -> None:
        """Rotate the joint by angles (count,) [rad], in place."""
        lies = rotations(state[f"{self.base}.orientation"])
        pivot = state[f"{self.base}.position"] + lies.apply(self.pivot)
        turn(self.moved, pivot, angles[:, None] * lies.apply(self.axis), state)


def turn_all(bodies: tuple[str, ...], vectors: Array, state: State) -> None:
    """Rotate a robot about the centre of its first body by rotation vectors (count, 3), in place."""
    turn(list(bodies), state[f"{bodies[0]}.position"].copy(), vectors, state)


def turn(bodies: list[str], pivot: Array, vectors: Array, state: State) -> None:
    """Rotate bodies about points (count, 3), in place."""
    from scipy.spatial.transform import Rotation  # late: most problems need none of scipy

    by = Rotation.from_rotvec(vectors)
    for body in bodies:
        state[f"{body}.position"] = pivot + by.apply(state[f"{body}.position"] - pivot)
        state[f"{body}.orientation"] = np.roll((by * rotations(state[f"{body}.orientation"])).as_quat(), 1, axis=1)


def rotations(q: Array) -> Rotation:
    """Make rotations from quaternions w x y z."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(q, -1, axis=-1))


MIN_FACTOR = 0.05
"""Least value of a random factor, however wide the draws are."""


class QuantitySampler:
    """Random quantities of one table."""

    def __init__(self, problem: Problem, varied: RandomizedQuantity) -> None:
        """Look up the nominal values."""
        self.varied, self.steps = varied, problem.simulation.steps
        self.lasts = max(1, round(varied.lasts / problem.simulation.dt)) if varied.lasts else self.steps
        values = {**problem.initial, **problem.parametric.starts(), **problem.parameters, **problem.weights}
        size = len(varied.slots[0].components)
        blank = np.zeros(1 + max(max(slot.components) for slot in varied.slots))
        found = [values.get(slot.name, blank)[list(slot.components)] for slot in varied.slots]
        self.base = np.stack(found)
        knots = self.steps if varied.kind == "control" else 1
        self.variables = tuple(
            hidden(f"{varied.name}:{slot.name}", varied.kind, slot, np.tile(each, knots), knots)
            for slot, each in zip(varied.slots, self.base, strict=True)
        )
        self.shape = (len(varied.slots), size)

    def draw(self, rng: np.random.Generator, count: int, width: float) -> Array:
        """Draw (count, numbers of the variables)."""
        varied, (slots, size) = self.varied, self.shape
        drawn = width * rng.uniform(-1, 1, (count, 1, 1) if varied.alike else (count, slots, size))
        factor = np.maximum(1 + varied.factor * drawn, MIN_FACTOR)
        values = np.clip(self.base * factor + varied.shift * drawn, varied.lower, varied.upper)
        values = np.broadcast_to(values, (count, slots, size))
        if varied.kind != "control":
            return values.reshape(count, -1)
        return (values[:, :, None] * self.acting(rng, count)[:, None, :, None]).reshape(count, -1)

    def acting(self, rng: np.random.Generator, count: int) -> Array:
        """Draw (count, steps): 1 in the steps in which an input acts."""
        first = np.floor(rng.uniform(0, 1, count) * (self.steps - self.lasts + 1))
        step = np.arange(self.steps)
        return ((step >= first[:, None]) & (step < first[:, None] + self.lasts)).astype(float)


def hidden(name: str, kind: str, slot: VariableSlot, guess: Array, knots: int = 1) -> Variable:
    """Return a variable that no solver sees."""
    none, one = np.full(guess.size, np.inf), np.ones(guess.size)
    return Variable(name, kind, (slot,), knots, "constant", guess, -none, none, one, 0 * one)  # type: ignore[arg-type]


def swept_inputs(problem: Problem) -> tuple[Variable, ...]:
    """Return a variable for each parameter that differs in a sweep and that no variable sets."""
    own = {slot.name for variable in problem.variables for slot in variable.slots}
    values = {name: problem.parameters[name] for name in swept_parameters(problem) if name not in own}
    return tuple(
        hidden(f"{name} of the sweep", "parameter", VariableSlot(name, tuple(range(value.size))), value)
        for name, value in values.items()
    )


class Sampler:
    """Samples of a problem's scenarios on one time grid.

    Attributes:
        problem: with a variable for all that differs, behind its own.
        nominal: (s,) the numbers of the file.
    """

    def __init__(self, problem: Problem) -> None:
        """Collect the varied quantities and poses."""
        scenarios = problem.scenarios
        assert scenarios is not None, "nothing differs"
        self._parts: list[QuantitySampler | PoseSampler] = [
            QuantitySampler(problem, varied) for varied in scenarios.quantities
        ]
        self._parts += [PoseSampler(problem, posed) for posed in scenarios.poses]
        own = (*swept_inputs(problem), *(variable for part in self._parts for variable in part.variables))
        self.problem = replace(problem, variables=(*problem.variables, *own), scenarios=None)
        self.nominal = np.concatenate([np.zeros(0), *(variable.guess for variable in own)])

    def draw(self, rng: np.random.Generator, count: int, width: float) -> Array:
        """Draw (count, s): the first is nominal, the others ``width`` times as wide as in the file."""
        drawn = np.concatenate([np.zeros((count, 0)), *(part.draw(rng, count, width) for part in self._parts)], axis=1)
        swept = self.nominal[: self.nominal.size - drawn.shape[1]]
        rows = np.concatenate([np.tile(swept, (count, 1)), drawn], axis=1)
        rows[:1] = self.nominal
        return rows
