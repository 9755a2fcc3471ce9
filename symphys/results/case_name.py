"""The folder name of a problem under settings: other settings, another folder."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping

from symphys import files

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
