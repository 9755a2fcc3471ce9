"""All that a problem file says of identification: recordings, what varies from one to the next, and [identify]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from symphys.model.state_layout import input_sizes
from symphys.model.world import World
from symphys.problem.model import Simulation, Variable
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.reading.faults import Faults
from symphys.problem.recordings.columns import RecordingFault
from symphys.problem.recordings.conversion import MeasurementFrame
from symphys.problem.recordings.files import FileFinder
from symphys.problem.recordings.magnitude import longest
from symphys.problem.recordings.starts import Starts
from symphys.problem.recordings.table import RecordedRows, RecordedWorld, read_recordings
from symphys.problem.recordings.times import steps_until
from symphys.problem.recordings.types import IdentifySettings, RecordedFile, Recording
from symphys.problem.schema import Document
from symphys.problem.schema.recording import RecordingTable
from symphys.problem.tables.shapes import read_orientation
from symphys.problem.units import formula_units
from symphys.types import Array

MOST_STEPS = 100_000
"""Of a duration that comes from recordings: times in milliseconds, or since 1970, are not simulated by mistake."""


@dataclass(frozen=True, eq=False)
class Identified:
    """What there is to identify from.

    Attributes:
        recordings: of all tables.
        recorded_files: that they were read from.
        new_files: those of them that the problem's text does not keep yet.
        identify: the settings of [identify].
    """

    recordings: tuple[Recording, ...] = ()
    recorded_files: tuple[RecordedFile, ...] = ()
    new_files: tuple[RecordedFile, ...] = ()
    identify: IdentifySettings = field(default_factory=IdentifySettings)

    def fields(self) -> dict[str, Any]:
        """Return the recordings of the problem."""
        return {"recordings": self.recordings, "recorded_files": self.recorded_files, "identify": self.identify}


def read_identification(
    document: Document,
    parametric: ParametricWorld,
    nominal: World,
    initial: Mapping[str, Array],
    simulation: Simulation,
    sample: Mapping[str, Any],
    variables: Sequence[Variable],
    faults: Faults,
) -> Identified:
    """Recordings and settings; notes what is wrong with them.

    Args:
        document: the tables.
        parametric: the world.
        nominal: the same with its numbers.
        initial: the start in the file.
        simulation: how time passes.
        sample: a value for each name in formulas, as the guess has it.
        variables: that may vary.
        faults: gets what is wrong.
    """
    if not document.recording:
        check_unused(document, faults)
        return Identified()
    world = RecordedWorld(
        sample,
        formula_units(nominal, sample, variables),
        simulation.duration,
        simulation.dt,
        longest(parametric, initial, simulation.duration),
        Starts(parametric.joints, initial),
        input_sizes(nominal),
        frozenset(slot.name for variable in variables for slot in variable.slots if variable.kind == "initial"),
    )
    finder = FileFinder(document.recorded)
    frames = [read_frame(index, table, faults) for index, table in enumerate(document.recording)]
    recordings = read_recordings(document.recording, world, finder, frames, faults)
    check_starts(recordings, variables, faults)
    check_inputs(document.recording, recordings, variables, faults)
    faults.stop_if_any()
    settings = IdentifySettings() if document.identify is None else IdentifySettings(**document.identify.model_dump())
    new = tuple(finder.found.values())
    return Identified(recordings, (*finder.kept.values(), *new), new, settings)


def with_duration(document: Document, faults: Faults) -> Document:
    """The document with a duration: without one in [simulation], whole steps up to the last recorded sample."""
    if document.simulation.duration is not None:
        return document
    place = ("simulation", "duration")
    if not document.recording:
        faults.add(place, "this key is required without [[recording]], whose last sample it is otherwise")
        faults.stop_if_any()
    ends, dt = list[float](), document.simulation.dt
    for index, table in enumerate(document.recording):
        folder = Path(faults.origin(("recording", index)).file).parent
        try:
            ends.append(RecordedRows(table, FileFinder(document.recorded), folder).end())
        except RecordingFault as fault:
            faults.add(("recording", index, *fault.key), str(fault))
    faults.stop_if_any()
    steps = steps_until(max(ends), dt)
    if steps > MOST_STEPS:
        text = f"samples go on to {max(ends):.6g} s, {steps:.4g} steps of {dt:g} s"
        advice = 'take until, clock = "first row", time_factor or rate, or state duration in [simulation]'
        faults.add(("recording", ends.index(max(ends))), f"{text}; {advice}")
        faults.stop_if_any()
    simulation = document.simulation.model_copy(update={"duration": steps * dt})
    return document.model_copy(update={"simulation": simulation})


def read_frame(index: int, table: RecordingTable, faults: Faults) -> MeasurementFrame | None:
    """Return the frame of the measurement system; None if it is that of the world."""
    if table.frame is None:
        return None
    place = ("recording", index, "frame", "orientation")
    orientation = read_orientation(place, table.frame.orientation, faults)
    return MeasurementFrame(np.array(table.frame.position), orientation)


def check_unused(document: Document, faults: Faults) -> None:
    """Without recordings, nothing refers to them."""
    if document.identify is not None:
        faults.add(("identify",), "there is no [[recording]] to identify from")
    for index, table in enumerate(document.variable):
        if table.each is not None:
            faults.add(("variable", index, "each"), "there is no [[recording]]; leave this out, or add one")
    faults.stop_if_any()


def check_starts(recordings: Sequence[Recording], variables: Sequence[Variable], faults: Faults) -> None:
    """Check that no variable sets for all recordings what each sets at the start."""
    given = {name: each.table for each in recordings for name in each.start}
    for index, variable in enumerate(variables):
        for slot in variable.slots:
            if slot.name in given and not variable.each:
                text = f'recording {given[slot.name]} sets {slot.name} at the start; with each = "recording" that is'
                faults.add(("variable", index, "sets"), f"{text} where this variable begins, otherwise leave it out")


def check_inputs(
    tables: Sequence[RecordingTable], recordings: Sequence[Recording], variables: Sequence[Variable], faults: Faults
) -> None:
    """Check that no variable sets what recordings drive, and that all tables state the same delay."""
    driven = {name: each.table for each in recordings for name in each.inputs}
    for index, variable in enumerate(variables):
        for slot in variable.slots:
            if variable.kind == "control" and slot.name in driven:
                text = f"recording {driven[slot.name]} drives {slot.name} by its inputs; leave one of the two out"
                faults.add(("variable", index, "sets"), text)
    first = dict[str, tuple[str, float]]()
    for index, table in enumerate(tables):
        for name, each in table.input_tables.items():
            other, delay = first.setdefault(name, (table.name, each.delay))
            if each.delay != delay:
                text = f"is {delay:g} s in recording {other}; all recordings that drive {name} state the same delay"
                faults.add(("recording", index, "inputs", name, "delay"), text)
