"""Actuators at sites as motors of [[site]] tables: rotors and thrusters."""

from __future__ import annotations

from typing import Any

import numpy as np

from symphys.importing.tables.joints import actuator_law
from symphys.importing.tables.reading import ModelReading, numbers
from symphys.importing.tables.sensors import read_sites, site_table


def read_sites_and_motors(reading: ModelReading) -> list[dict[str, Any]]:
    """Return the [[site]] tables, with one for each actuator at a site.

    Several actuators may act at one site: each is a site of its own in the same place, after that one, by its own
    name. One that is called as its site is belongs to that.
    """
    model, data, tables = reading.model, reading.data, [[table] for table in read_sites(reading)]
    for actuator in np.flatnonzero(np.array(model.actuator_trntype) == int(reading.library.mjtTrn.mjTRN_SITE)):
        motor, site = site_motor(reading, int(actuator)), int(model.actuator_trnid[actuator][0])
        if motor is None:
            continue
        own, given = reading.name("site", site), reading.name("actuator", int(actuator))
        if given and given == own and "motor" not in tables[site][0]:
            tables[site][0]["motor"] = motor
            continue
        name, body = reading.names.give("actuator", given or own, "motor"), int(model.site_bodyid[site])
        table = site_table(reading, name, body, data.site_xpos[site], data.site_xmat[site])
        tables[site].append({**table, "motor": motor})
    return [table for several in tables for table in several]


def site_motor(reading: ModelReading, actuator: int) -> dict[str, Any] | None:
    """Return the motor of a site that an actuator is; None, with a note, if it is none."""
    model, what = reading.model, reading.called("actuator", actuator)
    site, other = (int(each) for each in model.actuator_trnid[actuator])
    law, why = actuator_law(reading, actuator), ""
    if reading.off("ACTUATION"):
        why = "the model's options switch actuators off"
    elif other >= 0:
        why = "it acts along the axes of another site"
    elif reading.links.get(int(model.site_bodyid[site])) is None:
        why = "its site is on a body that cannot move"
    elif law is not None and (law.bias[0] or law.bias[2] or not law.gain * np.any(model.actuator_gear[actuator])):
        why = "what it gives is not in proportion to its command"
    if why:
        reading.note("left out", what, why)
    if why or law is None:
        return None
    ends = law.command_range
    if model.actuator_forcelimited[actuator]:
        held = sorted(float(end) / law.gain for end in model.actuator_forcerange[actuator])
        ends = [max(ends[0], held[0]), min(ends[1], held[1])]
        ends = [ends[0], max(ends)]
    gear = law.gain * np.array(model.actuator_gear[actuator], float)
    motor = {key: numbers(part) for key, part in (("force", gear[:3]), ("torque", gear[3:])) if part.any()}
    return motor | ({"command_range": ends} if np.isfinite(ends).any() else {})
