"""mpc.json and mpc.npz of a run folder: one definition for writer and reader.

| file | holds |
|---|---|
| mpc.json | what was asked for, and how it went |
| mpc.npz | ticks, latencies, commands, and some plans |
| trajectory.npz, scene.json, problem.toml | the closed-loop motion of the plant, as of every run |
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from symphys import files
from symphys import json_values as values
from symphys.records import dataclass
from symphys.results.text_files import ReportError, read_archive, read_table
from symphys.types import Array

MPC, PLANS = "mpc.json", "mpc.npz"
FORMAT = 1
ARRAYS = (
    "asked",
    "latency",
    "work",
    "cost",
    "gained",
    "command_time",
    "command",
    "plan_time",
    "plan_value",
    "plan_command",
    "actual_time",
    "actual",
)


@dataclass(frozen=True)
class TargetRecord:
    """A target along the closed loop.

    Attributes:
        name: as in the file.
        error, tolerance: at the end of the closed loop.
        held: [s] for how long it was met without a break up to the end.
    """

    name: str
    error: float
    tolerance: float
    held: float

    @property
    def met(self) -> bool:
        """Whether the target holds at the end; NaN never does."""
        return self.error <= self.tolerance


@dataclass(frozen=True)
class ClosedLoopRecord:
    """The settings, latencies, commands and motion of a closed loop.

    Attributes:
        problem, title: names.
        rate: [Hz].
        horizon, dt, plant_dt, duration: [s] of plans, of the model's and of the plant's steps, and what was simulated.
        iterations: of a tick.
        feedback: whether commands between ticks answered what was measured.
        plant: differences of the plant, in words.
        latency_kind: the counted latency: "measured", "cpu" or seconds.
        ticks, in_time: how many there were, and how many plans were ready before the next tick.
        median, p99, worst: [s] of the latencies that counted.
        targets: at the end.
        evaluator: description of the evaluator.
        threads: of it.
        stopped: why it ended before its time; empty.
        command_names, value_names: of the columns below.
        asked, latency, work, cost, gained: (T,) ticks [s], wall and processor time of their plans [s], their costs,
            and whether their iterations lowered these.
        command_time, command: (K,) [s] and (K, m) what acted on the plant.
        plan_time: (P, N + 1) [s] of some plans.
        plan_value: (P, N + 1, q) what they predict.
        plan_command: (P, N, m) what they command.
        actual_time, actual: (K + 1,) [s] and (K + 1, q) what happened.
    """

    problem: str
    title: str
    rate: float
    horizon: float
    dt: float
    plant_dt: float
    duration: float
    iterations: int
    feedback: bool
    plant: str
    latency_kind: str
    ticks: int
    in_time: int
    median: float
    p99: float
    worst: float
    targets: tuple[TargetRecord, ...]
    evaluator: str
    threads: int
    stopped: str
    command_names: tuple[str, ...]
    value_names: tuple[str, ...]
    asked: Array = field(repr=False)
    latency: Array = field(repr=False)
    work: Array = field(repr=False)
    cost: Array = field(repr=False)
    gained: Array = field(repr=False)
    command_time: Array = field(repr=False)
    command: Array = field(repr=False)
    plan_time: Array = field(repr=False)
    plan_value: Array = field(repr=False)
    plan_command: Array = field(repr=False)
    actual_time: Array = field(repr=False)
    actual: Array = field(repr=False)

    @property
    def share(self) -> float:
        """Return the share of the ticks whose plan was ready before the next one."""
        return self.in_time / max(self.ticks, 1)

    @property
    def done(self) -> bool:
        """Whether the loop ran to its end and meets every target there."""
        return not self.stopped and all(target.met for target in self.targets)

    @property
    def held(self) -> float:
        """Return how long [s] up to the end all targets were met without a break."""
        return min((target.held for target in self.targets), default=0.0)

    @property
    def counted(self) -> Array:
        """Return (T,) [s] the latencies that counted."""
        if self.latency_kind == "measured":
            return self.latency
        return self.work if self.latency_kind == "cpu" else np.full(len(self.asked), float(self.latency_kind))

    def write(self, folder: Path) -> None:
        """Write both files; the table last, since nothing counts without it."""
        files.write_npz(folder / PLANS, {name: getattr(self, name) for name in ARRAYS})
        plain = {each.name: getattr(self, each.name) for each in fields(self) if each.name not in ARRAYS}
        plain["targets"] = [asdict(target) for target in self.targets]
        files.write_json(folder / MPC, {"format": FORMAT, **plain})


def read_closed_loop(folder: Path) -> ClosedLoopRecord:
    """Read the record of a folder.

    Raises:
        ReportError: a file is missing, or is none of this kind.
    """
    table = read_table(folder / MPC)
    if table.get("format") != FORMAT:
        raise ReportError(f"{MPC}: format {values.name(table.get('format')) or 'unknown'}, this report reads {FORMAT}")
    arrays = read_archive(folder / PLANS, ARRAYS)
    missing = [name for name in ARRAYS if name not in arrays]
    if missing:
        raise ReportError(f"{PLANS}: it lacks {', '.join(missing)}")
    try:
        return _record(table, arrays)
    except (KeyError, TypeError, ValueError) as error:
        raise ReportError(f"{MPC}: not the record of a closed loop ({values.name(str(error))})") from error


def _record(table: Mapping[str, Any], arrays: Mapping[str, Array]) -> ClosedLoopRecord:
    numbers = files.numbers(dict(table))
    found: dict[str, Any] = {
        each.name: numbers[each.name] for each in fields(ClosedLoopRecord) if each.name not in ARRAYS
    }
    found["targets"] = tuple(
        TargetRecord(values.name(each["name"]), *(float(each[key]) for key in ("error", "tolerance", "held")))
        for each in numbers["targets"]
    )
    for key in ("command_names", "value_names"):
        found[key] = values.names(found[key])
    found |= {name: np.asarray(arrays[name], float) for name in ARRAYS}
    return ClosedLoopRecord(**found)
