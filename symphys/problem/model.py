"""A problem after validation: plain numbers and formulas, nothing of files or tables."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import field, fields
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from symphys.expression import Formula
from symphys.model.controllers import ControlLaw
from symphys.model.world import Scheme, World
from symphys.problem.guess import GuessedMotion
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.recordings.files import without_places
from symphys.problem.recordings.types import IdentifySettings, RecordedFile, Recording
from symphys.problem.references import ReferenceTrajectory
from symphys.records import dataclass
from symphys.types import Array

if TYPE_CHECKING:
    from symphys.problem.sweeps.sweep import Sweep


@dataclass(frozen=True)
class Sensor:
    """Quantities that controllers may use.

    Attributes:
        name: as in the file.
        formulas: of its parts, one after the other.
        size: how many numbers they come to.
    """

    name: str
    formulas: tuple[Formula, ...]
    size: int


@dataclass(frozen=True)
class FeedbackController:
    """A law that drives inputs in every step.

    Attributes:
        name: as in the file.
        law: how outputs follow from what is sensed.
        senses: names of the sensors, whose values are joined.
        drives: for each output the name of an input and the component that it is added to.
        scale: (m,) factors of the outputs.
        numbers: the law's numbers as the file has them, by the names of ``law.sizes``.
    """

    name: str
    law: ControlLaw
    senses: tuple[str, ...]
    drives: tuple[tuple[str, int], ...]
    scale: Array = field(repr=False)
    numbers: dict[str, Array] = field(repr=False)

    @property
    def weights(self) -> dict[str, Array]:
        """The numbers by the names that variables use: ``brain.weights``."""
        return {f"{self.name}.{key}": value for key, value in self.numbers.items()}


@dataclass(frozen=True)
class ForceLaw:
    """A formula of the state that adds to an input in every step.

    Attributes:
        name: as in the file.
        on: the input: ``ball.force`` [N], ``ball.torque`` [N m], both world frame, or ``knee.command``.
        components: of the input.
        formula: of as many numbers.
        against: an input and components to which the opposite is added; None: nothing.
        numbers: of the formula, as the file has them.
        during: where the phase in which alone it acts begins and ends, as shares of the duration; None: it acts always.
    """

    name: str
    on: str
    components: tuple[int, ...]
    formula: Formula
    numbers: dict[str, Array] = field(repr=False)
    against: tuple[str, tuple[int, ...]] | None = None
    during: tuple[float, float] | None = None

    @property
    def acts_on(self) -> tuple[tuple[str, tuple[int, ...], int], ...]:
        """Inputs, their components, and the sign with which the formula is added."""
        opposite = () if self.against is None else ((*self.against, -1),)
        return ((self.on, self.components, 1), *opposite)

    @property
    def weights(self) -> dict[str, Array]:
        """The numbers by the names that variables and formulas use: ``drag.c``."""
        return {f"{self.name}.{key}": value for key, value in self.numbers.items()}


@dataclass(frozen=True)
class PlantSettings:
    """Differences of the plant from the model.

    Attributes:
        dt: [s] its longest time step.
        masses: factor of all masses and inertias.
        set: values by the keys of ``Problem.set``.
        noise, rate_noise: standard deviations of measured coordinates [m, rad] and rates [m/s, rad/s].
        seed: of the noise.
        delay: [s] from a command to its effect.
        latency: [s] from a measurement to the commands of its plan; ``measured``: the time that the solver took;
            ``cpu``: the processor time that it took.
    """

    dt: float
    masses: float
    set: Mapping[str, object]
    noise: float
    rate_noise: float
    seed: int
    delay: float
    latency: float | str


@dataclass(frozen=True)
class RecedingHorizon:
    """Model predictive control.

    Attributes:
        rate: ticks in a second [Hz].
        horizon, dt: [s] how far a plan looks ahead, and its time step.
        iterations, first_iterations: of iLQR at each tick, and before the first.
        damping: first and least regularisation.
        smoothing: of the model's contacts [m/s].
        feedback: whether commands between ticks answer what is measured.
        duration: [s] of the closed loop.
        plant: what it is tried on.
    """

    rate: float
    horizon: float
    dt: float
    iterations: int
    first_iterations: int
    damping: float
    smoothing: float
    feedback: bool
    duration: float
    plant: PlantSettings

    @property
    def steps(self) -> int:
        """The number of the model's time steps in a plan."""
        return round(self.horizon / self.dt)

    @property
    def tick(self) -> float:
        """[s] between two ticks."""
        return 1 / self.rate


