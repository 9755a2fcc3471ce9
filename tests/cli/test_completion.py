"""The shell completes the names of problems, robots, solvers and backends, as click asks for them."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.shell_completion import BashComplete

from symphys.cli.app import app


def completed(*arguments: str) -> list[str]:
    """What may stand for the last argument, after the others."""
    shell = BashComplete(app, {}, "symphys", "_SYMPHYS_COMPLETE")
    return [item.value for item in shell.get_completions(list(arguments[:-1]), arguments[-1])]


@pytest.mark.parametrize("command", ["solve", "check", "show", "export"])
def test_problems_complete(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shipped ones, robots, and files of one's own; any path where nothing begins so."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "balloon.toml").touch()
    (tmp_path / "ballast").mkdir()
    (tmp_path / "balls.txt").touch()
    assert completed(command, "ball") == ["ball_throw", "ballast/", "balloon.toml"]
    assert completed(command, "robots/ar") == ["robots/arm.toml"]
    (tmp_path / "ballast" / "mine.toml").touch()
    assert completed(command, "ballast/m") == ["ballast/mine.toml"]
    assert completed(command, "zzz") == ["zzz"]


def test_solvers_and_backends_complete() -> None:
    assert completed("solve", "--solver", "gradient,l") == ["gradient,least_squares"]
    assert completed("solve", "--backend", "simd") == ["simd", "simd32"]
    assert completed("new", "--from", "ho") == ["hopper_gait", "hopper_jump", "hopper_run"]
