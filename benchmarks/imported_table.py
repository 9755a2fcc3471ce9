"""The table of imported robots, as docs/results/imported_robots.md has it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

Row = Mapping[str, Any]
HEAD = (
    "model",
    "bodies",
    "dof",
    "motors",
    "contacts",
    "left out",
    "mass matrix",
    "error at 2 ms [m]",
    "order",
    "import [s]",
    "compile [CPU s]",
    "dt [ms]",
    "1000 steps/s, one",
    "of 128",
    "times MuJoCo, one",
    "of 128",
    "1 s on the ground",
)


def table(rows: Iterable[Row]) -> str:
    """Markdown, a line for each model."""
    lines = [HEAD, ("---",) * len(HEAD), *(cells(row) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def cells(row: Row) -> tuple[str, ...]:
    """Of one line; what was not measured is a dash."""
    return (
        row["name"],
        *(number(row, key, "d") for key in ("bodies", "dof", "motors")),
        number(row, "contacts", "d") + ("" if row.get("self_collision", True) else "*"),
        str(len(row["left_out"])) if "left_out" in row else "-",
        number(row, "matrix", ".0e"),
        error_at(row, 0.002),
        number(row, "order", ".2f"),
        number(row, "imported", ".1f"),
        number(row, "compiled_work", ".0f"),
        number(row, "dt", ".3g", 1e3),
        number(row, "alone", ".3g", 1e-3),
        number(row, "batch", ".3g", 1e-3),
        number(row, "times_alone", ".2g"),
        number(row, "times_batch", ".2g"),
        on_the_ground(row),
    )


def number(row: Row, key: str, form: str, factor: float = 1) -> str:
    """A number of a row."""
    if row.get(key) is None:
        return "-"
    value = row[key] * factor if factor != 1 else row[key]
    return f"{value:,.0f}" if abs(value) >= 1000 and form.endswith("g") else format(value, form)


def error_at(row: Row, step: float) -> str:
    """Of free motion at one step; its smallest one in brackets if that is another."""
    if "errors" not in row:
        return "-"
    return format(row["errors"][row["steps"].index(step)], ".1e")


def on_the_ground(row: Row) -> str:
    """How the second on the ground went, or what failed."""
    if "fault" in row:
        return f"fails: {row['fault'][-60:]}"
    failed = row.get("failed", {})
    if "fall" in failed:
        return f"fails: {failed['fall'][:60]}"
    if "finite" not in row:
        return "-"
    return f"at most {row['fastest']:.1f} m/s" if row["finite"] else "not finite"
