"""A program as the device's driver reads it: structures of addresses, and the words they lead to."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence

import numpy as np

from symphys.codegen.cuda.device import Device
from symphys.codegen.cuda.schedule import Schedule
from symphys.codegen.emit.alternatives import LEFT_OUT
from symphys.codegen.emit.planned import Plan
from symphys.codegen.program.program import Program
from symphys.codegen.runtime.library import WORD, List, RowSource, data_places, program_fields, strided
from symphys.types import Ints


class DevicePhase(ctypes.Structure):
    """The driver's ``phase``."""

    _fields_ = (("levels", WORD), ("spans", ctypes.c_void_p), ("entries", ctypes.c_void_p))


class DeviceProgram(ctypes.Structure):
    """The driver's ``program``."""

    _fields_ = program_fields(DevicePhase)


class DeviceJob(ctypes.Structure):
    """The driver's ``job``."""

    _fields_ = (
        ("program", ctypes.c_void_p),
        ("memory", ctypes.c_void_p),
        *((name, WORD) for name in ("rows", "first", "end")),
        *((name, RowSource) for name in ("z", "parameters", "seed")),
        *((name, ctypes.c_void_p) for name in ("outputs", "gradient", "trajectory")),
        *((name, WORD) for name in ("offset", "size", "stride", "count")),
        ("discount", ctypes.c_double),
    )


class Tables:
    """A program's data in the memory of a device.

    Attributes:
        address: of the driver's ``program``.
        warps: of a block.
    """

    def __init__(
        self,
        device: Device,
        program: Program,
        planned: Plan,
        seeded: Sequence[str],
        phases: Mapping[str, Schedule],
        warps: int,
    ) -> None:
        """Copy everything there."""
        self.device, self.warps = device, warps
        data = DeviceProgram(program.size, planned.tape, program.steps)
        values = [x for _, row in program.constants for x in row]
        self._kept = [device.put(np.array(values or [0], float))]
        data.values = device.address(self._kept[0])
        for name, places in data_places(program, seeded).items():
            words = np.array([x for place in places for x in (place.offset, place.size)], np.int64)
            setattr(data, name, List(len(places), self._put(words)))
        for name, each in phases.items():
            spans, entries = self._put(each.spans.ravel()), self._put(interleaved(each.entries, device.lanes))
            setattr(data, name, DevicePhase(len(each.spans), spans, entries))
        written = [place for call in program.body for place in call.outputs if place.stride]
        data.written = List(len(written), self._put(strided(written)))
        if program.discounted is not None:
            state, kept = program.discounted.state, program.discounted.kept
            data.discounted = (WORD * 3)(state.offset, state.size, state.stride)
            data.kept = (WORD * 2)(*((kept.offset, kept.stride) if kept else (0, 0)))
        self._kept.append(device.put(np.frombuffer(bytes(data), np.uint8)))
        self.address = device.address(self._kept[-1])

    def _put(self, words: Ints) -> int:
        """The address of a copy."""
        self._kept.append(self.device.put(words if words.size else np.zeros(1, np.int64)))
        return self.device.address(self._kept[-1])


def interleaved(entries: Ints, lanes: int) -> Ints:
    """Entries whose offsets and strides count the words of all lanes; those of what is copied count robots' words."""
    found, at = entries.copy(), 0
    while at < len(found):
        length = int(found[at + 1])
        found[at + 2 : at + length] *= 1 if found[at] == LEFT_OUT else lanes
        at += length
    return found
