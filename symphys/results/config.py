"""config.json: the settings of a run, and the key by which a finished run is recognised."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from symphys import files
from symphys import json_values as values
from symphys.json_values import Text


@dataclass(frozen=True)
class Config:
    """The settings of one solve.

    Attributes:
        problem: the stem of the problem's file.
        solver: a solver's name.
        seed: 0 is the guess as it stands.
        settings: what the command line changed in the file, by dotted key.
        options: the solver's options, all of them.
        backend: what was to evaluate; "auto" is the best that the machine has.
        guess: the "run" folder that it was taken from, and the "digest" of what was taken, which counts; else empty.
        key: of the problem's text and all the above; two runs with one key are the same run.
    """

    problem: str
    solver: str
    seed: int
    settings: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    backend: str = "auto"
    guess: Mapping[str, str] = field(default_factory=dict)
    key: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the object of config.json."""
        return asdict(self)

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> Config:
        """Read the object of config.json; empty texts for what it does not have."""
        return values.record(cls, value, text)


def read_config(path: Path) -> Config:
    """Read the configuration in a file of this program's own; FileError if there is none."""
    return Config.from_json(files.read_json(path), values.verbatim)


def make_config(
    problem: str,
    text: str,
    solver: str,
    seed: int,
    settings: dict[str, object],
    options: dict[str, object],
    backend: str,
    guess: Mapping[str, str] | None = None,
) -> Config:
    """Return the configuration with its key; ``text`` is the problem's ``identity``."""
    guess = guess or {}
    parts = [text, settings, solver, options, seed, backend, *([guess["digest"]] if guess else [])]
    canonical = json.dumps(files.strict(parts), sort_keys=True, allow_nan=False)
    key = hashlib.sha256(canonical.encode()).hexdigest()
    return Config(problem, solver, seed, settings, options, backend, guess, key)
