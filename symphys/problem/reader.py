"""From the text of a problem file to its data, under any settings: what they leave as it is, is read once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca

from symphys.problem.checks.start_values import StartValues
from symphys.problem.include.files import with_included
from symphys.problem.include.merge import MergedFiles
from symphys.problem.include.placing import placed
from symphys.problem.load import build, read_document
from symphys.problem.model import NOTHING, ProblemData
from symphys.problem.reading.faults import Faults
from symphys.problem.reading.settings import apply_settings, own_settings, place_of
from symphys.problem.reading.source import parse_toml
from symphys.problem.sweeps.sweep import Sweep
from symphys.problem.sweeps.table import SWEEP, read_sweep, without_sweep


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
        early = {key: value for key, value in settings.items() if of_includes(key)}
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


def of_includes(key: str) -> bool:
    """Whether a setting says what is included, and must be known before all others."""
    return key.partition(".")[0] in ("include", "included")