NOTHING: Mapping[str, Any] = MappingProxyType({})

Kind = Literal["initial", "parameter", "control", "weight", "duration", "recording"]
ALIVE = "alive"
"""In formulas: 1 until the motion is over, 0 from then on."""
DURATION = "simulation.duration"
STEP_LENGTH = "simulation.dt"
"""What a variable sets that chooses how long a motion takes: its steps become longer or shorter, not more or fewer."""


@dataclass(frozen=True, kw_only=True)
class Simulation(Scheme):
    """The switches of the time step, its length and the duration.

    Attributes:
        dt: time step [s].
        duration: [s], a whole number of steps.
        smoothing: [m/s] stages of the smoothing that solvers use, decreasing, at least one; 0 is the exact contact law.
    """

    dt: float = 0.01
    duration: float
    smoothing: tuple[float, ...]

    @property
    def steps(self) -> int:
        """The number of time steps."""
        return round(self.duration / self.dt)

    def scheme(self) -> Scheme:
        """The switches of the time step alone."""
        return Scheme(**{each.name: getattr(self, each.name) for each in fields(Scheme)})


@dataclass(frozen=True)
class Phase:
    """A stretch of the motion.

    Attributes:
        name: as in the file.
        start, end: shares of the duration.
        sets: physical parameters by name, with the numbers that hold in it alone.
    """

    name: str
    start: float
    end: float
    sets: Mapping[str, tuple[float, ...]] = field(default_factory=dict, hash=False)

    @property
    def weights(self) -> dict[str, Array]:
        """Return what the phase sets by the names that variables and formulas use: ``ice.ground.friction``."""
        return {f"{self.name}.{key}": np.array(numbers) for key, numbers in self.sets.items()}

    def ticks(self, steps: int) -> tuple[int, int]:
        """The numbers of its first and last state, of ``steps`` time steps."""
        return round(self.start * steps), round(self.end * steps)


@dataclass(frozen=True)
class VariableSlot:
    """The components of a quantity that a variable sets.

    Attributes:
        name: ``ball.velocity``, ``ball.mass``, ``gravity``, ``ground.friction``, ``ball.force``, ``brain.weights``, ...
        components: the indices that are set; (0,) for a number.
    """

    name: str
    components: tuple[int, ...]


@dataclass(frozen=True)
class Variable:
    """Numbers that a solver may choose; every slot gets the same values.

    Attributes:
        name: as in the file.
        kind: what is set: the state at the start, a physical parameter, a force or torque over time, the numbers of a
            controller or force law, the duration, or the clock or scale of recordings.
        slots: all with the same number of components.
        knots: values over the duration; 1 unless a control. ``constant``: knot k holds over the k-th of ``knots``
            equal parts of the duration. ``linear``: knots at equal distances from start to end.
        interpolation: between knots.
        guess, lower, upper, scale, spread: (components * knots,), knot after knot; bounds may be infinite.
        each: whether every recording has a value of its own.
        prior: mean and standard deviation, (components,) each, that identification assumes; None: nothing.
    """

    name: str
    kind: Kind
    slots: tuple[VariableSlot, ...]
    knots: int
    interpolation: Literal["constant", "linear"]
    guess: Array
    lower: Array
    upper: Array
    scale: Array
    spread: Array
    each: bool = False
    prior: tuple[Array, Array] | None = None

    @property
    def components(self) -> int:
        """Numbers in one knot."""
        return len(self.slots[0].components)


