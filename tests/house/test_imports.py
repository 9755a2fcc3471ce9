"""Data flows one way, and so do imports."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PHYSICS = {"course", "shapes", "heightfield", "world", "state", "rotation", "smooth", "collide", "motion", "step"}
PHYSICS |= {"free_rotation", "rollout", "joints", "controllers"}
RUNTIME = set(sys.stdlib_module_names)


def modules() -> list[tuple[str, Path]]:
    """(name as installed, file) of every module."""
    found = []
    for top, prefix in (("symphys", ""), ("solvers", "symphys."), ("problems", "symphys.")):
        for path in sorted((ROOT / top).rglob("*.py")):
            name = prefix + ".".join(path.relative_to(ROOT).with_suffix("").parts)
            found.append((name.removesuffix(".__init__"), path))
    return found


def room(name: str) -> str:
    """The entry of symphys/ that a module belongs to: ``symphys.cli.app`` -> ``cli``; the package itself: ``""``."""
    return [*name.split("."), ""][1]


def imported(path: Path) -> Iterator[str]:
    """Every module that a file imports, wherever in the file; ``from symphys import x`` counts as symphys.x."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are absolute"
            if node.module == "symphys":
                yield from (f"symphys.{alias.name}" for alias in node.names)
            else:
                yield node.module or ""


def importers(wanted: str) -> set[str]:
    """The rooms that import a top-level package, or a room of symphys, other than their own."""
    found = set()
    for name, path in modules():
        for target in imported(path):
            hit = room(target) == wanted.removeprefix("symphys.") if "." in wanted else target.split(".")[0] == wanted
            if hit and target.startswith(wanted):
                found.add(room(name))
    return found - {wanted.removeprefix("symphys.")}


@pytest.mark.parametrize(
    ("wanted", "allowed"),
    [
        ("symphys.solvers", {"cli", "runs"}),
        ("symphys.backends", {"cli", "runs", "transcription"}),
        ("symphys.cli", {"__main__"}),
        ("symphys.runs", {"cli"}),
        ("symphys.report", {"cli"}),
        ("symphys.export", {"cli"}),
        ("symphys.findings", {"cli", "report", "runs"}),
        ("symphys.doctor", {"cli"}),
        ("symphys.problems", {"cli", "problem"}),
        ("matplotlib", {"report"}),
        ("pydantic", {"problem"}),
        ("click", {"cli"}),
        ("rich", {"cli"}),
        ("cma", {"solvers"}),
        ("cupy", {"cuda"}),
        ("cuda", {"cuda"}),
    ],
)
def test_only_these_rooms_import(wanted: str, allowed: set[str]) -> None:
    assert importers(wanted) <= allowed


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) in PHYSICS])
def test_physics_imports_casadi_and_numpy_alone(name: str, path: Path) -> None:
    for target in imported(path):
        top = target.split(".")[0]
        assert top in RUNTIME | {"casadi", "numpy", "symphys"}, target
        assert top != "symphys" or room(target) in PHYSICS | {"errors"}, target


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) == "kernel"])
def test_kernels_know_no_physics(name: str, path: Path) -> None:
    for target in imported(path):
        assert target.split(".")[0] in RUNTIME | {"casadi", "numpy", "symphys"}, target
        assert not target.startswith("symphys") or room(target) in {"kernel", "errors"}, target


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) == "cuda"])
def test_devices_see_kernels_alone(name: str, path: Path) -> None:
    for target in imported(path):
        assert target.split(".")[0] in RUNTIME | {"numpy", "cupy", "cuda", "symphys"}, target
        assert not target.startswith("symphys") or room(target) in {"cuda", "kernel"}, target


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) == "backends"])
def test_backends_see_kernels_and_the_shooting_problem_alone(name: str, path: Path) -> None:
    for target in imported(path):
        assert target.split(".")[0] in RUNTIME | {"casadi", "numpy", "symphys"}, target
        assert not target.startswith("symphys") or room(target) in {"backends", "cuda", "kernel", "shooting"}, target


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) == "doctor"])
def test_the_doctor_sees_kernels_alone(name: str, path: Path) -> None:
    assert {room(target) for target in imported(path) if target.split(".")[0] == "symphys"} <= {"cuda", "kernel"}


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) == "export"])
def test_exports_see_no_solvers(name: str, path: Path) -> None:
    rooms = {room(target) for target in imported(path) if target.split(".")[0] == "symphys"}
    assert rooms <= PHYSICS | {"export", "problem", "transcription", "kernel", "files", "errors"}


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) == "solvers"])
def test_solvers_see_the_shooting_problem_alone(name: str, path: Path) -> None:
    rooms = {room(target) for target in imported(path) if target.split(".")[0] == "symphys"}
    assert rooms <= {"solvers", "shooting", "errors"}


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) == "report"])
def test_reports_read_run_folders_alone(name: str, path: Path) -> None:
    rooms = {room(target) for target in imported(path) if target.split(".")[0] == "symphys"}
    assert rooms <= {"report", "findings", "errors", "files"}


@pytest.mark.parametrize(("name", "path"), [pair for pair in modules() if room(pair[0]) == "findings"])
def test_findings_know_numbers_and_texts_alone(name: str, path: Path) -> None:
    for target in imported(path):
        assert target.split(".")[0] in RUNTIME | {"numpy", "symphys"}, target
        assert not target.startswith("symphys") or room(target) == "findings", target
