"""What the README shows works as it stands there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from symphys.cli import main
from symphys.cli.app import app
from symphys.expression import FUNCTIONS
from symphys.solvers import SOLVERS

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    """The one code block of a language."""
    (text,) = re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)
    return str(text)


@pytest.mark.slow
def test_the_problem_of_your_own_is_solved(tmp_path: Path) -> None:
    path = tmp_path / "croquet.toml"
    path.write_text(block("toml"), encoding="utf-8")
    assert main(["check", str(path)]) == 0
    assert main(["solve", str(path), "--solver", "least_squares", "--out", str(tmp_path / "reports")]) == 0


def test_the_casadi_example_runs(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", block("python")], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    throw = [float(number) for number in done.stdout.strip().splitlines()[-1].strip("[]").split()]
    assert 1.9 < throw[0] < 2.2
    assert "Optimal Solution Found" in done.stdout


def test_every_command_solver_and_function_is_named() -> None:
    assert [name for name in app.commands if f"symphys {name}" not in README] == []
    assert [name for name in SOLVERS if f"`{name}`" not in README] == []
    assert [name for name in FUNCTIONS if not re.search(rf"\b{name}\b", README)] == []
