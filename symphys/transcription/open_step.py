"""One step for batches of states and actions: values, and adjoints of the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from symphys.codegen import KernelUnavailable, ProgramError, processors
from symphys.codegen.backends import BEST, PRECISIONS
from symphys.codegen.backends.calls import row_by_row
from symphys.codegen.backends.precision import warn
from symphys.errors import Issue, ProblemError, SymphysError
from symphys.model.controllers import Net
from symphys.model.joints import AffineMotor, Joint, Servo, TorqueMotor
from symphys.model.state_layout import GIVEN, Layout, input_columns, input_sizes, inputs_size
from symphys.model.world import World
from symphys.problem import ALIVE, Cost, FeedbackController, Problem, Target, Variable
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.transcription.decision_variables import start_of
from symphys.transcription.formula_names import input_names
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.transcription.sampler import Sampler
from symphys.transcription.stage import BatchStep, Stage, Value, sense_function
from symphys.transcription.terms import Term, problem_terms
from symphys.types import Array, Expr


@dataclass(frozen=True)
class Action:
    """One number of an action: the input that it is added to, times ``scale``, and its bounds."""

    input: str
    component: int
    scale: float
    lower: float
    upper: float


@dataclass(frozen=True)
class ExternalControlProblem:
    """A problem whose commands are external actions.

    Attributes:
        problem: without the controllers and variables whose place the actions take.
        acting: the actions.
        sensors: names of the sensors that are observed; empty: the states of all bodies are.
    """

    problem: Problem
    acting: tuple[Action, ...]
    sensors: tuple[str, ...]

    def names(self) -> tuple[str, ...]:
        """Return the input and component that each action adds to: ``knee.command``, ``ball.force[2]``."""
        sizes = input_sizes(self.problem.world())
        return tuple(a.input if sizes[a.input] == 1 else f"{a.input}[{a.component}]" for a in self.acting)

    def bounds(self, end: Literal["lower", "upper"]) -> Array:
        """Return bounds (m,) of the actions; may be infinite."""
        return np.array([getattr(action, end) for action in self.acting], float)

    def inputs(self, problem: Problem) -> tuple[str, ...]:
        """Return the inputs that u stacks: those of the problem, and those that actions add to."""
        return tuple(dict.fromkeys([*input_names(problem), *(action.input for action in self.acting)]))

    def place(self, world: World, inputs: Sequence[str]) -> Array:
        """Return (nu, m) the share of each action in u, which stacks ``inputs``."""
        columns = input_columns(world, inputs)
        place = np.zeros((inputs_size(world, inputs), len(self.acting)))
        for k, action in enumerate(self.acting):
            place[columns[action.input].start + action.component, k] = action.scale
        return place


def opened(
    problem: Problem, controllers: Sequence[str] | None = None, sensors: Sequence[str] | None = None
) -> ExternalControlProblem:
    """Replace controllers of a problem by external actions.

    Args:
        problem: any.
        controllers: names of those whose outputs become actions. None: those whose numbers a variable sets, or else
            all; without any, the inputs that variables set over time; without these, the commands of all motors.
        sensors: names of those that are observed. None: those that the controllers sense, or else all.

    Raises:
        SymphysError: there is no such controller or sensor, or nothing that could act.
        ProblemError: a formula looks at the numbers of a controller that is taken off.
    """
    taken = chosen(problem, controllers)
    names = {name for controller in taken for name in controller.weights}
    dropped = [variable for variable in problem.variables if any(slot.name in names for slot in variable.slots)]
    actions = [action for controller in taken for action in outputs(controller)]
    if not taken:
        dropped = [variable for variable in problem.variables if variable.kind == "control"]
        actions = [action for variable in dropped for action in knots(variable)] or commands(problem)
    if not actions:
        text = "nothing can act: it has no controller, no motor, and no variable that sets an input over time"
        raise SymphysError(f"{problem.name}: {text}")
    if problem.free_duration:
        text = "a variable sets the duration, and a single step has a length of its own; leave that variable out"
        raise SymphysError(f"{problem.name}: {text}")
    refuse_motion_parts(problem)
    refuse_formulas(problem, {**dict.fromkeys(names, "nothing else"), **{v.name: slots(v) for v in dropped}})
    rest = replace(
        problem,
        variables=tuple(variable for variable in problem.variables if variable not in dropped),
        controllers=tuple(controller for controller in problem.controllers if controller not in taken),
    )
    return ExternalControlProblem(rest, tuple(actions), observed(problem, taken, sensors))


def chosen(problem: Problem, names: Sequence[str] | None) -> tuple[FeedbackController, ...]:
    """Return the controllers that are removed."""
    known = {controller.name: controller for controller in problem.controllers}
    if names is None:
        varied = {slot.name for variable in problem.variables for slot in variable.slots}
        learning = tuple(each for each in known.values() if not varied.isdisjoint(each.weights))
        return learning or tuple(known.values())
    return tuple(known[known_name(name, known, "controller")] for name in names)


def observed(problem: Problem, taken: Sequence[FeedbackController], names: Sequence[str] | None) -> tuple[str, ...]:
    """Return the observed sensors."""
    known = [sensor.name for sensor in problem.sensors]
    if names is not None:
        return tuple(known_name(name, known, "sensor") for name in names)
    return tuple(dict.fromkeys(name for controller in taken for name in controller.senses)) or tuple(known)


def known_name(name: str, known: Sequence[str] | dict[str, FeedbackController], kind: str) -> str:
    """Return the name; SymphysError if it is unknown."""
    if name not in known:
        there = hint(name, known) if known else "there is none"
        raise SymphysError(f"no {kind} is called {quote(name)}; {there}")
    return name


def outputs(controller: FeedbackController) -> list[Action]:
    """Return the unscaled outputs of a controller as actions."""
    law = controller.law
    most = 1.0 if isinstance(law, Net) and law.output == "tanh" and not law.skip else np.inf
    return [
        Action(name, component, float(scale), -most, most)
        for (name, component), scale in zip(controller.drives, controller.scale, strict=True)
    ]


def knots(variable: Variable) -> list[Action]:
    """Return the inputs that a variable sets over time as actions, with the widest bounds of its knots."""
    count = variable.components
    lower, upper = variable.lower.reshape(-1, count).min(axis=0), variable.upper.reshape(-1, count).max(axis=0)
    return [
        Action(slot.name, component, 1.0, float(lower[k]), float(upper[k]))
        for slot in variable.slots
        for k, component in enumerate(slot.components)
    ]


def commands(problem: Problem) -> list[Action]:
    """Return the commands of all motors as actions."""
    found = []
    for joint in problem.world().joints:
        if joint.motor is not None:
            for k in range(len(joint.kind.coordinates)):
                found.append(Action(f"{joint.name}.command", k, 1.0, *reach(joint, k)))
    motors = ((site.name, site.motor) for site in problem.world().sites if site.motor is not None)
    found += [Action(f"{name}.command", 0, 1.0, *(motor.command_range or (-np.inf, np.inf))) for name, motor in motors]
    return found


def reach(joint: Joint, k: int) -> tuple[float, float]:
    """Return the bounds of a command: the joint limits for a servo, else the largest torque or velocity."""
    motor = joint.motor
    if isinstance(motor, Servo):
        widest = np.pi if joint.kind.coordinates[k].turns else np.inf
        widest = widest if motor.range is None else float(motor.range)
        lower, upper = joint.limits.lower, joint.limits.upper
        return -widest if lower is None else float(lower), widest if upper is None else float(upper)
    assert motor is not None, "a joint without a motor has no commands"
    if isinstance(motor, AffineMotor):
        return motor.command_range or (-np.inf, np.inf)
    most = float(motor.torque if isinstance(motor, TorqueMotor) else motor.velocity)
    return -most, most


def slots(variable: Variable) -> str:
    """Return the quantities that a variable sets, as formulas name them."""
    return " or ".join(slot.name for slot in variable.slots)


def refuse_motion_parts(problem: Problem) -> None:
    """Raise ProblemError if a cost or target depends on the whole motion."""
    issues = [
        Issue(f'{kind} "{each.name}"', f"{each.formula.parts[0].name} is of a whole motion, and this is a single step")
        for kind, every in (("cost", problem.costs), ("target", problem.targets))
        for each in every
        if each.formula.parts
    ]
    if issues:
        raise ProblemError(problem.file, issues)


def refuse_formulas(problem: Problem, taken: Mapping[str, str]) -> None:
    """Raise ProblemError if a cost or target reads a removed name; the values say what to read instead."""
    issues = [
        Issue(f'{kind} "{each.name}"', f"looks at {name}, whose place the actions take; it may look at {instead}")
        for kind, every in (("cost", problem.costs), ("target", problem.targets))
        for each in every
        for name, instead in taken.items()
        if name in each.formula.needed
    ]
    if issues:
        raise ProblemError(problem.file, issues)


def reads_variables(problem: Problem) -> bool:
    """Whether the formula of a cost or target reads a variable."""
    names = {variable.name for variable in problem.variables}
    return any(not names.isdisjoint(each.formula.names) for each in asked(problem))


def asked(problem: Problem) -> list[Cost | Target]:
    """Return the costs and targets, whose sum is the objective."""
    return [*problem.costs, *problem.targets]


def cost_terms(rollout: Rollout) -> dict[range, list[Term]]:
    """Return the costs and targets by the steps to which they add: all of them, those of a phase, or one."""
    found = dict[range, list[Term]]()
    for term in problem_terms(rollout):
        if term.kind != "limit":
            found.setdefault(term.points.steps, []).append(term)
    return found


def step_costs(rollout: Rollout, value: Value) -> Expr:
    """Return (r,) what each entry of ``cost_terms`` adds in a step; over all its steps they add up to the objective."""
    sums = []
    for terms in cost_terms(rollout).values():
        total: Expr = ca.DM(0)
        for term in terms:
            weight = term.weight * rollout.dt / len(term.points.sides) if term.running else term.weight
            for side in term.points.sides:
                found = value(term.formula, side)
                total += weight * (ca.sumsqr(found) if term.kind == "squares" else found)
        sums.append(total)
    return ca.vertcat(ca.DM(0, 1), *sums)


def open_stage(rollout: Rollout, sensors: Sequence[str]) -> Stage:
    """Return a stage with ``costs``; see ``step_costs``."""

    def ask(value: Value) -> dict[str, Expr]:
        return {"costs": step_costs(rollout, value)}

    return Stage(rollout, observe_function(rollout, sensors), ask, reads_variables(rollout.problem))


def observe_function(rollout: Rollout, sensors: Sequence[str]) -> ca.Function:
    """Return (x, p, time) -> the readings of these sensors; without any, the states of all bodies."""
    if sensors:
        return sense_function(rollout, sensors)
    x, p, time = ca.SX.sym("x", rollout.x0.shape[0]), ca.SX.sym("p", rollout.p.shape[0]), ca.SX.sym("time")
    columns = [x[part] for _, part in body_columns(rollout)]
    return ca.Function("sense", [x, p, time], [ca.densify(ca.vertcat(ca.SX(0, 1), *columns))])


def body_columns(rollout: Rollout) -> list[tuple[str, slice]]:
    """Return name and columns of the state of each body."""
    layout = Layout(rollout.world)
    return [(f"{body.name}.{key}", layout[f"{body.name}.{key}"]) for body in rollout.world.bodies for key in GIVEN]


class StepStart(NamedTuple):
    """The start of motions: ``state`` (B, s), ``observation`` (B, o), and the ``inputs`` (B, N, i) of all steps.

    Arrays of numpy, or of the library that they were asked of.
    """

    state: Array
    observation: Array
    inputs: Array


class StepResult(NamedTuple):
    """The results of a step: ``state`` (B, s) and ``observation`` (B, o) after it, and its ``cost`` (B,)."""

    state: Array
    observation: Array
    cost: Array


@dataclass(frozen=True, eq=False)
class CompiledStep:
    """One time step of a problem whose commands are actions, for batches of states.

    A state is a row of numbers, with the parameters that vary and the time in it. It begins with the positions and
    velocities of the bodies; ``columns`` says where each lies. Costs of all steps of a horizon add up to the
    objective of the problem; its constraints are no part of them.

    Attributes:
        problem: the opened problem, without the controllers whose place the actions take.
        actions: the input of each action, such as ``knee.command``.
        lower, upper: (m,) bounds of the actions, which are not enforced; may be infinite.
        smoothing: of the contacts [m/s].
        backend: description of the evaluator.
    """

    problem: Problem
    actions: tuple[str, ...]
    lower: Array
    upper: Array
    smoothing: float
    backend: str
    _opening: ExternalControlProblem
    _place: Array
    _rollout: Rollout
    _sampler: Sampler | None
    _evaluated: BatchStep

    @property
    def state_size(self) -> int:
        """The number of entries of a state."""
        return sum(self._sizes)

    @property
    def action_size(self) -> int:
        """The number of entries of an action."""
        return len(self.actions)

    @property
    def input_size(self) -> int:
        """The number of forces, torques and commands that act on the world in a step."""
        return len(self._place)

    @cached_property
    def observation_size(self) -> int:
        """The number of entries of an observation."""
        return int(self._start.size1_out(3))

    @cached_property
    def observations(self) -> tuple[str, ...]:
        """Return the name of each number of an observation: ``feeling[0]`` of a sensor, or ``ball.position[2]``."""
        sizes = {sensor.name: sensor.size for sensor in self.problem.sensors}
        parts = [(name, sizes[name]) for name in self._opening.sensors]
        parts = parts or [(name, part.stop - part.start) for name, part in body_columns(self._rollout)]
        return tuple(f"{name}[{k}]" for name, count in parts for k in range(count))

    @cached_property
    def columns(self) -> dict[str, slice]:
        """Map quantities to columns of a state: ``ball.position`` (3) [m], ``ball.velocity``, ..., world frame."""
        return dict(body_columns(self._rollout))

    @property
    def steps(self) -> int:
        """The number of steps N in the duration of the problem."""
        return self._rollout.steps

    def start(self, count: int = 1, seed: int | None = None) -> StepStart:
        """Return initial states.

        Args:
            count: B.
            seed: None: all begin as the guess does. A number: samples of the problem's [[scenario]] tables, the first
                of them the problem's own; without such tables all are alike.
        """
        guess = np.concatenate([np.zeros(0), *(variable.guess for variable in self._opening.problem.variables)])
        if self._sampler is None or seed is None:
            hidden = np.zeros(0) if self._sampler is None else self._sampler.nominal
            rows = [np.concatenate([guess, hidden])]
        else:
            drawn = self._sampler.draw(np.random.default_rng(seed), count, 1.0)
            rows = [np.concatenate([guess, row]) for row in drawn]
        start = self.start_at(rows)
        return start if len(rows) == count else StepStart(*(np.repeat(part, count, axis=0) for part in start))

    def start_at(self, rows: Sequence[Array]) -> StepStart:
        """Return the initial states for values of all variables, one row each."""
        x, inputs, p, sensed = row_by_row(self._start, np.array(rows))
        z = [np.array(rows)] if self._sizes[-1] else []
        state = np.concatenate([x, p, np.zeros((len(x), 1)), *z], axis=1)
        return StepStart(state, sensed, inputs.reshape(len(x), self.steps, -1))

    def __call__(self, state: ArrayLike, action: ArrayLike, inputs: ArrayLike | None = None) -> StepResult:
        """Take a step.

        Args:
            state: (B, s).
            action: (B, m).
            inputs: (B, i) what acts besides, ``start.inputs[:, k]``; None: what the guess has at that time.

        Returns:
            State and observation after it, and its cost. Numbers that are not finite are returned as they are.
        """
        states = matrix("state", state, self.state_size)
        rows = self._rows(states, matrix("action", action, self.action_size), inputs)
        found = self._evaluated.forward(rows, (self.smoothing,))
        after = states.copy()
        after[:, : self._sizes[0]] = found["after"]
        after[:, self._clock] += self._rollout.dt
        cost = np.sum(np.where(self._now(states), found["costs"], 0.0), axis=1) if self._spans else np.zeros(len(rows))
        return StepResult(after, np.array(found.get("sensed", np.zeros((len(rows), 0)))), cost)

    def pull(
        self,
        state: ArrayLike,
        action: ArrayLike,
        after: ArrayLike,
        observation: ArrayLike,
        cost: ArrayLike,
        inputs: ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:
        """Return adjoints of state (B, s), action (B, m) and inputs (B, i), from those of the results of a step.

        Args:
            state: (B, s), and the others as the step was called.
            action: (B, m).
            after: (B, s) adjoint of the state after the step.
            observation: (B, o).
            cost: (B,).
            inputs: (B, i).

        Warns:
            RuntimeWarning: the first adjoints in single precision are far off those in double precision.
        """
        states = matrix("state", state, self.state_size)
        rows = self._rows(states, matrix("action", action, self.action_size), inputs)
        later, costs = matrix("after", after, self.state_size), np.asarray(cost, float)
        nx, nu, np_, n = self._sizes[0], self._place.shape[0], self._sizes[1], self._sizes[-1]
        seeds = {
            "after": later[:, :nx],
            "sensed": matrix("observation", observation, self.observation_size),
            "costs": np.where(self._now(states), costs[:, None], 0.0),
        }
        whole = np.concatenate([seeds[name] for name in self._evaluated.sizes], axis=1)
        _, slopes = self._evaluated.gradient(rows, np.ascontiguousarray(whole), (self.smoothing,))
        warn(self.problem.name, self._evaluated.doubt)
        x, u, p, now, then, z = np.split(slopes, np.cumsum([nx, nu, np_, 1, 1]), axis=1)
        back = np.concatenate([x, p, now + then, z[:, :n]], axis=1)
        back[:, nx:] += later[:, nx:]
        return back, u @ self._place, u

    def rest(self, state: ArrayLike) -> Array:
        """Return (B,) the cost of all remaining steps of motions that are over."""
        states = np.array(matrix("state", state, self.state_size))
        still, ticks, total = np.zeros((len(states), self.action_size)), self._ticks(states), np.zeros(len(states))
        ends = sorted({0, self.steps, *(end for span in self._spans for end in (span.start, span.stop))})
        for first, last in pairwise(ends):
            states[:, self._clock] = first * self._rollout.dt
            total += np.clip(last - np.maximum(first, ticks), 0, None) * self(states, still).cost
        return total

    def alive(self, state: ArrayLike) -> NDArray[np.bool_]:
        """Return (B,) whether motions are not over by the problem's [termination]."""
        states = matrix("state", state, self.state_size)
        memory = self._rollout.memory
        if not memory.terminates:
            return np.ones(len(states), np.bool_)
        return np.asarray(states[:, memory.columns[ALIVE].start] > 0)

    def tick(self, state: ArrayLike) -> NDArray[np.int64]:
        """Return (B,) the number of steps before a state."""
        return self._ticks(matrix("state", state, self.state_size))

    def _ticks(self, states: Array) -> NDArray[np.int64]:
        return np.rint(states[:, self._clock] / self._rollout.dt).astype(np.int64)

    def _now(self, states: Array) -> NDArray[np.bool_]:
        """Return (B, r) which costs the step from here adds; after the last step those of all steps go on."""
        ticks, whole = self._ticks(states), range(self.steps)
        return np.array([(each == whole) | ((ticks >= each.start) & (ticks < each.stop)) for each in self._spans]).T

    @cached_property
    def _spans(self) -> tuple[range, ...]:
        """The steps to which costs add."""
        return tuple(cost_terms(self._rollout))

    def _rows(self, states: Array, actions: Array, inputs: ArrayLike | None) -> Array:
        """Return the rows (B, m) of the kernel."""
        nx, np_, count = self._sizes[0], self._sizes[1], len(states)
        if len(actions) != count:
            raise ValueError(f"{count} states and {len(actions)} actions: give one for each")
        if inputs is None:
            ticks = np.clip(self._ticks(states), 0, self.steps - 1)
            given = self._nominal[ticks]
        else:
            given = matrix("inputs", inputs, self._place.shape[0])
        u = given + actions @ self._place.T
        now = states[:, self._clock, None]
        parts = [states[:, :nx], u, states[:, nx : nx + np_], now, now + self._rollout.dt, states[:, self._clock + 1 :]]
        return np.concatenate(parts, axis=1)

    @cached_property
    def _sizes(self) -> tuple[int, int, int, int]:
        """Return the columns of x, p, time and z in a state."""
        rollout = self._rollout
        n = int(rollout.z.shape[0]) if reads_variables(self.problem) else 0
        return int(rollout.x0.shape[0]), int(rollout.p.shape[0]), 1, n

    @property
    def _clock(self) -> int:
        """The column of the time."""
        return self._sizes[0] + self._sizes[1]

    @cached_property
    def _nominal(self) -> Array:
        """Return the inputs (N, i) that no knot sets, as the guess has them."""
        return np.asarray(self.start().inputs[0])

    @cached_property
    def _start(self) -> ca.Function:
        """(z) -> x0, the inputs of all steps in order, p, the observation."""
        rollout = self._rollout
        start = start_of(rollout.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.z)
        x0 = rollout.memory.start(start.x0)
        sensed = observe_function(rollout, self._opening.sensors)(x0, start.p, 0.0)
        results = [x0, ca.vec(start.u), start.p, sensed]
        return ca.Function("start", [rollout.z], [ca.densify(result) for result in results]).expand()


