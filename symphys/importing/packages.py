"""Models in installed packages: ``package://gymnasium/envs/mujoco/assets/ant.xml``."""

from __future__ import annotations

import sysconfig
from importlib.util import find_spec
from pathlib import Path

from symphys.importing.records import ImportProblem

SCHEME = "package:"
"""Followed by two slashes, of which a path keeps one."""


def model_file(name: str | Path) -> Path:
    """Return the path of a model, which may be in an installed package; nothing of the package is executed.

    Raises:
        ImportProblem: for a package that is not installed, and for a file that it does not have.
    """
    text = str(name)
    if not text.startswith(SCHEME):
        return Path(name)
    package, _, rest = text.removeprefix(SCHEME).lstrip("/").partition("/")
    folder = package_folder(package)
    if folder is None:
        raise ImportProblem(text, f"the package {package} is not installed; pip install {package} may bring it")
    file = (folder / rest).resolve()
    if not file.is_relative_to(folder.resolve()) or not file.is_file():
        raise ImportProblem(text, f"the package {package} is installed, and has no such file")
    return file


def package_folder(package: str) -> Path | None:
    """Return the folder of an installed package, or of that name next to packages; None if there is none."""
    if not package.replace("_", "a").isidentifier():
        beside = Path(sysconfig.get_paths()["purelib"]) / package
        return beside if package not in ("", ".", "..") and beside.is_dir() else None
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))