@dataclass(frozen=True)
class Cost:
    """A term of the objective.

    Attributes:
        name: as in the file.
        formula: of a number, or with ``squares`` of a vector whose squares are summed.
        at: ``end``, ``always`` (integral over time) or a time [s].
        weight: factor.
        squares: whether the cost is weight * sum of squares.
        during: where ``at`` is ``always``: the phase that is meant; None: the whole motion.
    """

    name: str
    formula: Formula
    at: str | float
    weight: float
    squares: bool
    during: Phase | None = None


@dataclass(frozen=True)
class Target:
    """A vector that should be zero; its term of the objective is weight * |value|^2.

    Attributes:
        name: as in the file.
        formula: of the vector.
        at: ``end`` or a time [s].
        tolerance: met where the Euclidean norm is at most this.
        weight: factor.
        unit: of the value; empty where it has none or where it is not known.
    """

    name: str
    formula: Formula
    at: str | float
    tolerance: float
    weight: float
    unit: str = ""


@dataclass(frozen=True)
class Constraint:
    """Bounds on a vector, component by component.

    Attributes:
        name: as in the file.
        formula: of the vector.
        at: ``end``, ``always`` (every time step) or a time [s].
        lower, upper: (components,) or (1,), may be infinite.
        tolerance: largest violation of a component that counts as met.
        penalty: weight of squared violations for solvers that know no constraints.
        unit: of the value; empty where it has none or where it is not known.
        during: where ``at`` is ``always``: the phase that is meant; None: the whole motion.
    """

    name: str
    formula: Formula
    at: str | float
    lower: Array
    upper: Array
    tolerance: float
    penalty: float
    unit: str = ""
    during: Phase | None = None


