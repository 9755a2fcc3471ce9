"""Recordings that say little, or nothing, give a result or a message, and no number that is not one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from data.recorded import BALL, HEIGHT, TABLE
from tools.repeats import few

import symphys
from symphys.results.identification import Identification, summary

NAN = float("nan")


def found(table: dict[str, Any], **others: Any) -> Identification:
    recording = {"name": "drop", "table": table, "measured": [HEIGHT], **others}
    throw = {"name": "throw", "sets": "ball.velocity[2]"}
    made = symphys.identify({**BALL, "variable": [throw], "recording": [recording]}, threads=1)
    assert np.isfinite([each.value for each in made.parameters]).all() and np.isfinite(made.merit)
    assert summary(made)
    return made


@pytest.mark.slow
@few(
    "table",
    [
        {"time": [0.0, 0.1], "z": [1.0, 0.95]},
        {"time": [0.0, 0.1, 0.2], "z": [NAN, 0.95, NAN]},
        {"time": [0.0, 0.1, 0.2], "z": [0.0, 0.0, 0.0]},
        {"time": [0.0, 1e-9, 2e-9], "z": [1.0, 1.0, 1.0]},
        {"time": [0.0, 1e-300], "z": [1.0, 1.0]},
    ],
    1,
)
def test_two_rows_one_number_zeros_and_an_instant(table: dict[str, Any]) -> None:
    found(table)


def test_exact_recordings_of_unknown_noise_are_met_exactly() -> None:
    """The estimate of the noise has a floor: it is no 0 by which residuals are divided."""
    time = np.arange(0.0, 0.3, 0.01)
    motion = symphys.simulate({**BALL, "variable": []})
    exact = found({"time": time.tolist(), "z": motion["ball.position"][: len(time), 2].tolist()})
    assert exact.status == "converged" and abs(exact["throw"].value) < 1e-9
    assert exact.quantities[0].noise > 0


def test_nothing_to_fit_to_is_said() -> None:
    with pytest.raises(symphys.SymphysError, match="ball"):
        found({"time": [0.0, 0.1], "z": [NAN, NAN]})
    with pytest.raises(symphys.SymphysError, match="held back"):
        found(TABLE, held_back=True)
