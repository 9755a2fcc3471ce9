"""The examples of the README work, and the lists of commands, functions and solvers on other pages are complete."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from symphys.cli.app import app
from symphys.expression import FUNCTIONS
from symphys.solvers import SOLVERS

ROOT = Path(__file__).parents[2]
MAX_LINES = 150
"""Lines of the README: a front page is read in one go."""


def text(document: str) -> str:
    """Return the text of a document."""
    return (ROOT / document).read_text(encoding="utf-8")


def blocks(language: str, document: str = "README.md") -> list[str]:
    """Return the code blocks of a language, in their order."""
    return re.findall(rf"^```{language}\n(.*?)^```", text(document), flags=re.DOTALL | re.MULTILINE)


def printed(code: str, folder: Path) -> list[str]:
    """Return the lines that a program prints when it runs in a folder of its own."""
    done = subprocess.run(
        [sys.executable, "-W", "error:symphys:DeprecationWarning", "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
    )
    return done.stdout.strip().splitlines()


def rounded(lines: str) -> str:
    """Return a text whose numbers have two digits, since processors differ in the last ones."""
    return re.sub(r"-?\d+\.?\d*(?:e-?\d+)?", lambda found: f"{float(found[0]):.1e}", lines)


def test_the_readme_fits_on_a_front_page() -> None:
    assert len(text("README.md").splitlines()) <= MAX_LINES


@pytest.mark.slow
def test_the_throw_has_the_answer_that_is_shown(tmp_path: Path) -> None:
    """The command of the README, on the file of the README; errors far below a tolerance are not compared."""
    (problem,), (answer,) = blocks("toml"), blocks("text")
    (command,) = [line for block in blocks("sh") for line in block.splitlines() if "throw.toml" in line]
    (tmp_path / "throw.toml").write_text(problem, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", *command.split()], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    for line in answer.splitlines():
        shown = re.sub(r"by \S+ of", "by", line)
        found = [re.sub(r"by \S+ of", "by", each) for each in done.stdout.splitlines()]
        assert rounded(shown) in map(rounded, found), done.stdout


@pytest.mark.slow
def test_the_python_example_runs(tmp_path: Path) -> None:
    """Both throws are solved, and less friction needs another throw."""
    first, second = printed(blocks("python")[0], tmp_path)
    assert first.startswith("True [12.09") and first.endswith("0.5       ]")
    assert second.startswith("True [") and second != first[: len(second)]
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
    assert [name for name in SOLVERS if f"| `{name}` |" not in text("docs/solvers.md")] == []
