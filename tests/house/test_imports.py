"""Data flows one way, and so do imports: the table of laws, which ARCHITECTURE.md repeats word for word."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = "symphys"
ROOMS: dict[str, tuple[str, str, str]] = {
    "version": ("", "", "the version of the package"),
    "errors": ("", "", "errors that a user may meet"),
    "suggest": ("", "", "hints for error messages"),
    "types": ("", "numpy", "what arrays and expressions are called"),
    "records": ("", "", "data classes that are quick to define"),
    "deprecated": ("", "", "public names of older versions"),
    "later": ("", "", "names imported when first used"),
    "latest": ("", "", "what was made last, by its key"),
    "interrupts": ("", "", "Ctrl-C"),
    "threads": ("", "", "one thread for linear algebra"),
    "files": ("errors", "numpy", "files appear at once and whole, or not at all"),
    "archives": ("suggest", "numpy", "archives of arrays"),
    "json_values": ("", "numpy", "tolerant readings of JSON"),
    "trajectory": ("errors suggest", "numpy", "a simulated motion as arrays"),
    "shooting": ("", "numpy", "what solvers see: the shooting problem, whole or step by step"),
    "maths": ("", "casadi", "rotations and smoothed primitives"),
    "model": ("errors later maths suggest", "casadi numpy scipy", "what a world is, as data"),
    "dynamics": ("latest maths model", "casadi numpy", "one time step"),
    "expression": ("errors maths suggest", "casadi", "the formula language"),
    "problems": ("errors suggest", "", "shipped problem files"),
    "importing": (
        "errors files maths model suggest",
        "casadi matplotlib mujoco numpy scipy",
        "other programs' models of robots as tables",
    ),
    "problem": (
        "archives dynamics errors expression files importing later maths model problems suggest",
        "casadi numpy pydantic pydantic_core scipy tomli_w",
        "problem file to problem; of the dynamics only what is observed",
    ),
    "codegen": ("errors later latest shooting", "casadi cuda cupy numpy", "programs compiled to SIMD C and CUDA"),
    "transcription": (
        "codegen dynamics errors expression later latest maths model problem shooting suggest trajectory",
        "casadi numpy scipy",
        "problem to shooting problem",
    ),
    "verification": (
        "codegen dynamics maths model problem shooting trajectory transcription",
        "casadi numpy",
        "how far a solution can be trusted, as numbers",
    ),
    "export": (
        "codegen dynamics errors files maths model problem trajectory transcription version",
        "casadi mujoco numpy",
        "other programs' files",
    ),
    "solvers": ("errors later shooting", "casadi cma numpy scipy", "optimisation methods"),
    "findings": ("json_values", "numpy", "what the numbers of an examination mean"),
    "results": (
        "archives errors files findings json_values model problem suggest trajectory",
        "casadi numpy pandas pyarrow scipy",
        "what a run folder holds",
    ),
    "identification": ("errors results solvers suggest", "cma numpy scipy", "estimates from recordings, no physics"),
    "prediction": (
        "errors expression files identification model problem results suggest threads trajectory transcription",
        "numpy",
        "what problems predict for their recordings",
    ),
    "runs": (
        "codegen errors files findings json_values problem results shooting solvers trajectory transcription "
        "verification version",
        "numpy",
        "solve, judge, examine, write one run, and who may",
    ),
    "batches": (
        "errors files interrupts results runs solvers suggest threads",
        "dask distributed submitit",
        "many runs, in any number of processes and commands",
    ),
    "report": (
        "files findings interrupts json_values results trajectory",
        "markdown_it matplotlib numpy PIL",
        "pages and figures, made from run folders alone",
    ),
    "mpc": (
        "codegen dynamics errors files model problem results shooting solvers suggest trajectory transcription",
        "casadi numpy",
        "model predictive control",
    ),
    "machine": ("codegen", "casadi numpy", "what there is on this machine"),
    "api": (
        "batches codegen errors files findings importing interrupts problem problems report results runs "
        "shooting solvers suggest threads trajectory transcription verification",
        "matplotlib numpy",
        "what Python calls",
    ),
    "torch": ("api errors problem transcription", "numpy torch", "rollouts and steps for PyTorch"),
    "jax": ("api errors problem transcription", "jax numpy", "rollouts and steps for JAX"),
    "env": ("api errors problem", "gymnasium numpy", "environments for Gymnasium"),
    "cli": (
        "api batches codegen errors export files findings identification importing interrupts machine mpc "
        "prediction problem problems report results runs solvers suggest threads trajectory transcription "
        "verification version",
        "click numpy rich",
        "the commands",
    ),
}
"""Of each room: which others it may import, which packages of third parties, and what it is."""
FACADE = {"__init__", "__main__"}
"""The package itself, which hands names on, and ``python -m symphys``."""
EVERYWHERE = {"types", "records"}
"""What all rooms may import."""


@cache
def modules() -> dict[str, Path]:
    """Every module by the name under which it installs."""
    found = {}
    for top, prefix in ((PACKAGE, PACKAGE), ("solvers", "symphys.solvers"), ("problems", "symphys.problems")):
        for path in sorted((ROOT / top).rglob("*.py")):
            below = path.relative_to(ROOT / top).with_suffix("").parts
            found[".".join((prefix, *below)).removesuffix(".__init__")] = path
    return found


@cache
def imported(name: str) -> frozenset[str]:
    """Every module that a module imports, wherever in its file."""
    return frozenset(_imported(name))


def _imported(name: str) -> Iterator[str]:
    path = modules()[name]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are absolute"
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in modules() else str(node.module)


def room(name: str) -> str:
    """The entry of symphys/ that a module belongs to: ``symphys.cli.app`` -> ``cli``."""
    return [*name.split("."), "__init__"][1]


def used(inside: str) -> tuple[set[str], set[str]]:
    """(rooms, packages of third parties) that the modules of a room import."""
    targets = {target for name in modules() if room(name) == inside for target in imported(name)}
    ours = {target for target in targets if target.split(".")[0] == PACKAGE}
    others = {target.split(".")[0] for target in targets - ours} - set(sys.stdlib_module_names)
    return {room(target) for target in ours} - {inside} - FACADE - EVERYWHERE, others


@pytest.mark.parametrize("inside", sorted({room(name) for name in modules()} - FACADE))
def test_rooms_import_what_the_table_says(inside: str) -> None:
    """Neither more, nor does the table allow what nobody needs."""
    rooms, packages, _ = ROOMS[inside]
    assert used(inside) == (set(rooms.split()), set(packages.split()))


def test_the_table_has_no_other_rooms() -> None:
    assert {room(name) for name in modules()} - FACADE == set(ROOMS)


def test_no_module_imports_itself_by_a_detour() -> None:
    """A package counts as the modules that its __init__ imports."""
    graph = {name: imported(name) & modules().keys() - {name} for name in modules()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def reached(start: set[str]) -> set[str]:
    """All that is imported when these modules are, with the packages that it lies in; symphys itself imports lazily."""
    found, left = set[str](), start
    while left:
        parents = {name.rpartition(".")[0] for name in left}
        found |= left
        left = ({target for name in left for target in imported(name)} | parents) & modules().keys() - found - {PACKAGE}
    return found


def test_reading_a_problem_takes_no_time_step() -> None:
    """Of the dynamics it needs what can be seen of the start: gaps, joints, sensors."""
    parts = reached({name for name in modules() if room(name) == "problem"})
    of_step = {f"{PACKAGE}.dynamics.{name}" for name in ("functions", "step", "substep", "pgs", "impact.impact")}
    assert of_step <= modules().keys()
    assert "symphys.dynamics.observation.queries" in parts
    assert not of_step & parts


def test_public_classes_have_names_of_their_own() -> None:
    homes: dict[str, list[str]] = {}
    for name, path in modules().items():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(name)
    assert {name: where for name, where in homes.items() if len(where) > 1} == {}


def table() -> str:
    """The laws as ARCHITECTURE.md has them."""
    lines = ["| room | what it is | may import | third parties |", "|---|---|---|---|"]
    for name, (rooms, packages, what) in ROOMS.items():
        listed = ", ".join(f"`{each}`" for each in rooms.split())
        lines.append(f"| `{name}` | {what} | {listed} | {', '.join(packages.split())} |")
    return "\n".join(lines)


def test_the_document_has_this_table() -> None:
    assert table() in (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"), "put this in:\n" + table()
