"""Names that packages import when they are first used: type checkers and Python find the same."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from tools.repeats import few

ROOT = Path(__file__).parents[2]
PACKAGES = {
    ".".join(path.parent.relative_to(ROOT).parts): path
    for path in sorted((ROOT / "symphys").rglob("__init__.py"))
    if "__getattr__ = later(" in path.read_text(encoding="utf-8")
}


def told(path: Path) -> dict[str, str]:
    """What type checkers are told: for each name the module that has it."""
    return {
        alias.name: str(node.module)
        for block in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(block, ast.If)
        for node in ast.walk(block)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def test_there_are_some() -> None:
    assert {"symphys.codegen", "symphys.problem", "symphys.transcription"} <= PACKAGES.keys()


@few("name", PACKAGES, 2)
def test_names_are_those_of_their_modules(name: str) -> None:
    """In a process that has imported nothing else, where every name is still to come."""
    names = told(PACKAGES[name])
    assert names
    code = (
        f"import {name} as package; from importlib import import_module\n"
        f"for name, module in {names}.items():\n"
        "    assert getattr(package, name) is getattr(import_module(module), name), name"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", PACKAGES)
def test_other_names_are_an_error(name: str) -> None:
    package = import_module(name)
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        package.nothing  # noqa: B018
    assert all(hasattr(package, each) for each in package.__all__)
