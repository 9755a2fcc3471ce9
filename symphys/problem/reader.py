"""Read the text of a problem file under any settings such as ``body.ball.mass = 2``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca

from symphys.errors import Issue, ProblemError
from symphys.problem.include import MergedFiles, placed, with_included
from symphys.problem.load import build, read_document
from symphys.problem.model import NOTHING, ProblemData
from symphys.problem.reading.faults import Faults
from symphys.problem.reading.messages import shown
from symphys.problem.reading.source import parse_toml
from symphys.problem.schema import Document
from symphys.problem.start import StartValues
from symphys.problem.sweeps.reading import SWEEP, read_sweep, without_sweep
from symphys.problem.sweeps.sweep import Sweep
from symphys.suggest import hint, quote

OPENED = ("simulation", "world", "contact", "objective", "solver", "mpc", "identify")
"""Tables that a setting may open; it adds no body, surface, variable or objective."""
OPENED_BELOW = ("solver", "mpc")
"""Those in which it may open tables, too."""

RENAMED = {"fall": "termination", "forget": "adjoint_discount"}
"""Old names of keys; a setting may use either name, whichever the file has."""
FORMER = {name: old for old, name in RENAMED.items()}


ALIASES = {"gravity": "world.gravity"}
"""Names of formulas that are no table's."""


class SettingError(Exception):
    """A setting that has no place in the file."""


def apply_settings(
    data: dict[str, Any], settings: Mapping[str, object], file: str, shared: Collection[str] = ()
) -> None:
    """Change ``data`` in place; ProblemError names every setting that has no place in the file.

    ``shared``: lists with tables of included files, which are not replaced as a whole.
    """
    issues = []
    for path, value in settings.items():
        try:
            if path.partition(".")[0] == "sweep":
                raise SettingError("a setting has one value; --sweep and --samples change what is swept")
            if path in shared:
                raise SettingError("included files have tables in this list; set what is in them by name")
            assign(data, path, value)
        except SettingError as error:
            issues.append(Issue(f"setting {quote(path)}", str(error)))
    if issues:
        raise ProblemError(file, issues)


def own_settings(data: dict[str, Any], file: str) -> dict[str, object]:
    """The settings that a file has itself, in a table [set], which is taken out."""
    own = data.pop("set", {})
    if isinstance(own, dict):
        return own
    example = 'write [set] and below it, for instance, "body.ball.mass" = 2'
    raise ProblemError(file, [Issue("set", f"must be a table of dotted keys, not {shown(own)}; {example}")])


def located(data: Mapping[str, Any], path: str) -> str:
    """The path with the kind of table before the name of one: ``body.ball.mass`` for ``ball.mass``."""
    if path.partition(".")[0] in (*Document.model_fields, *RENAMED, *FORMER):
        return path
    named = {
        (len(table["name"]), key)
        for key, tables in data.items()
        if isinstance(tables, list)
        for table in tables
        if isinstance(table, dict) and isinstance(table.get("name"), str) and path.startswith(f"{table['name']}.")
    }
    longest = max((length for length, _ in named), default=0)
    kinds = sorted(key for length, key in named if length == longest)
    if len(kinds) > 1:
        name = quote(path[:longest])
        raise SettingError(f"{name} is the name of {' and '.join(kinds)}; say which: {quote(f'{kinds[0]}.{path}')}")
    return f"{kinds[0]}.{path}" if kinds else ALIASES.get(path, path)


def assign(data: dict[str, Any], path: str, value: object) -> None:
    """Walk down the dotted path, in which names may hold dots themselves, and set what is at its end."""
    node: Any = data
    open_below, rest = False, located(data, path)
    while True:
        key, remainder = step(node, rest, top=node is data)
        if isinstance(node, dict) and key not in node:
            other = RENAMED.get(str(key)) or FORMER.get(str(key))
            key = key if other is None or other not in node else other
        if remainder is None:
            node[key] = value
            return
        if isinstance(node, dict) and key not in node:
            if not (open_below or (node is data and key in OPENED)):
                raise SettingError(unopened(node, str(key), node is data))
            node[key] = {}
        open_below = open_below or (node is data and key in OPENED_BELOW)
        node, rest = node[key], remainder


def place_of(data: Mapping[str, Any], path: str) -> tuple[str | int, ...]:
    """Keys and indices of what a dotted path means; of a path that means nothing, its parts."""
    node: Any = data
    place: tuple[str | int, ...] = ()
    rest: str | None = path
    try:
        rest = located(data, path)
        while rest is not None:
            key, rest = step(node, rest, top=node is data)
            key = RENAMED.get(str(key), key) if isinstance(node, dict) else key
            place = (*place, key)
            former = FORMER.get(str(key), "")
            node = node.get(key, node.get(former, {})) if isinstance(node, dict) else node[key]
    except SettingError:
        return (*place, *(rest or "").split("."))
    return place


