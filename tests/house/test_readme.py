"""What the README and the page on Python show works as it stands there."""

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

ROOT = Path(__file__).parents[2]


def text(document: str) -> str:
    """What is in a document."""
    return (ROOT / document).read_text(encoding="utf-8")


def blocks(language: str, document: str = "README.md") -> list[str]:
    """The code blocks of a language, in their order."""
    return re.findall(rf"^```{language}\n(.*?)^```", text(document), flags=re.DOTALL | re.MULTILINE)


def printed(code: str, folder: Path) -> list[str]:
    """The lines that a program prints when it runs in a folder of its own."""
    done = subprocess.run(
        [sys.executable, "-W", "error:symphys:DeprecationWarning", "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
    )
    return done.stdout.strip().splitlines()


@pytest.mark.slow
def test_the_problem_of_your_own_is_solved(tmp_path: Path) -> None:
    path = tmp_path / "croquet.toml"
    (croquet,) = blocks("toml")
    assert croquet == blocks("toml", "docs/first_problem.md")[0]
    path.write_text(croquet, encoding="utf-8")
    assert main(["check", str(path)]) == 0
    solvers = ["--solver", "gradient,least_squares", "--unexamined"]
    assert main(["solve", str(path), *solvers, "--out", str(tmp_path / "reports")]) == 0


@pytest.mark.slow
def test_the_front_door_opens(tmp_path: Path) -> None:
    """Solved; another mass and friction need another throw; values and gradients of 128 throws."""
    first, second, third = printed(blocks("python")[0], tmp_path)
    assert first.startswith("True [12.09") and first.endswith("0.5       ]")
    assert second != first[5 : 5 + len(second)]
    assert third == "(128,) (128, 6)"
    assert list(tmp_path.iterdir()) == []


def test_the_casadi_example_runs(tmp_path: Path) -> None:
    lines = printed(blocks("python", "docs/python.md")[-1], tmp_path)
    throw = [float(number) for number in lines[-1].strip("[]").split()]
    assert 1.9 < throw[0] < 2.2
    assert any("Optimal Solution Found" in line for line in lines)


def test_every_command_solver_and_function_is_named() -> None:
    commands, formulas = text("docs/command_line.md"), text("docs/formulas.md")
    assert [name for name in app.commands if f"symphys {name}" not in commands] == []
    assert [name for name in FUNCTIONS if not re.search(rf"\b{name}\(", formulas)] == []
    for document in ("README.md", "docs/solvers.md"):
        assert [name for name in SOLVERS if f"| `{name}` |" not in text(document)] == []
