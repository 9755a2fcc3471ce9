"""Kinds of sensors: each is declared once, and what documents, units and recordings say follows from that."""

from __future__ import annotations

from pathlib import Path

import pytest

from symphys.dynamics.observation import SENSOR_KINDS, SensorKind
from symphys.problem.recordings.conversion import TURNED

FORMULAS = Path(__file__).parents[3] / "docs" / "formulas.md"


def row(kind: SensorKind) -> str:
    """The line that a kind has in docs/formulas.md."""
    owner = {"body": "torso", "joint": "rail" if kind.key == "position" else "knee", "site": "tip"}[kind.owner]
    unit = f"{kind.unit}, or {kind.sliding_unit}" if kind.sliding_unit is not None else kind.unit or "-"
    return f"| `{owner}.{kind.key}` | {kind.size or 'k'} | {unit} | {kind.about} |\n"


@pytest.mark.parametrize("kind", SENSOR_KINDS, ids=lambda kind: f"{kind.owner}.{kind.key}")
def test_the_document_has_every_kind(kind: SensorKind) -> None:
    assert row(kind) in FORMULAS.read_text(encoding="utf-8"), "put this in:\n" + row(kind)


def test_names_are_unique_and_frames_turn_what_is_in_world_axes() -> None:
    """A frame of a measurement system turns vectors by the last part of their names, so that one part has one frame."""
    names = [(kind.owner, kind.key) for kind in SENSOR_KINDS]
    assert len(set(names)) == len(names)
    own = {kind.key for kind in SENSOR_KINDS if kind.axes == "own"}
    assert "gyro" in own and not own & TURNED
    assert {"velocity", "angular_velocity", "contact_force", "force", "torque"} <= TURNED
