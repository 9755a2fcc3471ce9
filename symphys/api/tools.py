"""Small commands: copies of shipped files, the schema of problem files, the kept kernels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from symphys import files, problems
from symphys.codegen import Cache, default_cache
from symphys.errors import SymphysError
from symphys.problem import json_schema
from symphys.solvers import SOLVERS, solver


def new(file: str | Path, source: str = "ball_throw") -> Path:
    """Write a copy of a shipped problem, robot or task, to be changed.

    Args:
        file: to write; one that is there already is not overwritten.
        source: its name; ``symphys.problems.catalogue()`` has the problems, ``symphys.problems.parts()`` the others.

    Raises:
        SymphysError: nothing of that name is shipped, or the file is there already.

    Example:
        >>> import symphys
        >>> symphys.load(symphys.new("mine.toml", "two_balls")).name
        'mine'
    """
    text, path = problems.shipped(source).read_text(encoding="utf-8"), Path(file)
    if path.exists():
        raise SymphysError(f"{path}: is there already, and is not overwritten; choose another name")
    files.write_text(path, text)
    return path


def schema() -> dict[str, Any]:
    """The JSON Schema of problem files, with which editors complete and check them.

    Example:
        >>> import symphys
        >>> symphys.schema()["title"]
        'symphys problem'
    """
    return json_schema({name: solver(name).Options for name in SOLVERS})


def cache() -> Cache:
    """The compiled kernels on disk: ``info()`` says where they are and how large, ``clear()`` removes them.

    Example:
        >>> import symphys
        >>> symphys.cache().info().kernels >= 0
        True
    """
    return default_cache()
