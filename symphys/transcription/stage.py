"""A stage: one time step of a problem, with its sensors and its terms of the objective.

What takes steps one after the other, with something else between them, such as actions or nets, is made of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Protocol

import casadi as ca
import numpy as np

from symphys.codegen import FunctionCall, Kernel, MemoryLayout, Place, Program
from symphys.codegen.backends import build_kernel
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.expression import Formula
from symphys.transcription.identities import motion_identity
from symphys.transcription.program import dense, step_calls
from symphys.transcription.rollout import Rollout
from symphys.types import Array, Expr

Value = Callable[[Formula, int], Expr]
"""The value (r,) of a formula at the start (0) or at the end (1) of the step."""


class BatchStep(Protocol):
    """Evaluates a stage for many rows, by a kernel or casadi's virtual machine.

    Attributes:
        sizes: of the results, by name and in their order.
        doubt: see ``Kernel.doubt``.
    """

    @property
    def sizes(self) -> Mapping[str, int]:
        """Return the sizes of the results by name, in their order."""

    @property
    def doubt(self) -> str:
        """Return ``Kernel.doubt``."""

    def forward(self, rows: Array, smoothing: Sequence[float]) -> Mapping[str, Array]:
        """Evaluate rows (B, m) -> results by name, each (B, size)."""

    def gradient(self, rows: Array, seeds: Array, smoothing: Sequence[float]) -> tuple[Any, Array]:
        """Evaluate rows (B, m) with seeds (B, all sizes); return also the slopes (B, m) of seeds . results."""


class Stage:
    """One time step of a problem.

    It begins from a row: x (nx,), the inputs that are given (nu,), p (np,), the times [s] before and after the step,
    and z (n,) where formulas look at it. Its results are ``after``, the next state (nx,), ``sensed``, what is read
    there (o,), whatever ``ask`` makes of formulas, and ``inputs`` (nu,), with what controllers and force laws add.

    Attributes:
        rollout: the rollout of the step.
        sizes: of the parts of a row.
    """

    def __init__(
        self,
        rollout: Rollout,
        sense: ca.Function,
        ask: Callable[[Value], Mapping[str, Expr]],
        reads_z: bool = True,
        with_inputs: bool = False,
    ) -> None:
        """Describe one step of a rollout.

        Args:
            rollout: of the problem.
            sense: (x, p, time) -> what is sensed, see ``sense_function``.
            ask: makes expressions (SX) of the values of formulas, by name.
            reads_z: whether a row has z.
            with_inputs: whether ``inputs`` are among the results.
        """
        self.rollout, self._sense, self._with_inputs = rollout, sense, with_inputs
        parts = rollout.x0, rollout.given, rollout.p
        self.sizes = [*(int(part.shape[0]) for part in parts), 1, 1, int(rollout.z.shape[0]) * reads_z]
        self._values: dict[tuple[Formula, int], Expr] = {}
        asked = {name: part for name, part in ask(self._value).items() if part.shape[0]}
        self._names = tuple(asked)
        results = [ca.densify(ca.SX(part)) for part in asked.values()]
        self._asked = ca.Function("asked", list(self._values.values()), results)

    def _value(self, formula: Formula, shift: int) -> Expr:
        size = int(self.rollout.compiled(formula).size1_out(0))
        return self._values.setdefault((formula, shift), ca.SX.sym("value", size))

    def compiled(self, exact: bool, backend: str, threads: int) -> KernelStep:
        """Build or find a kernel, for smoothing 0 only if ``exact``; KernelUnavailable without a compiler."""
        results = ["after", "sensed", *self._names, *["inputs"] * self._with_inputs]
        source = ProgramSource(lambda: self.program(exact), self._identity(exact))
        return KernelStep(build_kernel(backend, source, results, threads, wait=True))

    def _identity(self, exact: bool) -> str | None:
        """Return a key of ``program``; None where it is not known."""
        asked = [function.serialize() for function in (self._sense, self._asked)]
        values = [(formula.text, shift) for formula, shift in self._values]
        return motion_identity(self.rollout, "stage", exact, self.sizes, *asked, values, self._with_inputs)

    def program(self, exact: bool) -> Program:
        """Return the program, whose vector is a row and whose parameter is the smoothing."""
        places = StagePlaces(self.rollout, sum(self.sizes))
        step = step_calls(places, exact)
        after, last, found = places.x.later().still(), list[FunctionCall](), list[Place]()
        outputs = {"after": after, "sensed": places.layout.take(int(self._sense.size1_out(0)))}
        last.append(FunctionCall(self._sense, (after, places.p, places.time.later().still()), (outputs["sensed"],)))
        for formula, shift in self._values:
            function = dense(self.rollout.compiled(formula))
            found.append(places.layout.take(int(function.size1_out(0))))
            x, time = places.x.later(shift).still(), places.time.later(shift).still()
            last.append(FunctionCall(function, (x, places.u.still(), places.p, time, places.z), (found[-1],)))
        for k, name in enumerate(self._names):
            outputs[name] = places.layout.take(int(self._asked.size1_out(k)))
        if self._names:
            last.append(FunctionCall(self._asked, tuple(found), tuple(outputs[name] for name in self._names)))
        if self._with_inputs:
            outputs["inputs"] = places.u.still()
        reads_z = self.sizes[-1] > 0
        written = (places.x.still(), places.given, places.p, places.time.still(), places.time.later().still())
        return Program(
            size=places.layout.size,
            z=places.row,
            parameters=places.smoothing,
            steps=1,
            outputs={name: place for name, place in outputs.items() if place.size},
            prologue=(FunctionCall(self._parts(), (places.row,), (*written, *[places.z] * reads_z)), *step.numbers),
            body=tuple(step.body),
            epilogue=tuple(call for call in last if any(place.size for place in call.outputs)),
            zeroed=() if reads_z else (places.z,),
        )

    def _parts(self) -> ca.Function:
        """Row -> its parts."""
        row, cuts = ca.SX.sym("row", sum(self.sizes)), np.cumsum([0, *self.sizes]).tolist()
        return ca.Function("parts", [row], [row[a:b] for a, b in pairwise(cuts)][: 6 if self.sizes[-1] else 5])

    def interpreted(self) -> VirtualMachineStep:
        """Return the stage on casadi's virtual machine, for the judge and machines without a compiler."""
        rollout = self.rollout
        row, smoothing = ca.MX.sym("row", sum(self.sizes)), ca.MX.sym("smoothing")
        x, given, p, now, later, z = ca.vertsplit(row, np.cumsum([0, *self.sizes]).tolist())
        z = z if self.sizes[-1] else ca.MX.zeros(rollout.z.shape[0])
        u = given if rollout.feedback is None else rollout.feedback(x, given, p, now)
        after = rollout.step(x, u, p, smoothing)
        values = [
            rollout.compiled(formula)(after if shift else x, u, p, later if shift else now, z)
            for formula, shift in self._values
        ]
        found = {"after": after, "sensed": self._sense(after, p, later)}
        found |= dict(zip(self._names, self._asked.call(values), strict=True)) if self._names else {}
        found |= {"inputs": u} if self._with_inputs else {}
        kept = {name: ca.densify(ca.MX(part)) for name, part in found.items() if part.shape[0]}
        return VirtualMachineStep(ca.Function("stage", [row, smoothing], list(kept.values()), ["row", "s"], list(kept)))


