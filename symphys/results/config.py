"""config.json: the settings of a run, the key of a finished run, and the folder name of a problem under settings."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, field
from pathlib import Path
from typing import Any

from symphys import files
from symphys import json_values as values
from symphys.json_values import Text
from symphys.records import dataclass


@dataclass(frozen=True)
class Config:
    """The settings of one solve.

    Attributes:
        problem: the stem of the problem's file.
        solver: a solver's name.
        seed: 0 is the guess as it stands.
        settings: changes by the command line in the file, by dotted key.
        options: the solver's options, all of them.
        backend: the requested evaluator; "auto" is the best that the machine has.
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


MAX_SETTINGS_LENGTH = 80
"""Characters of the settings in a folder name before they are cut."""


def case_name(problem: str, settings: Mapping[str, object], guess: str = "") -> str:
    """Return ``ball_throw``, or ``ball_throw@ground.friction=0.6`` under settings, whatever order they were given in.

    Settings that are too long for a name, or have characters that not every file system keeps apart, are shortened
    and end in a digest of the whole. ``guess`` is a last word for a guess from elsewhere, ``guess=1a2b3c4d``.
    """
    if guess:
        before = case_name(problem, settings)
        return f"{before}{',' if settings else '@'}{guess}"
    if not settings:
        return problem
    words = settings_words(settings, ",")
    kept = re.sub(r"[^a-z0-9._=,+-]+", "_", words)[:MAX_SETTINGS_LENGTH]
    digest = hashlib.sha256(words.encode()).hexdigest()[:10]
    return f"{problem}@{kept}" if kept == words else f"{problem}@{kept}~{digest}"


def settings_words(settings: Mapping[str, object], between: str = ", ") -> str:
    """Write ``ground.friction=0.6, simulation.dt=0.01``, in the order of the keys; empty without settings."""
    return between.join(f"{key}={json.dumps(files.strict(settings[key]))}" for key in sorted(settings))