def step(node: Any, rest: str, top: bool) -> tuple[str | int, str | None]:
    """The next key or index of the path, and what is left of it; None at its end."""
    if isinstance(node, dict):
        names: dict[str, str | int] = {key: key for key in node}
    elif isinstance(node, list):
        names = {name: index for index, entry in enumerate(node) for name in entry_names(entry, index)}
    else:
        raise SettingError(f"{shown(node)} has no {quote(rest)} in it")
    found = max((name for name in names if rest == name or rest.startswith(f"{name}.")), key=len, default=None)
    if found is not None:
        return names[found], (rest[len(found) + 1 :] if len(rest) > len(found) else None)
    head, _, remainder = rest.partition(".")
    if isinstance(node, list):
        raise SettingError(f"there is no {quote(head)}; {hint(head, names)}")
    if not remainder and top and head not in Document.model_fields:
        raise SettingError(unopened(node, head, top))
    return head, remainder or None


def entry_names(entry: object, index: int) -> Sequence[str]:
    """Return the keys of a table of a list: its name, for a pair ``a-b``, and always its index."""
    names = [str(index)]
    if isinstance(entry, dict):
        between = entry.get("between")
        if isinstance(entry.get("name"), str):
            names.append(entry["name"])
        if isinstance(between, list):
            names.append("-".join(str(name) for name in between))
    return names


def unopened(node: Mapping[str, Any], key: str, top: bool) -> str:
    """Return the reason why a setting does not make a missing table."""
    if top and key in Document.model_fields:
        return f"the file has no {quote(key)}, and a setting cannot add one"
    tables = [table for tables in node.values() if isinstance(tables, list) for table in tables] if top else []
    names = [table["name"] for table in tables if isinstance(table, dict) and isinstance(table.get("name"), str)]
    return f"there is no {quote(key)}; {hint(key, [*node, *(OPENED if top else ()), *names])}"


def read_problem(
    path: Path, text: str, settings: Mapping[str, object] = NOTHING, functions: Mapping[str, ca.Function] = NOTHING
) -> ProblemData:
    """Read and validate the text of a problem file.

    Args:
        path: of the file; files that it includes are looked for beside it.
        text: what is in it.
        settings: see ``load_problem``; those of the table [set] come before them.
        functions: see ``load_problem``.

    Raises:
        ProblemError: names the file and every fault found, each with table, key and what would be valid.
    """
    return ProblemReader(path, text, functions).read(settings)


class ProblemReader:
    """Reads one file under any settings.

    Attributes:
        sweep: what its [sweep] says; None where it has none.
    """

    def __init__(self, path: Path, text: str, functions: Mapping[str, ca.Function] = NOTHING) -> None:
        """Parse the text; ProblemError where it is no TOML, or where its [sweep] or [set] cannot be."""
        self.path, self.functions = path, functions
        data = parse_toml(path, text)
        self.sweep: Sweep | None = None
        if SWEEP in data:
            self.sweep = read_sweep(data.pop(SWEEP), str(path))
            text = without_sweep(path, text, data)
        self.text = text
        self.own = own_settings(data, str(path))
        self._data = data
        self._merged: tuple[str, MergedFiles] | None = None
        self._start = StartValues()

    def read(self, settings: Mapping[str, object] = NOTHING) -> ProblemData:
        """The problem under some settings; see ``read_problem``."""
        merged, late = self.tables(settings)
        apply_settings(merged.data, late, str(self.path), merged.shared)
        faults = Faults(str(self.path), merged.data, merged.origins)
        document = placed(read_document(merged.data, faults), merged, faults)
        return build(self.path, merged.text, document, faults, self.functions, self._start, self.sweep)

    def tables(self, settings: Mapping[str, object]) -> tuple[MergedFiles, dict[str, object]]:
        """The tables with those of included files, to be changed by the caller, and the settings that are left."""
        settings = {key: copied(value) for key, value in {**self.own, **settings}.items()}
        # what is included must be known before all other settings
        early = {key: value for key, value in settings.items() if key.partition(".")[0] in ("include", "included")}
        late = {key: value for key, value in settings.items() if key not in early}
        known = repr(early)
        if self._merged is None or self._merged[0] != known:
            data: dict[str, Any] = copied(self._data)
            apply_settings(data, early, str(self.path))
            self._merged = known, with_included(self.path, self.text, data)
        merged = self._merged[1]
        return replace(merged, data=copied(merged.data)), late

    def place(self, key: str) -> tuple[str | int, ...]:
        """Return the place that a dotted key leads to; see ``place_of``."""
        return place_of(self.tables(NOTHING)[0].data, key)


def copied(value: Any) -> Any:
    """Tables and lists like these, which may be changed."""
    if isinstance(value, dict):
        return {key: copied(each) for key, each in value.items()}
    return [copied(each) for each in value] if isinstance(value, list) else value
