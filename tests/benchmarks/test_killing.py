"""A batch whose processes are killed at random loses nothing, does nothing twice; ``make stress`` does more of it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from killing import main
from worlds.toys import require

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds processes by /proc")


@pytest.mark.slow
def test_a_batch_whose_processes_are_killed_is_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each time as soon as a run has begun."""
    require("simd")
    asked = {"runs": 8, "kills": 3, "drivers": 2, "evaluations": 400, "step": 0.001, "pause": 0, "folder": tmp_path}
    code = main([f"--{name}={value}" for name, value in asked.items()])
    out = capsys.readouterr().out
    assert code == 0, out
    assert "8 of 8 results" in out and "3 kills while runs were left" in out
