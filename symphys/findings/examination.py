"""The object "trust" of a result: verification of a solution, as numbers.

The fields are the keys that ``symphys.verification`` writes; ``nan`` is a number that is not known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields
from typing import Self

import numpy as np

from symphys.json_values import Text, name, record
from symphys.records import dataclass
from symphys.types import Array


def nothing() -> Array:
    """Return an empty array (0,)."""
    return np.zeros(0)


@dataclass(frozen=True)
class GradientCheck:
    """|adjoint - difference| of one variable, relative to ``scale``, the norm of its gradient.

    ``jump``: where only differences of either side agree, what is between them, as a change of the variable.
    ``felt``: what a change by the variable's scale changes, as a share of the value; 0 where nothing depends on it.
    ``step``: of the central differences, in units of the variable's scale.
    """

    variable: str
    error: float
    scale: float
    jump: float = 0.0
    felt: float = np.nan
    step: float = np.nan


@dataclass(frozen=True)
class Refined:
    """A finer simulation of the same z: objective, largest error / tolerance, relative change of each gradient."""

    what: str
    objective: float
    worst: float
    gradient: Mapping[str, float] = field(default_factory=dict)

    @property
    def change(self) -> float:
        """Return the largest change of a gradient that is known; nan if none is."""
        known = [change for change in self.gradient.values() if not np.isnan(change)]
        return max(known, default=np.nan)


@dataclass(frozen=True)
class Smoothed:
    """A simulation of the same z with contacts smoothed over ``smoothing`` [m/s]; ``own``: as the solvers see it.

    ``costs``: the sum of what is minimised. ``moved``: how far bodies get from their places in the exact motion, as a
    share of the longest way of one.
    """

    smoothing: float
    own: bool
    objective: float
    worst: float
    costs: float = np.nan
    moved: float = np.nan


@dataclass(frozen=True)
class Columns:
    """Lists of one length, (k,) each; all are empty where their lengths differ."""

    @classmethod
    def from_json(cls, value: object, text: Text = name) -> Self:
        """Read the lists by the names of the fields."""
        read = record(cls, value, text)
        return read if len({getattr(read, each.name).size for each in fields(cls)}) == 1 else cls()


@dataclass(frozen=True)
class Growth(Columns):
    """The magnification ``factor`` (k,), by the end, of a change of the state at ``time`` (k,) [s]; 1 at the end."""

    time: Array = field(default_factory=nothing)
    factor: Array = field(default_factory=nothing)


@dataclass(frozen=True)
class Energy(Columns):
    """The energies at ``time`` [s], and what forces and contacts have given by then [J]; (k,) each."""

    time: Array = field(default_factory=nothing)
    kinetic: Array = field(default_factory=nothing)
    potential: Array = field(default_factory=nothing)
    applied: Array = field(default_factory=nothing)
    contact: Array = field(default_factory=nothing)


@dataclass(frozen=True)
class Gain:
    """A step, beginning at ``time`` [s], in which contacts added energy, or took it [J]."""

    step: int
    time: float
    energy: float
    contacts: tuple[str, ...]


@dataclass(frozen=True)
class Miss:
    """A near miss or a glancing touch of two surfaces, by ``gap`` [m] at ``time`` [s].

    ``touches``: which of the two. ``change`` of ``variable``, in its own unit, makes the one out of the other;
    ``steps`` and ``spreads``: how many scales, or spreads, of all variables together do.
    """

    contact: str
    touches: bool
    time: float
    gap: float
    variable: str
    change: float
    steps: float
    spreads: float


@dataclass(frozen=True)
class Untouched:
    """A ``body`` that what is missed is about and that nothing moves: ``contact`` comes nearest, by ``gap`` [m].

    ``time``: [s] when.
    """

    body: str
    contact: str
    gap: float
    time: float


@dataclass(frozen=True)
class Slide:
    """The distance [m] that two surfaces slid under load, and their largest speed [m/s] and when [s]."""

    contact: str
    distance: float
    speed: float
    time: float


@dataclass(frozen=True)
class HeldBound:
    """A bound that a component of a variable lies at while what is minimised would fall beyond it.

    ``component`` of ``components``; ``side``: "lower" or "upper". ``bound``: nan where it is not the same at all of the
    ``knots`` that lie there, ``of`` all. ``gain``: of the change of the component by its scale at all of these knots,
    to first order.
    """

    variable: str
    component: int
    components: int
    side: str
    bound: float
    knots: int
    of: int
    gain: float


@dataclass(frozen=True)
class Examination:
    """The measurements of one examination: how far a solution can be trusted.

    Attributes:
        gradient: one per variable.
        refined: one per refinement.
        order: of convergence in dt, of "objective" and "gradient".
        smoothed: one per smoothing tried.
        growth: of changes, along the horizon.
        energy: along the horizon.
        gains, gained: the steps in which contacts added most energy, and all that they added [J].
        stops: the steps in which contacts took most from a body that lay on something, by a force from another side.
        drift: largest change of energy in a step that nothing accounts for [J].
        unexplained, drift_at: the largest that the work of motors cannot explain [J], and when [s].
        drifted: the largest sum of such changes since the start [J].
        momentum: largest change of momentum in a step that nothing accounts for, relative.
        jump, jump_of, jump_time, jump_size: the largest change of place in a step that no velocity explains, as a share
            of the body's size or of a radian; of which body or joint, when [s], and how far [m] or [rad].
        residual, residual_at, impulse: largest change of an impulse in the last sweep [N s], when [s], and largest
            impulse in a step [N s].
        unsettled: steps in which that change is large beside the largest impulse.
        left, left_of, left_time, left_speed: the largest velocity of a body without joints that the sweeps of a step
            have not found and more of them would, as a share of the largest in the motion; of which body, when [s], and
            how large [m/s].
        residual_finer: the residual with twice the sweeps [N s], where that was looked at.
        resettled: the same z with other numbers of sweeps, where impulses have not settled.
        deepest, depth_contact, depth_time, size: deepest penetration [m], where, when; size of the smallest body [m].
        passed, passed_contact, passed_time, passed_depth: the deepest that a body was in another between two instants,
            as a share of its size, which contact, when [s], and how deep [m].
        multiple_impacts, ambiguous_impacts, paradoxes, steps: steps with two or more impacts on a body, with several
            bodies that meet at one instant, with friction that pulls surfaces together, of all.
        slides: the contacts that slid furthest.
        misses: surfaces that hardly miss or hardly touch each other.
        untouched: bodies that should be moved, and that nothing moves.
        equations, unknowns: components of all targets, and components of variables that may vary; 0 equations where
            everything is met.
        contradicting: names of targets that cannot all be met nearby.
        opposed: names of targets whose gradients cancel.
        outweighed: names of missed targets that the costs hold back.
        bounds: those that hold the answer back.
        fault: where the first number that is not finite comes from; empty if all are finite.
    """

    gradient: tuple[GradientCheck, ...] = ()
    refined: tuple[Refined, ...] = ()
    order: Mapping[str, float] = field(default_factory=dict)
    smoothed: tuple[Smoothed, ...] = ()
    growth: Growth = field(default_factory=Growth)
    energy: Energy = field(default_factory=Energy)
    gains: tuple[Gain, ...] = ()
    gained: float = np.nan
    stops: tuple[Gain, ...] = ()
    drift: float = np.nan
    unexplained: float = np.nan
    drift_at: float = np.nan
    drifted: float = np.nan
    momentum: float = np.nan
    jump: float = np.nan
    jump_of: str = field(default="", metadata={"key": "jump_at.name"})
    jump_time: float = field(default=np.nan, metadata={"key": "jump_at.time"})
    jump_size: float = field(default=np.nan, metadata={"key": "jump_at.size"})
    residual: float = np.nan
    residual_at: float = np.nan
    unsettled: float = np.nan
    left: float = np.nan
    left_of: str = field(default="", metadata={"key": "left_at.name"})
    left_time: float = field(default=np.nan, metadata={"key": "left_at.time"})
    left_speed: float = field(default=np.nan, metadata={"key": "left_at.speed"})
    residual_finer: float = np.nan
    resettled: tuple[Refined, ...] = ()
    impulse: float = np.nan
    deepest: float = np.nan
    depth_contact: str = field(default="", metadata={"key": "deepest_at.contact"})
    depth_time: float = field(default=np.nan, metadata={"key": "deepest_at.time"})
    size: float = np.nan
    passed: float = np.nan
    passed_contact: str = field(default="", metadata={"key": "passed_at.contact"})
    passed_time: float = field(default=np.nan, metadata={"key": "passed_at.time"})
    passed_depth: float = field(default=np.nan, metadata={"key": "passed_at.depth"})
    multiple_impacts: float = np.nan
    ambiguous_impacts: float = np.nan
    paradoxes: float = np.nan
    steps: float = np.nan
    slides: tuple[Slide, ...] = ()
    misses: tuple[Miss, ...] = ()
    untouched: tuple[Untouched, ...] = ()
    equations: float = np.nan
    unknowns: float = np.nan
    contradicting: tuple[str, ...] = ()
    opposed: tuple[str, ...] = ()
    outweighed: tuple[str, ...] = ()
    bounds: tuple[HeldBound, ...] = ()
    fault: str = ""

    @classmethod
    def from_json(cls, value: object, text: Text = name) -> Examination:
        """Read the record; what is absent or no number becomes nan."""
        return record(cls, value, text)

    @property
    def step(self) -> float:
        """Return the step of the central differences, in units of each variable's scale; nan without any."""
        return self.gradient[0].step if self.gradient else np.nan
