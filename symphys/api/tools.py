"""Small commands: copies of shipped files, the schema of problem files, the cache of kernels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from symphys import files, problems
from symphys.codegen import Cache, default_cache
from symphys.errors import SymphysError
from symphys.problem import json_schema
from symphys.solvers import SOLVERS, solver


def new(file: str | Path, source: str = "ball_throw") -> Path:
    """Copy a shipped problem, robot or task to a file of your own.

    Args:
        file: the file to write, which must not exist.
        source: the name of what to copy: a problem of ``symphys.problems.catalogue()``, or a robot or task of
            ``symphys.problems.parts()``.

    Returns:
        The path of the file.

    Raises:
        SymphysError: nothing of that name is shipped, or the file exists.

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
    """Return the JSON Schema of problem files, with which editors complete and check them.

    Example:
        >>> import symphys
        >>> symphys.schema()["title"]
        'symphys problem'
    """
    return json_schema({name: solver(name).Options for name in SOLVERS})


def cache() -> Cache:
    """Return the cache of compiled kernels on disk: ``info()`` has its folder and size, ``clear()`` empties it.

    Example:
        >>> import symphys
        >>> symphys.cache().info().kernels >= 0
        True
    """
    return default_cache()
