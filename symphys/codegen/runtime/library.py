"""The driver's data as ctypes, and a loaded kernel."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symphys.codegen.emit.guarding import WIDTHS
from symphys.codegen.emit.planned import Plan
from symphys.codegen.program.program import Place, Program
from symphys.codegen.toolchain.libraries import loaded
from symphys.types import Ints

if TYPE_CHECKING:
    from symphys.codegen.emit.codes import Codes

TABLES = ("prologue", "body", "epilogue", "again", "back_body", "back_prologue", "back_epilogue")
INPUTS, RESULTS = ("z", "parameters", "seed"), ("outputs", "gradient", "trajectory")
"""Names of the arrays of a batch, in the order of the driver's ``batch``."""
WORD = ctypes.c_int64
Memory = Any
"""(words, lanes) float64 or float32, aligned: the values, the tape and the adjoints"""


class List(ctypes.Structure):
    """A count and int64 words: the driver's ``ranges`` and ``table``."""

    _fields_ = (("count", WORD), ("words", ctypes.c_void_p))


class RowSource(ctypes.Structure):
    """Rows of doubles; stride 0 means one row for all lanes."""

    _fields_ = (("rows", ctypes.c_void_p), ("stride", WORD))


def program_fields(phase: type) -> Any:
    """Return the fields of a driver's ``program``, whose phases are of this type."""
    return (
        ("size", WORD),
        ("tape", WORD),
        ("steps", WORD),
        *((name, List) for name in ("z", "parameters", "zeroed", "constants", "outputs", "seeded")),
        ("values", ctypes.c_void_p),
        *((name, phase) for name in TABLES),
        ("discounted", WORD * 3),
        ("kept", WORD * 2),
        ("written", List),
        ("first", WORD),
        *((name, List) for name in WIDTHS),
    )


class ProgramData(ctypes.Structure):
    """The driver's ``program``."""

    _fields_ = program_fields(List)


class BatchData(ctypes.Structure):
    """The driver's ``batch``."""

    _fields_ = (
        ("rows", WORD),
        *((name, RowSource) for name in INPUTS),
        *((name, ctypes.c_void_p) for name in RESULTS),
        *((name, WORD) for name in ("offset", "size", "stride", "count")),
        ("discount", ctypes.c_double),
        ("skipped", WORD),
    )


class LinkedCodes:
    """Codes in this process's memory, for blocks of so many lanes; see ``emit/codes.py``."""

    def __init__(self, codes: Codes, lanes: int, real: Any) -> None:
        """Link codes; ``real``: type of numbers."""
        numbers = np.repeat(np.array([*codes.constants, 0.0], real)[:, None], lanes, axis=1)
        raw = np.empty(numbers.nbytes + numbers[0].nbytes, np.uint8)
        start = -raw.ctypes.data % numbers[0].nbytes
        raw[start : start + numbers.nbytes] = numbers.view(np.uint8).ravel()
        words, starts = np.array(codes.words, np.uint32), np.array(codes.starts or [0], np.int64)
        address = raw.ctypes.data + start
        words[starts + 2], words[starts + 3] = address & 0xFFFFFFFF, address >> 32
        self._addresses = words.ctypes.data + 4 * starts
        self._kept = raw, words

    def linked(self, entries: Ints) -> Ints:
        """Return entries of calls one after the other with addresses in place of the numbers of functions."""
        found, at = entries.copy(), 0
        while at + 1 < len(found):  # a table of no entries has one word
            if found[at] >= 0:
                found[at] = self._addresses[found[at]]
            at += int(found[at + 1])
        return found


class Loaded:
    """A kernel's library with the program that it runs."""

    def __init__(
        self, path: Path, program: Program, plan: Plan, seeded: Sequence[str], codes: LinkedCodes | None = None
    ) -> None:
        """Load the library; KernelUnavailable if the system refuses. ``codes``: for an interpreter."""
        library = loaded(path)
        self._evaluate = _prepared(library.evaluate, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
        self._prepare = _prepared(library.prepare, ctypes.c_void_p, ctypes.c_void_p)
        self._begin = _prepared(library.begin, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
        self._perform = _prepared(library.perform, ctypes.c_void_p, ctypes.c_void_p, WORD)
        self._kept: list[Any] = []
        self.data = ProgramData(plan.size or program.size, plan.tape, program.steps)
        values = np.array([x for _, row in program.constants for x in row] or [0], dtype=np.float64)
        self._kept.append(values)
        self.data.values = values.ctypes.data
        for name, listed in data_places(program, seeded).items():
            setattr(self.data, name, self._list(len(listed), _ranges(listed)))
        for name in TABLES:
            count, words = plan.tables[name]
            if codes is not None:
                words = codes.linked(words)
            setattr(self.data, name, self._list(count, words))
        self._kept.append(codes)
        self.data.written = self._list(len(plan.written), np.append(plan.written, 0))
        if (guarding := plan.guarding) is not None:
            self.data.first = guarding.first
            for name, words in guarding.rows.items():
                rows = words if words.size else np.zeros(1, np.int64)
                setattr(self.data, name, self._list(guarding.count(name), rows))
        if program.discounted is not None:
            state, kept = program.discounted.state, program.discounted.kept
            self.data.discounted = (WORD * 3)(state.offset, state.size, state.stride)
            self.data.kept = (WORD * 2)(*((kept.offset, kept.stride) if kept else (0, 0)))

    @property
    def words(self) -> int:
        """Return the words of memory of a lane: values, tape and adjoints."""
        return int(2 * self.data.size + self.data.tape)

    def _list(self, count: int, words: Any) -> List:
        self._kept.append(words)
        return List(count, words.ctypes.data)

    @property
    def addresses(self) -> tuple[int, int]:
        """Return the addresses of the driver's ``evaluate`` and of its program."""
        return ctypes.cast(self._evaluate, ctypes.c_void_p).value or 0, ctypes.addressof(self.data)

    def prepare(self, memory: Memory) -> None:
        """Make a memory ready for the driver's notes."""
        if self.data.calls.count:
            self._prepare(ctypes.byref(self.data), memory.ctypes.data)

    def evaluate(self, batch: BatchData, memory: Memory) -> None:
        """Run a batch in this memory; the interpreter is free meanwhile."""
        self._evaluate(ctypes.byref(self.data), ctypes.byref(batch), memory.ctypes.data)

    def begin(self, batch: BatchData, memory: Memory) -> None:
        """Put the inputs of the batch's first row into the memory."""
        self._begin(ctypes.byref(self.data), ctypes.byref(batch), memory.ctypes.data)

    def perform(self, name: str, memory: Memory, k: int) -> None:
        """Run the calls of one table at step k."""
        self._perform(ctypes.byref(getattr(self.data, name)), memory.ctypes.data, k)


def _prepared(function: Any, *types: Any) -> Any:
    function.argtypes, function.restype = types, None
    return function


def data_places(program: Program, seeded: Sequence[str]) -> dict[str, Sequence[Place]]:
    """Return the places that the drivers know by name."""
    return {
        "z": [program.z],
        "parameters": [program.parameters],
        "zeroed": program.zeroed,
        "constants": [place for place, _ in program.constants],
        "outputs": list(program.outputs.values()),
        "seeded": [program.outputs[name] for name in seeded],
    }


def strided(places: Sequence[Place]) -> Any:
    """Return offset, size and stride of each place, one after the other."""
    return np.array([x for place in places for x in (place.offset, place.size, place.stride)] or [0], dtype=np.int64)


def _ranges(places: Sequence[Place]) -> Any:
    return np.array([x for place in places for x in (place.offset, place.size)] or [0], dtype=np.int64)
