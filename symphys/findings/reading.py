"""The object "trust" of a result, as ``symphys.verification.examination`` makes it, read with care."""

from __future__ import annotations

from dataclasses import fields

from symphys.findings import values
from symphys.findings.examination import Energy, Gain, GradientCheck, Growth, Miss, Refined, Slide, Smoothed, Trust
from symphys.findings.values import Array

PLAIN = (
    *("gained", "drift", "unexplained", "drift_at", "drifted", "momentum"),
    *("residual", "residual_at", "residual_finer", "impulse"),
    *("deepest", "size", "passed", "multiple_impacts", "ambiguous_impacts", "paradoxes", "steps"),
)
"""Fields that are one number."""


def make_trust(entry: dict[str, object]) -> Trust:
    """The record; what is absent or no number becomes nan."""
    number, place, passed = values.number, values.table(entry.get("deepest_at")), values.table(entry.get("passed_at"))
    gradient = values.tables(entry.get("gradient"))
    return Trust(
        gradient=tuple(
            GradientCheck(
                values.name(row.get("variable")),
                number(row.get("error")),
                number(row.get("scale")),
                number(row.get("jump", 0.0)),
                number(row.get("felt")),
            )
            for row in gradient
        ),
        step=number(gradient[0].get("step")) if gradient else number(None),
        refined=tuple(make_refined(row) for row in values.tables(entry.get("refined"))),
        order=values.measures(entry.get("order")),
        smoothed=tuple(make_smoothed(row) for row in values.tables(entry.get("smoothed"))),
        growth=Growth(**columns(Growth, entry.get("growth"))),
        energy=Energy(**columns(Energy, entry.get("energy"))),
        gains=tuple(make_gain(row) for row in values.tables(entry.get("gains"))),
        depth_contact=values.name(place.get("contact")),
        depth_time=number(place.get("time")),
        passed_contact=values.name(passed.get("contact")),
        passed_time=number(passed.get("time")),
        passed_depth=number(passed.get("depth")),
        slides=tuple(make_slide(row) for row in values.tables(entry.get("slides"))),
        misses=tuple(make_miss(row) for row in values.tables(entry.get("misses"))),
        fault=values.name(entry.get("fault")),
        **{name: number(entry.get(name)) for name in PLAIN},
    )


def make_refined(row: dict[str, object]) -> Refined:
    """One of ``refined``."""
    what, (objective, worst) = values.name(row.get("what")), measured(row)
    return Refined(what, objective, worst, values.measures(row.get("gradient")))


def make_smoothed(row: dict[str, object]) -> Smoothed:
    """One of ``smoothed``."""
    costs, moved = values.number(row.get("costs")), values.number(row.get("moved"))
    return Smoothed(values.number(row.get("smoothing")), row.get("own") is True, *measured(row), costs, moved)


def measured(row: dict[str, object]) -> tuple[float, float]:
    """Objective and worst error / tolerance."""
    return values.number(row.get("objective")), values.number(row.get("worst"))


def make_gain(row: dict[str, object]) -> Gain:
    """One of ``gains``."""
    time, energy = values.number(row.get("time")), values.number(row.get("energy"))
    return Gain(values.whole(row.get("step")), time, energy, values.names(row.get("contacts")))


def make_miss(row: dict[str, object]) -> Miss:
    """One of ``misses``."""
    time, gap, change, steps, spreads = (
        values.number(row.get(key)) for key in ("time", "gap", "change", "steps", "spreads")
    )
    contact, variable = values.name(row.get("contact")), values.name(row.get("variable"))
    return Miss(contact, row.get("touches") is True, time, gap, variable, change, steps, spreads)


def make_slide(row: dict[str, object]) -> Slide:
    """One of ``slides``."""
    distance, speed, time = (values.number(row.get(key)) for key in ("distance", "speed", "time"))
    return Slide(values.name(row.get("contact")), distance, speed, time)


def columns(record: type[Growth] | type[Energy], entry: object) -> dict[str, Array]:
    """The lists of a table by the record's fields; all empty unless they have one length."""
    read = {each.name: values.numbers(values.table(entry).get(each.name)) for each in fields(record)}
    return read if len({column.size for column in read.values()}) == 1 else {}
