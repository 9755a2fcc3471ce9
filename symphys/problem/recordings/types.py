"""Measured motions as data, and the settings of identification."""

from __future__ import annotations

from dataclasses import field
from typing import Literal

import numpy as np

from symphys.expression import Formula
from symphys.records import dataclass
from symphys.types import Array


@dataclass(frozen=True, eq=False)
class Measured:
    """A quantity that was measured at the n times of a recording, in SI units and rad, world frame.

    Attributes:
        name: as reports have it.
        value: what the simulation has in its place, a formula of an instant.
        columns: where the numbers come from.
        values: (n, m), NaN where a sample is missing.
        noise: standard deviations of the residuals, (m,), of an orientation (3,) [rad]; None: to be estimated.
        orientation: whether the value is a unit quaternion w x y z (m = 4), whose residual is the rotation vector (3,)
            [rad] between measured and simulated.
        angle: whether it is the angle of a joint, which counts turns from anywhere.
    """

    name: str
    value: Formula
    columns: tuple[str, ...]
    values: Array = field(repr=False)
    noise: Array | None
    orientation: bool = False
    angle: bool = False

    @property
    def missing(self) -> int:
        """Return how many of the ``n`` samples lack a number."""
        return int(np.isnan(self.values).any(axis=1).sum())


@dataclass(frozen=True, eq=False)
class RecordedInput:
    """A command, force or torque as it was recorded, in SI units and rad, world frame.

    Attributes:
        time: (k,) [s] of its samples, on the clock of the recording; before the first and after the last they stay.
        values: (k, m).
        interpolation: "constant": a sample holds until the next one. "linear": straight lines between samples.
        delay: [s] so much later it acts, unless a variable sets that.
        missing: how many rows of the recording lack a number of it.
    """

    time: Array = field(repr=False)
    values: Array = field(repr=False)
    interpolation: Literal["constant", "linear"]
    delay: float
    missing: int


@dataclass(frozen=True, eq=False)
class Recording:
    """A measured motion.

    Attributes:
        name: "toss/0017", or "toss" where the table has one recording.
        source: file and rows, for messages.
        time: (n,) [s] from the start of the simulation, increasing, from 0 to its duration.
        measured: what was measured, each at all n times.
        start: numbers that the recording sets at the start, by the names of ``Problem.initial``, (3,) or (4,); where a
            variable sets the same quantity, they are its guess for this recording. ``hinge.unwrapped`` (1,) [rad] says
            which of the angles that differ by whole turns is meant.
        coordinates: what it sets of joints, which is in ``start`` too, by names such as ``hinge.start`` [rad] or [m],
            ``hinge.start_rate``, (1,) each; where a variable sets the same, they are its guess for this recording.
        inputs: what drives the simulation, by names such as ``knee.command``.
        held_back: not fitted to, only predicted.
        weight: factor of its squared residuals.
    """

    name: str
    source: str
    time: Array = field(repr=False)
    measured: tuple[Measured, ...]
    start: dict[str, Array]
    coordinates: dict[str, Array] = field(default_factory=dict)
    inputs: dict[str, RecordedInput] = field(default_factory=dict)
    held_back: bool = False
    weight: float = 1.0

    @property
    def table(self) -> str:
        """The name of its [[recording]] table."""
        return self.name.partition("/")[0]

    @property
    def samples(self) -> int:
        """Return how many numbers are not missing."""
        return sum(int(np.isfinite(each.values).sum()) for each in self.measured)


@dataclass(frozen=True)
class RecordedFile:
    """A file of recordings.

    Attributes:
        file: its path relative to the folder of the problem file, with "/", or as the problem file names it.
        path: where it was, absolute.
        sha256: of its content.
        text: what is in it, where it is small enough to be kept in the text of the problem.
    """

    file: str
    path: str
    sha256: str
    text: str | None = field(default=None, repr=False)


@dataclass(frozen=True)
class IdentifySettings:
    """The settings of [identify].

    Attributes:
        loss: of residuals over their noise: squares, or Huber's, which grows linearly beyond ``threshold``.
        threshold: of Huber's loss, in standard deviations.
        iterations: of Levenberg-Marquardt.
        tolerance: converged where a step is below this share of the standard errors.
        bootstrap: fits to recordings that are drawn anew; 0: none.
        horizons: shares of the recordings' time that are fitted one after the other, rising to 1.
        held_back_starts: where own numbers of recordings that are held back come from.
        check: "cma": CMA-ES looks for other minima.
        check_evaluations: of all residuals by CMA-ES.
        seed: of the random numbers of both.
    """

    loss: Literal["squares", "huber"] = "squares"
    threshold: float = 3.0
    iterations: int = 100
    tolerance: float = 1e-4
    bootstrap: int = 0
    horizons: tuple[float, ...] = (1.0,)
    held_back_starts: Literal["guess", "before impact", "whole"] = "whole"
    check: Literal["none", "cma"] = "none"
    check_evaluations: int = 1000
    seed: int = 0
