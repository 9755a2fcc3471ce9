"""A problem with its controllers removed: the actions in their place, with bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from symphys.errors import Issue, ProblemError, SymphysError
from symphys.model.controllers import Net
from symphys.model.joints import AffineMotor, Joint, Servo, TorqueMotor
from symphys.model.state_layout import input_columns, input_sizes, inputs_size
from symphys.model.world import World
from symphys.problem import FeedbackController, Problem, Variable
from symphys.suggest import hint, quote
from symphys.transcription.formula_names import input_names
from symphys.types import Array


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
        acting: what acts.
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
    issues += [
        Issue(f'cost "{cost.name}".during', f"{quote(cost.during.name)} is a phase of a whole motion; this is one step")
        for cost in problem.costs
        if cost.during is not None
    ]
    issues += [
        Issue(f'phase "{phase.name}".sets', "holds in a phase of a whole motion; this is one step")
        for phase in problem.phases
        if phase.sets
    ]
    issues += [
        Issue(f'force "{law.name}".during', "is a phase of a whole motion; this is one step")
        for law in problem.forces
        if law.during is not None
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
