"""Rollouts with quantities over time as outputs, and the adjoint of these outputs with respect to z."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from symphys.codegen import Kernel, KernelUnavailable, processors
from symphys.codegen.backends import PRECISIONS, build_kernel
from symphys.codegen.backends.precision import warn
from symphys.dynamics.observation import named_sensors
from symphys.errors import SymphysError
from symphys.expression import Formula, FormulaError, parse
from symphys.problem import Problem
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.transcription.formula_names import instant, namespace
from symphys.transcription.network_rollout import require_small_nets
from symphys.transcription.program import rollout_program
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.types import Array

VALUE = "merit"


@dataclass(frozen=True, eq=False)
class RecordedRollout:
    """A kernel for batches Z (B, n): the value of each row, and quantities at the ends of all N steps.

    Attributes:
        name: of the problem.
        quantities: by name, the numbers in one: 3 of a position.
        steps: N.
    """

    name: str
    quantities: Mapping[str, int]
    steps: int
    smoothing: float
    _kernel: Kernel

    def forward(self, Z: Array) -> tuple[Array, dict[str, Array]]:
        """Return values (B,), and quantities (B, N, k) by name."""
        outputs = self._kernel.forward(Z, (self.smoothing,))
        found = {name: np.array(outputs[name]).reshape(len(Z), self.steps, -1) for name in self.quantities}
        return np.array(outputs[VALUE][:, 0]), found

    def pull(self, Z: Array, value: Array, quantities: Mapping[str, Array]) -> Array:
        """Return adjoints (B, n) of Z, from those of the values (B,) and of the quantities (B, N, k) by name."""
        parts = [np.asarray(quantities[name], float).reshape(len(Z), -1) for name in self.quantities]
        seeds = np.ascontiguousarray(np.concatenate([np.asarray(value, float)[:, None], *parts], axis=1))
        adjoint = self._kernel.gradient(Z, seeds, (self.smoothing,))[1]
        warn(self.name, self._kernel.doubt)
        return adjoint


def record_rollout(
    problem: Problem, quantities: Sequence[str], smoothing: float, backend: str, threads: int | None
) -> RecordedRollout:
    """Compile a rollout with quantities as outputs.

    Args:
        problem: the simulated problem.
        quantities: formulas as in problem files: ``ball.position``, ``rotate(torso.orientation, [0, 0, 1])``.
        smoothing: of the contacts [m/s].
        backend: the name of a kernel's.
        threads: their number for a batch; None: one for each processor.

    Raises:
        SymphysError: a quantity is no formula, or names what the problem does not have; there can be no kernel.
        ProblemError: the problem has a large net.
    """
    require_small_nets(problem, "a rollout of which quantities are asked for")
    formulas = {text: parsed(text) for text in quantities}
    rollout = symbolic_rollout(problem, asked=formulas.values())
    for formula in formulas.values():
        check_names(rollout, formula)
    program = rollout_program(rollout, smoothing == 0, formulas)
    if backend not in PRECISIONS:
        raise SymphysError(
            f"quantities need a kernel; the backend {quote(backend)} has none, {hint(backend, PRECISIONS)}"
        )
    count = processors() if threads is None else threads
    try:
        kernel = build_kernel(backend, program, (VALUE, *formulas), count)
    except KernelUnavailable as error:
        raise SymphysError(f"quantities need a kernel: {error}") from None
    sizes = {name: program.outputs[name].size // rollout.steps for name in formulas}
    return RecordedRollout(problem.name, sizes, rollout.steps, smoothing, kernel)


def parsed(text: str) -> Formula:
    """Parse the formula of a quantity."""
    try:
        return parse(text)
    except FormulaError as error:
        raise SymphysError(f"quantity {quote(text)}: {error}") from None


def check_names(rollout: Rollout, formula: Formula) -> None:
    """Raise SymphysError for a name that the problem does not have."""
    at = instant(rollout.world, rollout.inputs, rollout.parameters, rollout.memory, 0)
    known = namespace(
        rollout.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.memory, at, formula.names
    )
    known |= {variable.name: at.z for variable in rollout.problem.variables}
    for name in sorted(formula.names - known.keys()):
        names = known | dict.fromkeys(named_sensors(rollout.world))
        raise SymphysError(f"quantity {quote(formula.text)}: there is no {quote(name)}; {hint(name, names)}")
