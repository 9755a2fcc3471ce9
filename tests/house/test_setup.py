"""The package list, the mapped folders and the wheel agree with what is on disk."""

from __future__ import annotations

import configparser
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LEFT_OUT = {"__pycache__", "node_modules"}
MAPPED = {"solvers": "symphys.solvers", "problems": "symphys.problems"}


@pytest.fixture(scope="module")
def setup() -> configparser.ConfigParser:
    parser = configparser.ConfigParser()
    parser.read(ROOT / "setup.cfg", encoding="utf-8")
    return parser


def packages_on_disk() -> set[str]:
    """Every folder with an __init__.py, by the name under which it installs."""
    found = set()
    for top in ("symphys", *MAPPED):
        for init in (ROOT / top).rglob("__init__.py"):
            parts = init.parent.relative_to(ROOT).parts
            found.add(".".join([MAPPED.get(parts[0], parts[0]), *parts[1:]]))
    return found


def test_setup_lists_every_package(setup: configparser.ConfigParser) -> None:
    listed = setup["options"]["packages"].split()
    assert listed == sorted(listed)
    assert set(listed) == packages_on_disk()


def test_every_folder_with_code_is_a_package() -> None:
    with_code = {path.parent for top in ("symphys", *MAPPED) for path in (ROOT / top).rglob("*.py")}
    assert [folder for folder in with_code if not (folder / "__init__.py").exists()] == []


def test_mapped_folders_are_those_that_setup_maps(setup: configparser.ConfigParser) -> None:
    lines = [line.split(" = ") for line in setup["options"]["package_dir"].strip().splitlines()]
    assert {folder: name for name, folder in lines} == {**MAPPED, "symphys": "symphys"}


@pytest.mark.parametrize("folder", MAPPED)
def test_mapped_folder_refuses_its_bare_name(folder: str) -> None:
    tried = subprocess.run(
        [sys.executable, "-c", f"import {folder}"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert tried.returncode == 1
    assert "ImportError" in tried.stderr
    assert MAPPED[folder] in tried.stderr


@pytest.mark.slow
def test_wheel_holds_what_is_needed_at_run_time(tmp_path: Path) -> None:
    """A wheel of the files that belong to the project, built in a copy so that the checkout stays clean."""
    pytest.importorskip("setuptools", minversion="70.1")
    copy = tmp_path / "checkout"
    for path in project_files():
        target = copy / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes((ROOT / path).read_bytes())
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(tmp_path)]
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, str(copy)], check=True)
    (wheel,) = tmp_path.glob("symphys-*.whl")
    held = set(zipfile.ZipFile(wheel).namelist())
    assert wheel_names() <= held
    assert {name.partition("/")[0] for name in held if ".dist-info/" not in name} == {"symphys"}
    (metadata,) = [name for name in held if name.endswith(".dist-info/METADATA")]
    described = zipfile.ZipFile(wheel).read(metadata).decode()
    assert "# symphys" in described and "](docs/" not in described


def project_files() -> list[Path]:
    """What the build reads."""
    tops = [
        "setup.py",
        "setup.cfg",
        "pyproject.toml",
        "MANIFEST.in",
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "CITATION.cff",
    ]
    folders = [path for top in ("symphys", *MAPPED) for path in (ROOT / top).rglob("*")]
    files = [path.relative_to(ROOT) for path in folders if path.is_file() and not LEFT_OUT & {*path.parts}]
    return [Path(top) for top in tops] + files


def wheel_names() -> set[str]:
    """Where code, problem files, styles and scripts go."""
    kept = [
        path
        for path in project_files()
        if path.suffix in {".py", ".toml", ".css", ".js", ".typed", ".c", ".h"}
        or path.name in ("Makefile", "times.json", "three.LICENSE")
    ]
    sources = Path("symphys/report/viewer")  # of static/viewer.js
    kept = [path for path in kept if len(path.parts) > 1 and sources not in path.parents]
    return {path.as_posix() if path.parts[0] == "symphys" else f"symphys/{path.as_posix()}" for path in kept}
