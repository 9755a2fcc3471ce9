"""What formulas take of a whole motion, step by step: sums that a motion carries beside its state, and its start.

A part ``integral(f)`` or ``average(f)`` is a sum along the motion, by the rule of running costs. An input of the first
step, and whatever a formula reads at an instant before the end together with such parts, is a sum as well: of one tick.
A part ``start.NAME`` of the state is a function of the static entries of z. A part ``end.NAME`` is read in the last
state, so that every formula with parts becomes one of the last step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from symphys.errors import SymphysError
from symphys.expression import Formula, MotionPart, parse
from symphys.problem import Problem
from symphys.suggest import quote
from symphys.transcription.rollout import Rollout
from symphys.types import Array, Expr


@dataclass(frozen=True)
class MotionSum:
    """One number that adds up along a motion.

    Attributes:
        formula, component: what is added.
        before, after: (N,) its weights at the start and at the end of each step.
    """

    formula: Formula
    component: int
    before: Array
    after: Array


@dataclass(eq=False)
class MotionSums:
    """The sums and the starts that a problem's formulas need; they are noted as they are asked for.

    Attributes:
        rollout: of the problem.
        sums: beside the state, in this order.
        starts: formulas of the first state, (a,) components in all.
    """

    rollout: Rollout
    sums: list[MotionSum] = field(default_factory=list)
    starts: list[Formula] = field(default_factory=list)
    _known: dict[tuple[str, str, int], slice] = field(default_factory=dict)
    _ends: int = 0

    def sum_of(self, formula: Formula, kind: str, tick: int = -1) -> slice:
        """Where the components of a sum are: ``mean`` over the motion, or ``held`` from the start of step ``tick``."""
        key = kind, formula.text, tick
        if key not in self._known:
            steps, first = self.rollout.steps, len(self.sums)
            before, after = np.zeros(steps), np.zeros(steps)
            if kind == "held":
                before[tick] = 1.0
            elif self.rollout.moves(formula):
                before[:] = after[:] = 0.5 / steps
            else:
                before[:] = 1.0 / steps
            size = int(self.rollout.compiled(formula).size1_out(0))
            self.sums += [MotionSum(formula, i, before, after) for i in range(size)]
            self._known[key] = slice(first, first + size)
        return self._known[key]

    def start_of(self, formula: Formula) -> slice:
        """Where the components of a formula of the first state are among the starts."""
        key = "start", formula.text, 0
        if key not in self._known:
            size = int(self.rollout.compiled(formula).size1_out(0))
            self._known[key] = slice(self._ends, self._ends + size)
            self.starts.append(formula)
            self._ends += size
        return self._known[key]

    def note(self, name: str, formula: Formula, tick: int) -> None:
        """Take note of what a formula with parts, of the table ``name``, needs at a tick.

        Raises:
            SymphysError: for an integral of a variable over time, whose knots are not all decided while it adds up.
        """
        for part in formula.parts:
            if part.kind in ("integral", "average"):
                require_inputs(self.rollout.problem, name, part)
        for part in formula.parts:
            if part.kind in ("integral", "average"):
                self.sum_of(part.formula, "mean")
            elif part.kind == "start" and self.of_input(part.formula):
                self.sum_of(part.formula, "held", 0)
            elif part.kind == "start" and not self.constant(part.formula):
                self.start_of(part.formula)
        if not self.local(formula, tick):
            for name in self.own_names(formula):
                self.sum_of(parse(name), "held", tick)

    def local(self, formula: Formula, tick: int) -> bool:
        """Whether it can be evaluated at its tick: at the end, or where its parts are functions of z."""
        of_start = all(part.kind == "start" and not self.of_input(part.formula) for part in formula.parts)
        return tick == self.rollout.steps or of_start

    def own_names(self, formula: Formula) -> list[str]:
        """What a formula reads at its own instant, variables aside."""
        parts = {part.name for part in formula.parts}
        return sorted(formula.names - parts - {variable.name for variable in self.rollout.problem.variables})

    def constant(self, formula: Formula) -> bool:
        """Whether a formula reads nothing but variables."""
        return not self.own_names(formula)

    def of_input(self, formula: Formula) -> bool:
        """Whether a formula reads an input."""
        return bool(self.rollout.compiled(formula).jac_sparsity(0, 1).nnz())

    def value(self, part: MotionPart, sums: Expr, starts: Expr, duration: Expr, at_end: Expr) -> Expr:
        """A part: of the sums of the last state, the starts, the duration, and its formula at the end."""
        if part.kind == "end" or (part.kind == "start" and self.constant(part.formula)):
            return at_end
        if part.kind == "start" and not self.of_input(part.formula):
            return starts[self.start_of(part.formula)]
        if part.kind == "start":
            return sums[self.sum_of(part.formula, "held", 0)]
        mean = sums[self.sum_of(part.formula, "mean")]
        return mean * duration if part.kind == "integral" else mean

    @cached_property
    def started(self) -> ca.Function:
        """Z -> the starts (a,)."""
        rollout = self.rollout
        found = [
            rollout.compiled(formula)(rollout.x0, rollout.given[:, 0], rollout.p, 0, rollout.z)
            for formula in self.starts
        ]
        return ca.Function("starts", [rollout.z], [ca.densify(ca.vertcat(ca.MX(0, 1), *found))])

    def started_slopes(self, z: Array, statics: Sequence[int]) -> Array:
        """(a, s) the starts by the static entries of z."""
        if self._slopes is None:
            slope = ca.jacobian(self.started(self.rollout.z), self.rollout.z)[:, list(statics)]
            self._slopes = ca.Function("slopes", [self.rollout.z], [ca.densify(slope)])
        return np.array(self._slopes(z)).reshape(-1, len(statics))

    _slopes: ca.Function | None = None


def require_inputs(problem: Problem, name: str, part: MotionPart) -> None:
    """Refuse integrals of knots: SymphysError that names what to integrate instead."""
    for variable in problem.variables:
        if variable.kind == "control" and variable.name in part.formula.names:
            inputs = ", ".join(dict.fromkeys(slot.name for slot in variable.slots))
            text = f"{part.name} is of all knots of {quote(variable.name)} at every instant; integrate {inputs}"
            raise SymphysError(f"{name}: {text}, or take a solver that sees the motion as a whole")
