"""A quick problem, and a command line to run it with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tools.waiting import FOREVER

from symphys.cli import main
from symphys.report.pages.run import PAGE

THROW = """
title = "A short throw"
[simulation]
duration = 0.2
dt = 0.02
[[body]]
name = "ball"
shape = {{ sphere = {{ radius = 0.1 }} }}
mass = 1.0
position = [0, 0, 1]
[ground]
[[variable]]
name = "throw"
sets = "ball.velocity[0:2]"
guess = [1, 0]
upper = {upper}
[[target]]
name = "is at half a metre"
value = "ball.position[0:2] - [0.5, 0]"
tolerance = 0.01
"""
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def _without_lines_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines that come every few seconds have tests of their own; a slow machine puts them between any others."""
    monkeypatch.setattr("symphys.cli.watching.observers.monotonic", lambda: 0.0)
    monkeypatch.setattr("symphys.cli.watching.heartbeat.LINE_INTERVAL", FOREVER)
    monkeypatch.setattr("symphys.cli.runs.QUIET_TIME", FOREVER)


@pytest.fixture
def throw(tmp_path: Path) -> Path:
    path = tmp_path / "throw.toml"
    path.write_text(THROW.format(upper=10), encoding="utf-8")
    return path


@pytest.fixture
def unreachable(tmp_path: Path) -> Path:
    path = tmp_path / "unreachable.toml"
    path.write_text(THROW.format(upper=1.5), encoding="utf-8")
    return path


@pytest.fixture
def whole_report() -> None:
    """Asks for the pages of runs."""


@pytest.fixture(autouse=True)
def _without_pages_of_runs(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which have tests of their own, and take longer than the solves of this room."""
    if "whole_report" not in request.fixturenames:
        monkeypatch.setattr(
            "symphys.report.making.run_pages.write_run_report", lambda folder: (folder / PAGE).write_text("")
        )


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a command line in an empty folder: (exit code, stdout, stderr)."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")

    def call(*arguments: object) -> tuple[int, str, str]:
        code = main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        assert "Traceback" not in printed.out + printed.err
        return code, printed.out, printed.err

    return call