@dataclass(frozen=True)
class Output:
    """A number that is reported.

    Attributes:
        name: as in the file.
        formula: of the number.
        at: ``end`` or a time [s].
        unit: of it; may be empty.
    """

    name: str
    formula: Formula
    at: str | float
    unit: str

    @property
    def label(self) -> str:
        """Name and unit: ``speed [m/s]``."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True)
class Termination:
    """A condition that ends a motion before its time: from then on nothing moves.

    Attributes:
        margin: of a number of the state; over where it is below 0.
    """

    margin: Formula


@dataclass(frozen=True)
class RandomizedQuantity:
    """Numbers that are sampled: (components,) each slot.

    Attributes:
        name: as in the file.
        kind: of what is sampled.
        slots: what is sampled.
        factor: half the width of the factors; 0: none.
        shift: (components,) half the width of what is added.
        alike: whether all numbers share one random number.
        lasts: [s] of inputs, how long they act; 0: always.
        lower, upper: (components,) each slot, what is physical.
    """

    name: str
    kind: Kind
    slots: tuple[VariableSlot, ...]
    factor: float
    shift: Array
    alike: bool
    lasts: float
    lower: Array
    upper: Array


@dataclass(frozen=True)
class RandomizedPose:
    """A robot whose pose is sampled, then lifted until it overlaps nothing that stands still.

    Attributes:
        name: as in the file.
        bodies: all that joints connect.
        joints: its rigid hinges that close no loop.
        tilt, bend: half the widths of turns about each axis of the world, and of the joints [rad].
        velocity: half the width of each component [m/s].
    """

    name: str
    bodies: tuple[str, ...]
    joints: tuple[ParametricJoint, ...]
    tilt: float
    bend: float
    velocity: float


@dataclass(frozen=True)
class Discretisation:
    """Another discretisation."""

    name: str
    simulation: Simulation


@dataclass(frozen=True)
class Scenarios:
    """Domain randomization: all that differs from sample to sample."""

    quantities: tuple[RandomizedQuantity, ...] = ()
    poses: tuple[RandomizedPose, ...] = ()
    discretisations: tuple[Discretisation, ...] = ()

    def __iter__(self) -> Iterator[RandomizedQuantity | RandomizedPose | Discretisation]:
        """Iterate over quantities, poses, then discretisations."""
        return chain(self.quantities, self.poses, self.discretisations)

    def __bool__(self) -> bool:
        """Whether there is anything."""
        return any(True for _ in self)


@dataclass(frozen=True, eq=False)
class ProblemData:
    """The validated content of a problem file; equal to itself only.

    Attributes:
        name: the file's stem.
        title, description: for people.
        file: the path as given.
        text: the source, with the texts of included files, so that it can be loaded again without them.
        simulation: how time passes.
        parametric: the world whose parameters may be replaced, from which ``world`` builds.
        initial: for every body ``<body>.position`` (3,) [m], ``.orientation`` (4,) unit quaternion w x y z,
            ``.velocity`` (3,) [m/s], ``.angular_velocity`` (3,) [rad/s]; world frame.
        parameters: every physical parameter by name with its value in the file, (k,).
        variables, costs, targets, constraints: in the file's order.
        goal: the objective should come down to this; None for no goal.
        stop_when_met: stop at the first point that meets everything, instead of at an optimum.
        solvers: the names of those that the problem is for, as the file has them; None for all.
        solver_tables: the raw [solver.NAME] tables by NAME.
        sensors, controllers: in the file's order.
        forces, references, phases: laws of the state, trajectories that formulas name, and the stretches of the motion,
            in the file's order.
        termination: where a motion is over before its time; None: nowhere.
        scenarios: what differs from sample to sample; None: nothing.
        outputs: numbers that are reported, in the file's order.
        mpc: what [mpc] says; None without one.
        recordings: measured motions, in the file's order; recorded_files: that they were read from.
        identify: what [identify] says.
        guess: where the motion is guessed to pass; None: where the guess of the variables leads.
        sweep: what [sweep] says; None without one. ``text`` is without it.
    """

    name: str
    title: str
    description: str
    file: str
    text: str = field(repr=False)
    simulation: Simulation
    parametric: ParametricWorld = field(repr=False)
    initial: dict[str, Array]
    parameters: dict[str, Array]
    variables: tuple[Variable, ...]
    costs: tuple[Cost, ...]
    targets: tuple[Target, ...]
    constraints: tuple[Constraint, ...]
    goal: float | None
    stop_when_met: bool
    solver_tables: dict[str, dict[str, object]]
    sensors: tuple[Sensor, ...] = ()
    controllers: tuple[FeedbackController, ...] = ()
    forces: tuple[ForceLaw, ...] = ()
    references: tuple[ReferenceTrajectory, ...] = ()
    phases: tuple[Phase, ...] = ()
    solvers: tuple[str, ...] | None = None
    termination: Termination | None = None
    scenarios: Scenarios | None = None
    outputs: tuple[Output, ...] = ()
    mpc: RecedingHorizon | None = None
    recordings: tuple[Recording, ...] = field(default=(), repr=False)
    recorded_files: tuple[RecordedFile, ...] = ()
    identify: IdentifySettings = field(default_factory=IdentifySettings)
    guess: GuessedMotion | None = None
    sweep: Sweep | None = None

    @property
    def free_duration(self) -> bool:
        """Whether a variable sets the duration."""
        return any(variable.kind == "duration" for variable in self.variables)

    @property
    def weights(self) -> dict[str, Array]:
        """The numbers of controllers, force laws, phases and references in the file, by names as ``brain.weights``."""
        own = [each.weights for each in self.controllers]
        own += [*(law.weights for law in self.forces), *(phase.weights for phase in self.phases)]
        own += [each.weights for each in self.references]
        return {name: value for weights in own for name, value in weights.items()}

    @property
    def identity(self) -> str:
        """Return the text, and a digest of the numbers that controllers begin with: equal problems share both."""
        digest = hashlib.sha256(b"".join(value.tobytes() for value in self.weights.values()))
        text = without_places(self.text)
        return f"{text}\n{digest.hexdigest()}" if self.controllers else text

    def world(self, overrides: Mapping[str, Any] = NOTHING) -> World:
        """The world with its numbers, some replaced.

        Args:
            overrides: parameter names to floats or casadi symbols; three of them in a sequence for gravity.
                KeyError for a name that is no parameter.
        """
        return self.parametric.world(overrides)
