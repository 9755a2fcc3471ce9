"""``symphys identify``: exit codes, and what the terminal says."""

from __future__ import annotations

from pathlib import Path

import pytest
from identify import BOUNCES, recorded
from worlds.toys import require

from symphys.cli.app import main


@pytest.mark.slow
def test_a_fit_whose_spins_are_not_determined_has_converged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 0: nothing is doubted, and what is vague is named."""
    require("simd")
    file = tmp_path / "throws.toml"
    file.write_text(recorded(BOUNCES, 0).text, encoding="utf-8")
    code = main(["identify", str(file), "--threads", "1", "--out", str(tmp_path / "runs")])
    text = capsys.readouterr().out
    assert code == 0, text
    assert "converged: " in text and "excluding spun of 2 recordings, which the recordings do not determine" in text
    assert "doubt" not in text


@pytest.mark.slow
def test_a_fit_of_a_wrong_model_is_doubted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 1: gravity is another one."""
    require("simd")
    file = tmp_path / "moon.toml"
    file.write_text(recorded(BOUNCES, 0).text + "\n[world]\ngravity = [0, 0, -9]\n", encoding="utf-8")
    assert main(["identify", str(file), "--threads", "1", "--out", str(tmp_path / "runs")]) == 1
    assert "doubt: the model misses an effect on ball.position" in capsys.readouterr().out
