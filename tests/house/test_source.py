"""Surface and hygiene of the source."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
from pathlib import Path

import pytest

import symphys

ROOT = Path(__file__).parents[2]
TEXTS = {".py", ".c", ".h", ".toml", ".cfg", ".md", ".css", ".js", ".html", ".json", ".txt", ".svg", ""}
SKIPPED = {".git", ".venv", "build", "dist", "reports", "__pycache__"}
MOST_NAMES = 40
MACHINE_PATH = re.compile(r"(?<![\w.<$/])/(?:home|root|work|tmp|Users|mnt)/\w")


def project_files() -> list[Path]:
    """The files that git knows or would add; without git, all that are not made by tools."""
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listing.returncode == 0:
        return [path for name in listing.stdout.split("\0") if name and (path := ROOT / name).is_file()]
    return [p for p in ROOT.rglob("*") if p.is_file() and not SKIPPED & set(p.relative_to(ROOT).parts)]


def source_files() -> list[Path]:
    return [path for path in project_files() if path.suffix == ".py"]


def test_public_surface_is_small_and_real() -> None:
    assert len(symphys.__all__) <= MOST_NAMES
    assert len(set(symphys.__all__)) == len(symphys.__all__)
    assert [name for name in symphys.__all__ if getattr(symphys, name, None) is None] == []


@pytest.mark.parametrize(
    "package",
    ["symphys.solvers", "symphys.problem", "symphys.report", "symphys.runs", "symphys.export", "symphys.codegen"],
)
def test_exported_names_exist(package: str) -> None:
    module = importlib.import_module(package)
    assert [name for name in module.__all__ if not hasattr(module, name)] == []


def test_data_classes_are_quick_to_define() -> None:
    """Those of the standard library cost a command half a millisecond each."""
    ours = [path for path in source_files() if path.relative_to(ROOT).parts[0] in ("symphys", "solvers")]
    slow = re.compile(r"^(from dataclasses import .*\bdataclass\b|@dataclasses\.dataclass)", re.MULTILINE)
    found = [str(path.relative_to(ROOT)) for path in ours if slow.search(path.read_text(encoding="utf-8"))]
    assert set(found) <= {"symphys/records.py"}


def test_no_machine_paths() -> None:
    found = []
    for path in project_files():
        if path.suffix in TEXTS:
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
            found += [f"{path.relative_to(ROOT)}:{i}" for i, line in enumerate(lines, 1) if MACHINE_PATH.search(line)]
    assert found == []


def test_no_forbidden_calls() -> None:
    """Nothing that comes from a file is run by Python."""
    found = []
    for path in source_files():
        if "tests" in path.relative_to(ROOT).parts:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in {"eval", "exec"}:
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
            if isinstance(node, ast.Import) and any(alias.name == "pickle" for alias in node.names):
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert found == []
