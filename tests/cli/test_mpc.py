"""``symphys mpc`` runs a closed loop, writes its folder, and says what it did."""

from __future__ import annotations

from pathlib import Path

import pytest
from worlds.swung import pendulum

from symphys.cli.app import main


@pytest.mark.slow
def test_it_controls_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "pendulum.toml"
    file.write_text(pendulum(plant={"latency": 0.0, "dt": 0.01}).to_toml(), encoding="utf-8")
    assert main(["mpc", str(file), "--set", "mpc.plant.masses=1.1", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "100.0 % of the ticks" in said and "upright: " in said
    (page,) = (tmp_path / "out").rglob("report.html")
    assert page.parent.name == "mpc" and (page.parent / "mpc.json").is_file()


def test_a_problem_without_the_table_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mpc", "ball_throw"]) == 2
    assert "there is no such table; write [mpc]" in capsys.readouterr().err
