"""The [[sensor]] tables: formulas, each tried once on the start of the guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from symphys.expression import Formula, FormulaError, parse
from symphys.problem.feedback import Sensor
from symphys.problem.reading.faults import Faults
from symphys.problem.schema.control import SensorTable


def read_sensors(tables: Sequence[SensorTable], sample: Mapping[str, Any], faults: Faults) -> tuple[Sensor, ...]:
    """Every sensor; ``sample`` has a value for each name that a sensor may read."""
    return tuple(_read(index, table, sample, faults) for index, table in enumerate(tables))


def _read(index: int, table: SensorTable, sample: Mapping[str, Any], faults: Faults) -> Sensor:
    formulas: list[Formula] = []
    size = 0
    for text in table.reads:
        try:
            formula = parse(text)
            value = ca.DM(formula.evaluate(sample))
        except FormulaError as error:
            faults.add(("sensor", index, "reads"), str(error))
            continue
        if not value.is_regular():
            faults.add(("sensor", index, "reads"), f"{text} is not a finite number at the start of the guess")
        formulas.append(formula)
        size += int(value.shape[0])
    return Sensor(table.name, tuple(formulas), size)
