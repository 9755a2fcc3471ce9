"""Partition of a problem with large nets: the part that steps compute, and the nets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.errors import Issue, ProblemError
from symphys.model.controllers import Net
from symphys.problem import Constraint, Cost, FeedbackController, Output, Problem, Target
from symphys.records import dataclass
from symphys.transcription.formula_names import input_names, spans
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.transcription.sampler import swept_inputs
from symphys.types import Array

Indices = NDArray[np.intp]
MAX_STEP_WEIGHTS = 4096
"""Largest number of weights of a net within the compiled step, where every lane has its own."""
MAX_COMPILED_WEIGHTS = 100_000
"""The same bound where there is nothing but the step: exported code, Jacobians of steps with fixed weights, and
formulas that read the weights; compiling takes half a minute."""


def has_large_nets(problem: Problem) -> bool:
    """Whether some controller is a large net."""
    return bool(large_nets(problem))


def large_nets(problem: Problem) -> tuple[FeedbackController, ...]:
    """Return the controllers that matrix products compute: nets of many weights, which no formula reads."""
    large = [net for net in problem.controllers if _size(net) > MAX_STEP_WEIGHTS]
    read = {name for _, each in _formulas(problem) for name in each.formula.needed} if large else set()
    return tuple(net for net in large if _size(net) > MAX_COMPILED_WEIGHTS or read.isdisjoint(_names(problem, net)))


def _size(controller: FeedbackController) -> int:
    return controller.law.sizes["weights"] if isinstance(controller.law, Net) else 0


def _names(problem: Problem, controller: FeedbackController) -> set[str]:
    """Return the names by which formulas read the weights of a controller."""
    own = set(controller.weights)
    return own | {v.name for v in problem.variables if any(slot.name in own for slot in v.slots)}


def fits_step(problem: Problem) -> bool:
    """Whether the step can be compiled and differentiated with all nets in it."""
    varied = {slot.name for variable in problem.variables for slot in variable.slots}
    return all(_size(net) <= MAX_COMPILED_WEIGHTS and varied.isdisjoint(net.weights) for net in large_nets(problem))


def require_small_nets(problem: Problem, what: str) -> None:
    """Raise ProblemError for nets that are too large for a compiled step; ``what`` compiles it."""
    issues = [
        Issue(f'controller "{net.name}".net', f"has {count} weights; {what} takes up to {MAX_COMPILED_WEIGHTS}")
        for net in large_nets(problem)
        if (count := net.law.sizes["weights"]) > MAX_COMPILED_WEIGHTS
    ]
    if issues:
        raise ProblemError(problem.file, issues)


@dataclass(frozen=True)
class Weights:
    """The sources of the weights of one net.

    Attributes:
        nominal: (w,) as the file has them.
        of_z, of_net: (k,) which entries of z are which weights; an entry of z may be several weights.
    """

    nominal: Array
    of_z: Indices
    of_net: Indices

    def at(self, z: Array) -> Array:
        """Return the weights (w,) at a decision vector."""
        weights = self.nominal.copy()
        weights[self.of_net] = z[self.of_z]
        return weights

    def add(self, gradient: Array, of_weights: Array) -> None:
        """Add the gradient of the weights to that of z."""
        np.add.at(gradient, self.of_z, of_weights[self.of_net])


@dataclass(frozen=True)
class Partition:
    """A partitioned problem.

    Attributes:
        rollout: of the problem without its large nets, whose inputs they add to.
        small: (s,) the entries of z, with what stands behind it, that it depends on.
        n: the length of z with what stands behind it.
        behind: numbers behind z, in which the problems of a sweep differ.
        nets, laws: the controllers that are large nets, and the nets.
        places: for each (nu, m) which input an output is added to, scaled.
        weights: for each.
    """

    rollout: Rollout
    small: Indices
    n: int
    nets: tuple[FeedbackController, ...]
    laws: tuple[Net, ...]
    places: tuple[Array, ...]
    weights: tuple[Weights, ...]
    behind: Array

    def whole(self, Z: Array) -> Array:
        """Return points (B, n) with the given numbers after z."""
        return np.concatenate([Z, np.broadcast_to(self.behind, (len(Z), self.behind.size))], axis=1)

    def joined(self, small: Array, weights: Sequence[Array]) -> Array:
        """Return the gradient (n,) from those of the small numbers and of the weights of each net."""
        gradient = np.zeros(self.n)
        gradient[self.small] = small
        for own, slope in zip(self.weights, weights, strict=True):
            own.add(gradient, slope)
        return gradient


def partition(problem: Problem) -> Partition:
    """Partition a problem; ProblemError if its formulas read the weights of large nets."""
    nets, swept = large_nets(problem), swept_inputs(problem)
    problem = replace(problem, variables=(*problem.variables, *swept))
    names = {name for controller in nets for name in controller.weights}
    parts = list(zip(problem.variables, spans(problem.variables), strict=True))
    kept = [(v, span) for v, span in parts if not any(slot.name in names for slot in v.slots)]
    refuse_formulas(problem, nets)
    others = tuple(controller for controller in problem.controllers if controller not in nets)
    rest = replace(problem, variables=tuple(v for v, _ in kept), controllers=others)
    rollout = symbolic_rollout(rest, input_names(problem))
    return Partition(
        rollout=rollout,
        small=np.concatenate([np.zeros(0, int), *(np.arange(*span) for _, span in kept)]),
        n=sum(v.guess.size for v in problem.variables),
        nets=nets,
        laws=tuple(controller.law for controller in nets if isinstance(controller.law, Net)),
        places=tuple(np.array(ca.DM(rollout.control.place(controller)).full()) for controller in nets),
        weights=tuple(_weights(problem, controller) for controller in nets),
        behind=np.concatenate([np.zeros(0), *(variable.guess for variable in swept)]),
    )


def _weights(problem: Problem, controller: FeedbackController) -> Weights:
    name, of_z, of_net = f"{controller.name}.weights", [np.zeros(0, int)], [np.zeros(0, int)]
    for variable, (first, last) in zip(problem.variables, spans(problem.variables), strict=True):
        for slot in variable.slots:
            if slot.name == name:
                of_z.append(np.arange(first, last))
                of_net.append(np.array(slot.components, int))
    return Weights(controller.numbers["weights"], np.concatenate(of_z), np.concatenate(of_net))


def refuse_formulas(problem: Problem, nets: Sequence[FeedbackController]) -> None:
    """Raise ProblemError if a formula reads the weights of large nets."""
    most = f"the weights of a net; formulas take up to {MAX_COMPILED_WEIGHTS}"
    issues = [
        Issue(f'{kind} "{each.name}"', f"looks at {name}, {most}, and there are {_size(net)}")
        for net in nets
        for name in sorted(_names(problem, net))
        for kind, each in _formulas(problem)
        if name in each.formula.needed
    ]
    if issues:
        raise ProblemError(problem.file, issues)


def _formulas(problem: Problem) -> Iterator[tuple[str, Cost | Target | Constraint | Output]]:
    yield from (("cost", cost) for cost in problem.costs)
    yield from (("target", target) for target in problem.targets)
    yield from (("constraint", constraint) for constraint in problem.constraints)
    yield from (("output", output) for output in problem.outputs)