def compile_open_step(
    problem: Problem,
    controllers: Sequence[str] | None = None,
    sensors: Sequence[str] | None = None,
    smoothing: float = 0.0,
    backend: str = BEST,
    threads: int | None = None,
) -> CompiledStep:
    """Compile the step of a problem whose commands are actions; see ``symphys.compile_step``."""
    opening = opened(problem, controllers, sensors)
    sampler = None if opening.problem.scenarios is None else Sampler(opening.problem)
    whole = opening.problem if sampler is None else sampler.problem
    rollout = symbolic_rollout(whole, opening.inputs(whole))
    count = processors() if threads is None else threads
    evaluated, words = evaluated_by(rollout, opening, smoothing == 0, backend, count)
    rest = replace(opening.problem, scenarios=None)
    return CompiledStep(
        problem=rest,
        actions=opening.names(),
        lower=opening.bounds("lower"),
        upper=opening.bounds("upper"),
        smoothing=smoothing,
        backend=words,
        _opening=opening,
        _place=opening.place(rollout.world, rollout.inputs),
        _rollout=rollout,
        _sampler=sampler,
        _evaluated=evaluated,
    )


def evaluated_by(
    rollout: Rollout, opening: ExternalControlProblem, exact: bool, backend: str, threads: int
) -> tuple[BatchStep, str]:
    """Choose a kernel, or casadi's virtual machine without a compiler, and describe the choice."""
    note, stage = "", open_stage(rollout, opening.sensors)
    if backend in PRECISIONS:
        try:
            step = stage.compiled(exact, backend, threads)
            report = step.kernel.report
            return step, f"{report.precision} precision, lanes {report.lanes}, threads {step.kernel.threads}"
        except (KernelUnavailable, ProgramError) as error:
            note = f"; {error}"
    return stage.interpreted(), f"casadi's virtual machine{note}"


def matrix(name: str, value: ArrayLike, columns: int) -> Array:
    """Return (B, columns); ValueError names the shape that fits."""
    array = np.asarray(value, float)
    if array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"{name} must be (batch, {columns}), not {array.shape}")
    return array
