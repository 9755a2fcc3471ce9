"""The [[recording]] and [identify] tables: from columns to recordings in the units and the frame of the world."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from math import floor
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from symphys.expression import Formula, FormulaError, parse
from symphys.expression.units import unit_of
from symphys.model.state_layout import input_sizes
from symphys.model.world import World
from symphys.problem.model import Simulation, Variable
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.quantities import formula_units
from symphys.problem.reading.faults import Faults
from symphys.problem.recordings.columns import RecordedColumns, RecordingFault, read_csv, read_npz
from symphys.problem.recordings.conversion import (
    LENGTH,
    MAX_MEASUREMENT,
    ORIENTATION,
    PLACED,
    TURNED,
    MeasurementFrame,
    check_ends,
    check_lengths,
    check_table,
    convert,
    longest,
    read_times,
    steps_until,
    time_column,
)
from symphys.problem.recordings.files import ARRAYS, FileFinder
from symphys.problem.recordings.starts import Starts
from symphys.problem.recordings.types import IdentifySettings, Measured, RecordedFile, RecordedInput, Recording
from symphys.problem.schema import Document
from symphys.problem.schema.recording import ColumnsTable, InputTable, MeasuredTable, RecordingTable, leaves
from symphys.problem.tables.bodies import read_orientation
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Array

MAX_RECORDINGS = 100_000
"""Recordings of one table."""
MIN_NOISE = 1e-30
"""Of a noise: squares of what is divided by it are numbers."""
MAX_STEPS = 100_000
"""Of a duration that comes from recordings: times in milliseconds, or since 1970, are not simulated by mistake."""


@dataclass(frozen=True)
class StartColumns:
    """A quantity that the first row sets: its name, its columns and their units, how many numbers, and the unit."""

    quantity: str
    table: ColumnsTable
    size: int

    def first_row(self, rows: RecordedColumns, frame: MeasurementFrame | None) -> Array:
        """(size,): what the first row of a recording has; RecordingFault where a number is missing."""
        key = ("start", self.quantity)
        rows.require(self.table.columns, key)
        value: Array = convert(rows.part(0, 1), self.table.columns, self.table, self.quantity, self.size, frame, key)[0]
        if not np.isfinite(value).all():
            raise RecordingFault(key, f"{rows.where(0)}: the first row lacks a number of {self.quantity}")
        return value


@dataclass(frozen=True)
class InputColumns:
    """An input that was recorded: its name, its columns with their units, and how many numbers it has."""

    name: str
    table: InputTable
    size: int

    def over_time(self, rows: RecordedColumns, time: Array, frame: MeasurementFrame | None) -> RecordedInput:
        """The input of a recording with times (n,) [s]; RecordingFault where no row has its numbers."""
        key = ("inputs", self.name)
        values = convert(rows, self.table.columns, self.table, self.name, self.size, frame, key)[: len(time)]
        known = np.isfinite(values).all(axis=1)
        if not known.any():
            raise RecordingFault(key, f"{rows.where(0)}: no row from this one on has the numbers of {self.name}")
        return RecordedInput(
            time[known], values[known], self.table.interpolation, self.table.delay, int(np.sum(~known))
        )


def read_input_columns(table: RecordingTable, sizes: Mapping[str, int], units: Mapping[str, str]) -> list[InputColumns]:
    """Read ``inputs``; ``sizes`` of all inputs by name."""
    found = list[InputColumns]()
    for name, columns in table.input_tables.items():
        key = ("inputs", name)
        if name not in sizes:
            text = f"a recording cannot drive {quote(name)}, but forces and torques on bodies and commands of motors"
            raise RecordingFault(key, f"{text}; {hint(name, sizes)}")
        check_table(columns, units.get(name, ""), name, key)
        found.append(InputColumns(name, columns, sizes[name]))
    return found


def read_start_columns(
    table: RecordingTable, sample: Mapping[str, Any], units: Mapping[str, str], starts: Starts
) -> list[StartColumns]:
    """Read ``start``, with the units that the same columns have in ``measured``."""
    known = {name: value.size for name, value in starts.initial.items()}
    known |= dict.fromkeys(starts.of_joints, 1)
    found = list[StartColumns]()
    for quantity, given in leaves(table.start):
        key = ("start", quantity)
        if quantity not in known:
            text = f"a recording cannot set {quote(quantity)} at the start; {hint(quantity, known)}"
            raise RecordingFault(key, text)
        try:
            columns = ColumnsTable.model_validate(given if isinstance(given, Mapping) else {"columns": given})
        except ValidationError as error:
            text = str(error.errors(include_url=False)[0]["msg"])
            raise RecordingFault(
                key, f'{text}; write "position", ["x", "y", "z"] or {{ columns = "x", unit = "mm" }}'
            ) from None
        if not isinstance(given, Mapping):
            same = next((each for each in table.measured if each.columns == columns.columns), columns)
            columns = ColumnsTable(**{key: getattr(same, key) for key in ColumnsTable.model_fields})
        check_table(columns, units.get(quantity, ""), quantity, key)
        found.append(StartColumns(quantity, columns, known[quantity]))
    return found


def pieces(columns: RecordedColumns, starts: Array | None, split: str | None) -> list[tuple[int, int]]:
    """The first row of each recording and that after its last one.

    Args:
        columns: of a file.
        starts: (K + 1,) first rows, and the number of all rows; None: not given.
        split: a column whose value differs from recording to recording; None: one recording.
    """
    if starts is not None:
        edges = first_rows(columns, starts)
    elif split is not None:
        values = columns.numbers(split, "split")
        missing = np.flatnonzero(np.isnan(values))
        if missing.size:
            raise RecordingFault("split", f"{columns.where(int(missing[0]), split)}: there is no number")
        edges = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0) + 1, [columns.count]])
    else:
        edges = np.array([0, columns.count])
    if len(edges) - 1 > MAX_RECORDINGS:
        key = "rows" if starts is not None else "split"
        raise RecordingFault(
            key, f"{columns.label} makes {len(edges) - 1:,} recordings; at most {MAX_RECORDINGS:,} are allowed"
        )
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def first_rows(columns: RecordedColumns, starts: Array) -> NDArray[np.intp]:
    """(K + 1,): the rows as integers, in order, and within the file."""
    label, n = columns.label, columns.count
    if starts.ndim != 1 or starts.size < 2 or not np.all(starts == np.round(starts)):
        raise RecordingFault("rows", f"{label}: first rows must be two or more whole numbers, such as [0, 80, 210]")
    edges = starts.astype(np.intp)
    if edges[0] < 0 or edges[-1] > n or np.any(np.diff(edges) <= 0):
        text = f"first rows must increase, from 0 or more to {n}, the number of rows; they are {shown(edges)}"
        raise RecordingFault("rows", f"{label}: {text}")
    return edges


def shown(edges: NDArray[np.intp]) -> str:
    """The first and the last of some whole numbers."""
    few = edges.tolist()
    return str(few) if len(few) <= 6 else f"[{', '.join(map(str, few[:3]))}, ..., {few[-1]}]"


def held_back(wanted: bool | float | Sequence[int | str], names: Sequence[Sequence[str]]) -> list[bool]:
    """Return the held-back recordings.

    Args:
        wanted: all or none, a share that is spread evenly over them, or numbers from 0 and names.
        names: by what each recording is known: its own name, its file.
    """
    count = len(names)
    if isinstance(wanted, bool):
        return [wanted] * count
    if isinstance(wanted, float):
        held = [floor((k + 1) * wanted + 1e-9) > floor(k * wanted + 1e-9) for k in range(count)]
        if 0 < wanted < 1 and len(set(held)) == 1:
            text = f"{wanted:g} of {count} recordings is {'all' if held[0] else 'none'} of them; give a list"
            raise RecordingFault("held_back", text)
        return held
    chosen = [False] * count
    for each in wanted:
        own = [k for k in range(count) if (each == k if isinstance(each, int) else each in names[k])]
        if not own and isinstance(each, int):
            raise RecordingFault("held_back", f"there is no recording {each}; they are counted from 0 to {count - 1}")
        if not own:
            valid = [name for known in names for name in known[:1]]
            raise RecordingFault("held_back", f"there is no recording {quote(str(each))}; {hint(str(each), valid)}")
        for k in own:
            chosen[k] = True
    return chosen


@dataclass(frozen=True, eq=False)
class RecordedWorld:
    """The world against which recordings are checked.

    Attributes:
        sample: a value for each name in formulas, as the guess has it.
        units: of these, where they are known.
        duration: [s] of the simulation.
        dt: [s] its time step.
        length: [m] that nothing exceeds by far; see ``longest``.
        starts: of bodies and joints.
        inputs: how many numbers each force, torque and command has, by name.
        moved: names of initial quantities that variables set.
    """

    sample: Mapping[str, Any]
    units: Mapping[str, str]
    duration: float
    dt: float
    length: float
    starts: Starts
    inputs: Mapping[str, int]
    moved: frozenset[str]


@dataclass(frozen=True, eq=False)
class MeasuredColumns:
    """A quantity that was measured: its formula, and what the columns hold.

    Attributes:
        table: as the file has it.
        formula: of what was measured.
        quantity: its name, if the formula is one; else empty.
        value: (size,) at the start of the guess.
        unit: as far as it is known.
        noise: of the residuals; None: not known.
    """

    table: MeasuredTable
    formula: Formula
    quantity: str
    value: Array
    unit: str
    noise: Array | None

    @property
    def orientation(self) -> bool:
        """Whether it is a unit quaternion."""
        return self.quantity.rpartition(".")[2] == ORIENTATION and self.value.size == 4

    @property
    def angle(self) -> bool:
        """Whether it is the angle of a joint."""
        return self.quantity.rpartition(".")[2] == "angle"


@dataclass(frozen=True, eq=False)
class Piece:
    """The rows of one recording: its name, by what else it is known, and where they are."""

    name: str
    aliases: tuple[str, ...]
    columns: RecordedColumns
    first: int
    last: int


class RecordedRows:
    """The rows of the recordings of one table; a RecordingFault ends the reading."""

    def __init__(self, table: RecordingTable, finder: FileFinder, folder: Path) -> None:
        """``folder``: in which files are looked for."""
        self.table, self.finder, self.folder = table, finder, folder

    def end(self) -> float:
        """[s] the last time of all recordings, on the clock of the simulation."""
        self._check_keys()
        times = {name for name in (time_column(self.table), self.table.split) if name is not None}
        every = self._pieces(times | {name for each in self.table.measured for name in each.columns})
        return max(float(read_times(each.columns, each.first, each.last, self.table, 1.0)[0][-1]) for each in every)

    def _check_keys(self) -> None:
        """Keys that exclude each other."""
        table = self.table
        if (table.files is None) == (table.table is None):
            raise RecordingFault("files", "give either files (CSV or NPZ files) or table (columns of numbers)")
        if table.rate is not None and table.time is not None:
            raise RecordingFault("rate", "stands instead of time; leave one of them out")
        if table.rows is not None and table.split is not None:
            raise RecordingFault("split", "stands instead of rows; leave one of them out")
        if table.rows is not None and table.table is not None:
            raise RecordingFault("rows", "is for NPZ files; give split, or a [[recording]] for each table")

    def _pieces(self, wanted: set[str]) -> Iterator[Piece]:
        """The rows of every recording."""
        table = self.table
        files = [""] if table.table is not None else self.finder.names(table.files or [], self.folder)
        stems = [PurePosixPath(file).stem for file in files]
        times = Counter(stems)
        for file, stem in zip(files, stems, strict=True):
            columns, starts = self._columns(file, wanted)
            self._check_columns(columns)
            parts = pieces(columns, starts, table.split)
            own = [] if len(files) == 1 else [stem if times[stem] == 1 else file]
            for k, (first, last) in enumerate(parts):
                numbered = [] if table.rows is None and table.split is None else [f"{k:04d}"]
                name = "/".join([table.name, *own, *numbered])
                aliases = (file, stem, *(numbered if not own else ()))
                yield Piece(name, aliases, columns, first, last)

    def _check_columns(self, columns: RecordedColumns) -> None:
        """Check that every named column exists."""
        name = time_column(self.table)
        if name is not None and name not in columns.names and self.table.time is None:
            text = f'{columns.label} has no column "{name}"; name it with time = "...", or give rate [Hz]'
            raise RecordingFault("time", f"{text}; the columns are {', '.join(columns.names[:30])}")
        columns.require([name] if name is not None else [], "time")
        columns.require([self.table.split] if self.table.split is not None else [], "split")
        for k, each in enumerate(self.table.measured):
            columns.require(each.columns, ("measured", k, "columns"))
        for input_name, each_input in self.table.input_tables.items():
            columns.require(each_input.columns, ("inputs", input_name))

    def _columns(self, name: str, wanted: set[str]) -> tuple[RecordedColumns, Array | None]:
        """Columns and first rows of a file, or of the table."""
        if self.table.table is not None:
            return table_columns(self.table.table), None
        arrays = PurePosixPath(name).suffix.lower() in ARRAYS
        if self.table.rows is not None and not arrays:
            raise RecordingFault("rows", f"is for NPZ files, and {name} is none; use split")
        with self.finder.open(name, self.folder) as stream:
            return read_npz(stream, name, wanted, self.table.rows) if arrays else (read_csv(stream, name, wanted), None)


class RecordingReader(RecordedRows):
    """Reads one table; a RecordingFault ends that."""

    def __init__(
        self,
        table: RecordingTable,
        world: RecordedWorld,
        finder: FileFinder,
        folder: Path,
        frame: MeasurementFrame | None,
    ) -> None:
        """``folder``: in which files are looked for; ``frame``: of the measurement system."""
        super().__init__(table, finder, folder)
        self.world, self.frame = world, frame

    def read(self) -> list[Recording]:
        """Read all recordings of the table."""
        self._check_keys()
        measured = [self._measured(k, each) for k, each in enumerate(self.table.measured)]
        start = read_start_columns(self.table, self.world.sample, self.world.units, self.world.starts)
        inputs = read_input_columns(self.table, self.world.inputs, self.world.units)
        found, known = list[Recording](), list[tuple[str, ...]]()
        used = [*self.table.measured, *(each.table for each in start), *(each.table for each in inputs)]
        for piece in self._pieces(self._wanted(used)):
            found.append(self._recording(piece, measured, start, inputs))
            known.append((piece.name, *piece.aliases))
        check_ends(found, self.world.duration, self.world.dt)
        held = held_back(self.table.held_back, known)
        for k, each in enumerate(measured):
            if all(np.isnan(recording.measured[k].values).all() for recording in found):
                text = f"no recording has a number of {each.formula.text}"
                raise RecordingFault(("measured", k, "columns"), text)
        return [replace(each, held_back=back) for each, back in zip(found, held, strict=True)]

    def _measured(self, k: int, table: MeasuredTable) -> MeasuredColumns:
        """The formula of one quantity, tried on the start."""
        key = ("measured", k)
        try:
            formula = parse(table.value)
            value = np.array(formula.evaluate(self.world.sample), float).ravel()
        except FormulaError as error:
            raise RecordingFault((*key, "value"), str(error)) from None
        text = "".join(table.value.split())
        quantity = text if formula.names == {text} else ""
        unit = unit_of(formula, self.world.units)
        check_table(table, unit, quantity or table.value, key)
        fields = {name.rpartition(".")[2] for name in formula.names}
        if self.frame is not None and not quantity and fields & {PLACED, ORIENTATION, *TURNED}:
            text = "a frame turns whole quantities; measure all components, with nan for those that are missing"
            raise RecordingFault((*key, "value"), text)
        found = MeasuredColumns(table, formula, quantity, value, unit, None)
        residuals = 3 if found.orientation else value.size
        if table.noise is None:
            return found
        if len(table.noise) not in (1, residuals):
            wanted = f"a number or {residuals} numbers" if residuals > 1 else "a number"
            raise RecordingFault((*key, "noise"), f"must be {wanted}, not a list of {len(table.noise)}")
        if not MIN_NOISE <= min(table.noise) <= max(table.noise) <= MAX_MEASUREMENT:
            raise RecordingFault(
                (*key, "noise"), f"must be from {MIN_NOISE:g} to {MAX_MEASUREMENT:g}, not {table.noise}"
            )
        noise = np.broadcast_to(np.array(table.noise), residuals).copy()
        return MeasuredColumns(table, formula, quantity, value, unit, noise)

    def _wanted(self, tables: Sequence[ColumnsTable]) -> set[str]:
        """The names of all columns that are used."""
        single = {name for name in (time_column(self.table), self.table.split) if name is not None}
        return single | {name for table in tables for name in table.columns}

    def _recording(
        self,
        piece: Piece,
        measured: Sequence[MeasuredColumns],
        start: Sequence[StartColumns],
        inputs: Sequence[InputColumns],
    ) -> Recording:
        """Read one recording, in the units of the engine."""
        columns, first, last = piece.columns, piece.first, piece.last
        time, cut = read_times(columns, first, last, self.table, self.world.duration)
        rows = columns.part(first, last)
        found = [self._values(k, each, rows, time, len(time)) for k, each in enumerate(measured)]
        given = {each.quantity: each.first_row(rows, self.frame) for each in start}
        return Recording(
            name=piece.name,
            source=f"{columns.label}, rows {first + columns.first} to {last - 1 - cut + columns.first}",
            time=time,
            measured=tuple(found),
            start=self.world.starts.complete(given) if given else {},
            coordinates=self.world.starts.coordinates(given),
            inputs={each.name: each.over_time(rows, time, self.frame) for each in inputs},
            weight=self.table.weight,
        )

    def _values(self, k: int, each: MeasuredColumns, rows: RecordedColumns, time: Array, count: int) -> Measured:
        """The samples of one quantity."""
        key, table = ("measured", k, "columns"), each.table
        values = convert(rows, table.columns, table, each.quantity, each.value.size, self.frame, key)[:count]
        if each.unit == LENGTH:
            given = {name for name in each.formula.names if name in self.world.moved}
            begins = None if given or self.table.start or not np.isfinite(each.value).all() else each.value
            check_lengths(values, begins, time, self.world.length, rows.where(0), key)
        values.setflags(write=False)
        name = table.name or " ".join(each.formula.text.split())
        return Measured(name, each.formula, tuple(table.columns), values, each.noise, each.orientation, each.angle)


def table_columns(table: Mapping[str, Sequence[Any]]) -> RecordedColumns:
    """The columns of a table in the problem file."""
    found = {name: np.array(values, float) for name, values in table.items()}
    counts = {name: len(values) for name, values in found.items()}
    if len(set(counts.values())) > 1:
        sizes = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise RecordingFault("table", f"all columns need as many numbers; there are: {sizes}")
    return RecordedColumns("table", found, tuple(found), 0, from_zero=True)


def read_recordings(
    tables: Sequence[RecordingTable],
    world: RecordedWorld,
    finder: FileFinder,
    frames: Sequence[MeasurementFrame | None],
    faults: Faults,
) -> tuple[Recording, ...]:
    """The recordings of all tables; ``frames`` of their measurement systems. Notes what is wrong with each table."""
    found = list[Recording]()
    for index, (table, frame) in enumerate(zip(tables, frames, strict=True)):
        folder = Path(faults.origin(("recording", index)).file).parent
        try:
            found += RecordingReader(table, world, finder, folder, frame).read()
        except RecordingFault as fault:
            faults.add(("recording", index, *fault.key), str(fault))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Identified:
    """The recordings and settings of identification.

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
    if steps > MAX_STEPS:
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
    """Check that nothing refers to recordings where there are none."""
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
