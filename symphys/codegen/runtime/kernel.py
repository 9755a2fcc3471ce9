"""A compiled program: batches of rollouts, their gradients and trajectories, and how it was built."""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symphys.codegen.errors import ProgramError
from symphys.codegen.program.nan_location import Bad, first_bad
from symphys.codegen.program.program import Place, Program
from symphys.codegen.runtime.batch import RolloutBatch
from symphys.codegen.runtime.library import BatchData, Loaded, Memory
from symphys.codegen.runtime.thread_pool import MemoryPool
from symphys.codegen.runtime.widths import Widths
from symphys.codegen.toolchain.compiler import processors
from symphys.records import dataclass
from symphys.types import Array

Outputs = dict[str, NDArray[np.float64]]
"""name -> (batch, size)"""
GradientCheck = Callable[[Array, tuple[Any, ...]], str]
"""(gradients (batch, n), arguments of their call) -> a warning for the user, or an empty text."""


@dataclass(frozen=True)
class BuildReport:
    """The report on how a kernel was built.

    Attributes:
        compiler: its version, in its own words.
        flags: of the compiler.
        lanes: rollouts in one block.
        precision: "double" or "single".
        functions: C functions, forward and adjoint.
        operations: nodes of their graphs together.
        bytes_per_lane: memory of one rollout with its adjoint; a block of lanes takes as many times that.
        cached: whether it came from the cache.
        seconds: from the program to the loaded kernel.
        note: a message for the user, or empty.
        arena: words of 8 bytes of a block, for what its driver notes.
    """

    compiler: str
    flags: tuple[str, ...]
    lanes: int
    precision: str
    functions: int
    operations: int
    bytes_per_lane: int
    cached: bool
    seconds: float
    note: str
    arena: int = 0

    def memories(self, lanes: int, loaded: Loaded) -> MemoryPool:
        """Make memories for blocks of so many lanes of a library."""
        real = np.dtype(np.float32 if self.precision == "single" else np.float64)
        words = loaded.words + -(-8 * self.arena // (lanes * real.itemsize))
        return MemoryPool(words, lanes, real, loaded.prepare)


@dataclass(frozen=True)
class Fixed:
    """An evaluation ``evaluate(program, batch, memory)`` of arrays at fixed addresses, which live as long as this.

    Attributes:
        loaded: the kernel's library.
        batch: the driver's.
        memory: of its own.
        z, parameters: (n,) and (p,), read.
        outputs: (rows, width) all outputs in their order, written.
        gradient: (rows, n), written; empty where there is no seed.
        seed: (rows, s), read; empty without a seed.
    """

    loaded: Loaded
    batch: BatchData
    memory: Memory
    z: Array
    parameters: Array
    outputs: Array
    gradient: Array
    seed: Array

    @property
    def addresses(self) -> tuple[int, int, int, int]:
        """Return the addresses of the function, the program, the batch and the memory."""
        function, data = self.loaded.addresses
        return function, data, ctypes.addressof(self.batch), int(self.memory.ctypes.data)


@dataclass(frozen=True)
class FixedBatch:
    """A small batch that is evaluated again and again: ``run`` reads and writes these arrays, on one thread.

    Attributes:
        widths: the kernel's libraries.
        batch: the driver's.
        z, parameters: (rows, n) and (rows, p), read; 0 at first.
        outputs: (rows, width) all outputs in their order, written.
    """

    widths: Widths
    batch: BatchData
    z: Array
    parameters: Array
    outputs: Array

    def run(self) -> None:
        """Evaluate the batch."""
        self.widths.run_part(self.batch)


class Kernel(ABC):
    """A compiled program. A row's result does not depend on the other rows."""

    threads = 1
    check: GradientCheck | None = None
    """Called with the first gradients; returns the kernel's ``doubt``."""
    doubt = ""
    """A warning for the user about the gradients, or empty."""

    def __init__(self, program: Program, report: BuildReport, seeded: Sequence[str]) -> None:
        """Keep the program; ``seeded``: names of the outputs that are differentiated."""
        self.program, self.report, self.seeded = program, report, tuple(seeded)
        self._slices = program.output_slices()

    def forward(self, Z: ArrayLike, parameters: ArrayLike = (), skipped: int = 0) -> Outputs:
        """Compute the outputs of rollouts.

        Args:
            Z: (batch, n) decision vectors, or one (n,).
            parameters: (batch, p) or one (p,) for all.
            skipped: steps at the end that are not computed; see ``gradient``.
        """
        batch = self._batch(Z, parameters)
        batch.skipped = self._checked(skipped)
        outputs = batch.outputs(self._width())
        self._run(batch)
        return self._named(outputs)

    def gradient(
        self, Z: ArrayLike, seed: ArrayLike, parameters: ArrayLike = (), discount: float = 0.0, skipped: int = 0
    ) -> tuple[Outputs, Array]:
        """Compute outputs, and the derivative of seed . outputs with respect to z, row by row (batch, n).

        Args:
            Z: (batch, n), or one (n,) for all seeds.
            seed: (batch, s) or one (s,) for all; s words of the seeded outputs, in their order.
            parameters: (batch, p) or one (p,) for all.
            discount: the share of its adjoint that ``program.discounted.state`` loses in each step back; above 0,
                adjoints also end where ``kept`` is 0. What comes out is no derivative then.
            skipped: steps at the end that are not computed: ``program.discounted.state`` stays as it is, and what else
                these steps would write is 0.
        """
        batch = self._batch(Z, parameters, seed)
        batch.discount, batch.skipped = discount, self._checked(skipped)
        outputs, gradient = batch.outputs(self._width()), batch.gradient(self.program.z.size)
        self._run(batch)
        if self.check is not None and len(gradient):
            check, self.check = self.check, None
            self.doubt = check(gradient, (Z, seed, parameters, discount, skipped))
        return self._named(outputs), gradient

    @property
    def chosen(self) -> str:
        """Return findings since the kernel was made, in a line, or empty."""
        return self.doubt

    def jacobian(self, z: ArrayLike, name: str, parameters: ArrayLike = ()) -> Array:
        """Compute the derivative of an output at one z (size, n): a lane for each of its words."""
        start = 0
        for other in self.seeded:
            size = self.program.outputs[other].size
            if other == name:
                seeds = np.zeros((size, self._seeds()))
                seeds[:, start : start + size] = np.eye(size)
                return self.gradient(np.ravel(z), seeds, parameters)[1]
            start += size
        raise ProgramError(f"no seeded output is called {name!r}; there are {', '.join(self.seeded)}")

    def trajectory(self, Z: ArrayLike, place: Place, count: int, parameters: ArrayLike = ()) -> Array:
        """Return the words of a place at steps 0 .. count - 1 (batch, count, size)."""
        last = place.offset + place.stride * max(count - 1, 0)
        if min(place.offset, last) < 0 or max(place.offset, last) + place.size > self.program.size:
            raise ProgramError(f"{count} steps of {place} do not lie in the memory of {self.program.size} words")
        batch = self._batch(Z, parameters)
        trajectory = batch.trajectory(place, count)
        self._run(batch)
        return trajectory

    def _checked(self, skipped: int) -> int:
        if skipped and (self.program.discounted is None or not 0 <= skipped <= self.program.steps):
            raise ProgramError(f"{skipped} of {self.program.steps} steps cannot be skipped, or no state is discounted")
        return skipped

    def _batch(self, Z: ArrayLike, parameters: ArrayLike, seed: ArrayLike | None = None) -> RolloutBatch:
        rows = {"z": (Z, self.program.z.size), "parameters": (parameters, self.program.parameters.size)}
        return RolloutBatch(rows if seed is None else rows | {"seed": (seed, self._seeds())})

    def _seeds(self) -> int:
        return sum(self.program.outputs[name].size for name in self.seeded)

    def _width(self) -> int:
        return max((part.stop for part in self._slices.values()), default=0)

    def _named(self, outputs: Array) -> Outputs:
        return {name: outputs[:, part] for name, part in self._slices.items()}

    @abstractmethod
    def _run(self, batch: RolloutBatch) -> None:
        """Compute the results that a batch asks for."""


class ProcessorKernel(Kernel):
    """A kernel on the processor: blocks of lanes, spread over threads, whose number does not affect results."""

    def __init__(
        self, program: Program, widths: Widths, report: BuildReport, seeded: Sequence[str], threads: int | None
    ) -> None:
        """Keep the libraries; made by ``compile_program``."""
        super().__init__(program, report, seeded)
        self.widths = widths
        self.threads = processors() if threads is None else threads

    @property
    def chosen(self) -> str:
        """Return decisions since the kernel was made, in a line, or empty."""
        return "; ".join(filter(None, (self.widths.note, self.doubt)))

    def fixed(self, seed: ArrayLike = ()) -> Fixed:
        """Prepare an evaluation of one z at fixed addresses, with a row for each seed (rows, s), or one without any."""
        seeds = np.array(seed, float)
        z, parameters = np.zeros(self.program.z.size), np.zeros(self.program.parameters.size)
        batch = self._batch(z, parameters, seeds if seeds.size else None)
        outputs = batch.outputs(self._width())
        gradient = batch.gradient(len(z)) if seeds.size else np.zeros((0, len(z)))
        self.widths.finish()
        width = self.widths.ready(batch.rows)
        part, memory = batch.part(0, batch.rows), width.pool.new()
        return Fixed(width.loaded, part, memory, z, parameters, outputs, gradient, seeds)

    def fixed_batch(self, rows: int) -> FixedBatch:
        """Prepare an evaluation of outputs at fixed addresses, for a small batch that is evaluated repeatedly."""
        z, parameters = np.zeros((rows, self.program.z.size)), np.zeros((rows, self.program.parameters.size))
        batch = self._batch(z, parameters)
        outputs = batch.outputs(self._width())
        return FixedBatch(self.widths, batch.part(0, rows), z, parameters, outputs)

    def first_bad(self, z: ArrayLike, parameters: ArrayLike = ()) -> Bad | None:
        """Return the first call of one rollout with a value that is not finite; None if all are finite."""
        batch = self._batch(np.ravel(z), np.ravel(parameters))
        width = self.widths.ready(self.widths.full)
        return width.pool.lend(lambda memory: first_bad(self.program, width.loaded, batch, memory))

    def _run(self, batch: RolloutBatch) -> None:
        """Spread blocks over the threads."""
        self.widths.run(batch, self.threads)
