"""What a problem of many bodies is computed with: the kernel of its steps, and what is asked of states."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen import processors
from symphys.codegen.neighbours.kernel import CrowdKernel, compile_crowd
from symphys.dynamics.neighbours.sample import sample_of
from symphys.errors import Issue, ProblemError, SymphysError
from symphys.model.state_layout import BODY_FIELDS, Layout
from symphys.problem import Problem
from symphys.problem.parametric.meetings import law_of_all
from symphys.transcription.gradient_probe import combined
from symphys.transcription.neighbours.program import crowd_of
from symphys.transcription.objective import Terms, terms
from symphys.transcription.rollout import Rollout, rollout_of

Array = NDArray[np.float64]
Expr = Any
"""casadi MX"""
BODY = sum(size for _, size in BODY_FIELDS)


@dataclass(frozen=True)
class CrowdRollout(Rollout):
    """A rollout whose states are symbols: they come from a kernel.

    Attributes:
        states: (nx, N + 1).
    """

    states: Expr = None

    @property
    def x(self) -> Expr:
        """(nx, N + 1) states."""
        return self.states


class CrowdContext:
    """A problem of many bodies, ready to be rolled out.

    Attributes:
        rollout: with symbols for the states.
        kernel: of the steps, one rollout in each thread.
        columns: (nx,) which column of a state of the rollout is which of the kernel's.
    """

    def __init__(self, problem: Problem, threads: int | None) -> None:
        """Build and compile; ProblemError where the problem asks for what such steps do not have."""
        require_starts_alone(problem)
        base = rollout_of(problem)
        size, law = Layout(base.world).size, law_of_all(problem.parametric)
        assert law is not None, "the world finds its pairs"
        states = ca.MX.sym("x", size, base.steps + 1)
        self.rollout = CrowdRollout(**{each.name: getattr(base, each.name) for each in fields(base)}, states=states)
        scheme = base.parameters.scheme(problem.simulation)
        crowd = crowd_of(base.world, law, scheme, exact=True)
        self.kernel: CrowdKernel = compile_crowd(crowd, 1, threads=processors() if threads is None else threads)
        bodies = [index for species in sample_of(base.world, law).species for index in species]
        self.columns = np.append((BODY * np.array(bodies)[:, None] + np.arange(BODY)).ravel(), size - 1)

    @cached_property
    def terms(self) -> Terms:
        """What is asked, as expressions of z and the states."""
        return terms(self.rollout)

    @cached_property
    def value(self) -> ca.Function:
        """(z, states) -> merit, objective, errors, outputs, costs, the probe's number."""
        asked = self.terms
        parts = [self._merit, asked.objective, asked.errors, asked.outputs, asked.costs, combined(asked.means)]
        return self._function("value", parts)

    @cached_property
    def slopes(self) -> ca.Function:
        """(z, states) -> those of the merit by z and by the states."""
        return self._function("slopes", self._by_states(self._merit))

    @cached_property
    def probe_slopes(self) -> ca.Function:
        """The same of the probe's number."""
        return self._function("probe_slopes", self._by_states(combined(self.terms.means)))

    @cached_property
    def start(self) -> ca.Function:
        """z -> x0."""
        return ca.Function("start", [self.rollout.z], [ca.densify(self.rollout.x0)])

    def states(self, Z: Array, smoothing: float = 0.0) -> Array:
        """(B, N + 1, nx) of a few rows of Z."""
        if smoothing:
            raise SymphysError(
                "smoothed contacts act on all bodies, so that a step cannot leave out those that are far"
            )
        return self._unsorted(self.kernel.rollouts(self._starts(Z), self._given(Z), self.rollout.steps))

    def evaluated(self, Z: Array, smoothing: float, slopes: ca.Function | None = None) -> tuple[list[Array], Array]:
        """The parts of ``value``, (B, m) each, and (B, n) the derivatives; ``slopes``: those by z and by the states."""
        rows, gradient, count = list[list[Array]](), np.zeros(Z.shape), max(1, self.kernel.threads)
        for first in range(0, len(Z), count):
            some, weights = Z[first : first + count], list[Array]()
            for z, x, own in zip(some, self.states(some, smoothing), gradient[first:], strict=False):
                rows.append([np.array(part).ravel() for part in self.value(z, x.T)])
                if slopes is not None:
                    by_z, by_x = (np.array(part) for part in slopes(z, x.T))
                    own += by_z.ravel()
                    weights.append(by_x.T[:, self.columns])
            if weights:
                _, ends = self.kernel.adjoints(self._starts(some), self._given(some), np.array(weights))
                for z, end, own in zip(some, self._unsorted(ends), gradient[first:], strict=False):
                    own += np.array(self._start_slopes(z, 0, end)).ravel()
        sizes = [self.value.size1_out(i) for i in range(self.value.n_out())]
        parts = [np.array([row[i] for row in rows]).reshape(len(Z), size) for i, size in enumerate(sizes)]
        return parts, gradient

    @cached_property
    def _start_slopes(self) -> ca.Function:
        return self.start.reverse(1)

    @property
    def _merit(self) -> Expr:
        return self.terms.objective + self.terms.penalties

    def _by_states(self, number: Expr) -> list[Expr]:
        return [ca.gradient(number, self.rollout.z), ca.gradient(number, self.rollout.states)]

    def _function(self, name: str, outputs: list[Expr]) -> ca.Function:
        return ca.Function(name, [self.rollout.z, self.rollout.states], [ca.densify(each) for each in outputs])

    def _given(self, Z: Array) -> Array:
        return np.zeros((len(Z), self.kernel.crowd.given))

    def _starts(self, Z: Array) -> Array:
        return np.array([np.array(self.start(z)).ravel()[self.columns] for z in Z]).reshape(len(Z), -1)

    def _unsorted(self, states: Array) -> Array:
        found = np.empty_like(states)
        found[..., self.columns] = states
        return found


def require_starts_alone(problem: Problem) -> None:
    """ProblemError if anything but where bodies begin may vary, or acts on them."""
    text = (
        "has no place where a step finds the pairs that are near: bodies fly and touch, and variables set their starts"
    )
    issues = [Issue(f'variable "{each.name}".sets', text) for each in problem.variables if each.kind != "initial"]
    named = [("controller", each.name) for each in problem.controllers]
    named += [*(("force", each.name) for each in problem.forces), *(("phase", each.name) for each in problem.phases)]
    issues += [Issue(f'{kind} "{name}"', text) for kind, name in named]
    alone = {"scenario": problem.scenarios, "termination": problem.termination, "guess": problem.guess}
    issues += [Issue(kind, text) for kind, part in alone.items() if part is not None]
    if any(problem.simulation.smoothing):
        text = "must be 0 where a step finds the pairs that are near: smoothed contacts act on all bodies"
        issues.append(Issue("simulation.smoothing", text))
    if issues:
        raise ProblemError(problem.file, issues)