class StagePlaces:
    """The places of a stage in a program; see ``Places``."""

    def __init__(self, rollout: Rollout, row: int) -> None:
        """Reserve a row and its results."""
        self.rollout, self.layout = rollout, MemoryLayout()
        nx, nu = int(rollout.x0.shape[0]), int(rollout.given.shape[0])
        self.row, self.smoothing = self.layout.take(row), self.layout.take(1)
        self.x, self.given = self.layout.series(nx, 2), self.layout.take(nu)
        self.u = self.given if rollout.feedback is None else self.layout.series(nu, 1)
        self.p, self.time = self.layout.take(int(rollout.p.shape[0])), self.layout.series(1, 2)
        self.z = self.layout.take(int(rollout.z.shape[0]))


class KernelStep:
    """A ``BatchStep`` by a kernel."""

    def __init__(self, kernel: Kernel) -> None:
        """Wrap a kernel of ``Stage.program``."""
        self.kernel = kernel
        self.sizes = {name: kernel.program.outputs[name].size for name in kernel.seeded}
        self.forward, self.gradient = kernel.forward, kernel.gradient

    @property
    def doubt(self) -> str:
        """Return ``Kernel.doubt``."""
        return self.kernel.doubt


class VirtualMachineStep:
    """A ``BatchStep`` on casadi's virtual machine, row by row."""

    doubt = ""

    def __init__(self, value: ca.Function) -> None:
        """Wrap a function (row, smoothing) -> results."""
        self._value, self._pull = value, value.reverse(1)
        self.sizes = {value.name_out(k): int(value.size1_out(k)) for k in range(value.n_out())}

    def forward(self, rows: Array, smoothing: Sequence[float]) -> Mapping[str, Array]:
        """Implement ``BatchStep.forward``."""
        found = [[np.array(part).ravel() for part in self._value.call([row, smoothing[0]])] for row in rows]
        return {name: np.array([each[i] for each in found]) for i, name in enumerate(self.sizes)}

    def gradient(self, rows: Array, seeds: Array, smoothing: Sequence[float]) -> tuple[Any, Array]:
        """Implement ``BatchStep.gradient``."""
        cuts, slopes = np.cumsum(list(self.sizes.values()))[:-1], []
        for row, seed in zip(rows, seeds, strict=True):
            values, parts = self._value.call([row, smoothing[0]]), np.split(seed, cuts)
            slopes.append(np.array(self._pull.call([row, smoothing[0], *values, *parts])[0]).ravel())
        return None, np.array(slopes)


def sense_function(rollout: Rollout, sensors: Sequence[str]) -> ca.Function:
    """Return (x, p, time) -> the readings of these sensors in order."""
    x, p, time = ca.SX.sym("x", rollout.x0.shape[0]), ca.SX.sym("p", rollout.p.shape[0]), ca.SX.sym("time")
    known = {sensor.name: sensor for sensor in rollout.problem.sensors}
    read = [rollout.control.sensor(known[name])(x, p, time) for name in sensors]
    return ca.Function("sense", [x, p, time], [ca.densify(ca.vertcat(ca.SX(0, 1), *read))])
