"""The shipped problem files and their parts, and how a name on the command line finds a problem."""

from __future__ import annotations

if __name__ != "symphys.problems":
    raise ImportError(
        f"this folder is the package symphys.problems, but was imported as {__name__!r}: "
        "install the project (pip install -e .) and import symphys.problems"
    )

import json
from pathlib import Path

from symphys.errors import SymphysError
from symphys.suggest import hint, quote

FOLDER = Path(__file__).parent
PARTS = ("robots", "tasks")


def catalogue() -> dict[str, Path]:
    """Every shipped problem file by its name without ``.toml``."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}


def typical_seconds() -> dict[str, float]:
    """Return the seconds that solving a shipped problem took, as ``make bench-shipped`` measured them."""
    return {str(name): float(took) for name, took in json.loads((FOLDER / "times.json").read_text("utf-8")).items()}


def parts() -> dict[str, Path]:
    """Shipped robots and tasks by the paths under which problems include them: ``robots/arm.toml``."""
    return {f"{kind}/{path.name}": path for kind in PARTS for path in sorted((FOLDER / kind).glob("*.toml"))}


def shipped(name: str) -> Path:
    """A shipped problem, robot or task: ``ball_throw``, ``robots/arm.toml`` or ``arm``.

    Raises:
        SymphysError: there is none; names the nearest.
    """
    files = {**{path.stem: path for path in parts().values()}, **parts(), **catalogue()}
    named = name if name in files else name.removesuffix(".toml")
    if named not in files:
        near = hint(name, [*catalogue(), *parts()])
        raise SymphysError(f"there is no file {quote(name)}, and nothing of that name is shipped; {near}")
    return files[named]


def is_part(path: Path) -> bool:
    """Whether a shipped file is a robot or a task, which problems include."""
    return path in parts().values()


def find(name_or_path: str | Path) -> Path:
    """A path that exists, else the shipped problem of that name (with or without ``.toml``).

    Raises:
        SymphysError: there is neither; names the nearest shipped problems.
    """
    text = str(name_or_path)
    try:
        if text and Path(text).exists():
            return Path(text)
    except (OSError, ValueError):  # a path that the system cannot even look up
        pass
    shipped = catalogue()
    name = text.removesuffix(".toml")
    if name in shipped:
        return shipped[name]
    raise SymphysError(
        f"there is no file {quote(text)} and no shipped problem of that name; {hint(name.rsplit('/')[-1], shipped)}"
    )
