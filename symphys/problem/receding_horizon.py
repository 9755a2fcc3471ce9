"""What [mpc] says, after validation: a controller that plans anew at every tick, and the plant it is tried on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class PlantSettings:
    """How the plant differs from the model.

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
