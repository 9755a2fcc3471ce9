"""Numbers of the world that phases set: how much of a phase there is in a step, and what a number is there.

A step has one value of each number. Its inputs hold a share for each phase that sets something, 1 in the steps of the
phase and 0 in others, and a number is base + sum of share (own - base). Impulses of constraints cover half of the
substep before as well (docs/time_step.md, equation 2), so that where they are bounded by a number, as friction is, the
first step has that part of its share from the step before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca

from symphys.problem import Problem
from symphys.problem.parametric.by_phase import lagged
from symphys.types import Array, Expr

QUARTER = 0.25
"""Of a step: so far from its ends it is asked which step a number belongs to, so that rounding does not matter."""


@dataclass(frozen=True)
class PhaseShare:
    """How much of a phase there is in a step.

    Attributes:
        name: of the input.
        symbol: SX, that stands for it in a world.
        ticks: the numbers of its first and last state.
        before: how much of a step counts as the step before it.
    """

    name: str
    symbol: Expr
    ticks: tuple[int, int]
    before: float

    def at(self, tick: Expr) -> Expr:
        """The share in the step of this number."""
        now = self._within(tick)
        return (1 - self.before) * now + self.before * self._within(ca.fmax(tick - 1, 0)) if self.before else now

    def _within(self, tick: Expr) -> Expr:
        first, last = (end - QUARTER for end in self.ticks)
        return ca.logic_and(tick > first, tick < last)


@dataclass(frozen=True)
class PhaseNumbers:
    """What phases set.

    Attributes:
        shares: of the phases that set something, one or two each.
        sets: by the name of a parameter, the names of the numbers that stand for it, with their shares.
        nominal: the numbers of the file.
    """

    shares: tuple[PhaseShare, ...] = ()
    sets: Mapping[str, tuple[tuple[str, PhaseShare], ...]] = field(default_factory=dict)
    nominal: Mapping[str, Array] = field(default_factory=dict)

    def at(self, ticks: Expr) -> Expr:
        """(shares, N): of the steps of these numbers (1, N)."""
        return ca.vertcat(type(ticks)(0, ticks.shape[1]), *(share.at(ticks) for share in self.shares))

    def values(self, known: Mapping[str, Expr]) -> dict[str, Expr]:
        """What each of these parameters is in a step (SX), by name; ``known``: what is a symbol of p."""
        found = {}
        for name, parts in self.sets.items():
            base = known.get(name, ca.DM(self.nominal[name]))
            found[name] = ca.SX(base) + sum(share.symbol * (known[own] - base) for own, share in parts)
        return found


def phase_numbers(problem: Problem) -> PhaseNumbers:
    """What the phases of a problem set."""
    setting = [phase for phase in problem.phases if phase.sets]
    if not setting:
        return PhaseNumbers()
    from symphys.dynamics.step import splits_of  # late: the physics of a step, which few problems need here

    simulation, shares = problem.simulation, dict[tuple[str, bool], PhaseShare]()
    before = 0.5 / (1 + splits_of(problem.world(), simulation.scheme()))
    sets: dict[str, list[tuple[str, PhaseShare]]] = {}
    for phase in setting:
        for name in phase.sets:
            late = lagged(problem.parametric, name)
            if (phase.name, late) not in shares:
                called = f"{phase.name}.{'share_of_impulses' if late else 'share'}"
                ticks = phase.ticks(simulation.steps)
                shares[phase.name, late] = PhaseShare(called, ca.SX.sym(called), ticks, before if late else 0.0)
            sets.setdefault(name, []).append((f"{phase.name}.{name}", shares[phase.name, late]))
    nominal = {name: problem.parameters[name] for name in sets}
    return PhaseNumbers(tuple(shares.values()), {name: tuple(parts) for name, parts in sets.items()}, nominal)
