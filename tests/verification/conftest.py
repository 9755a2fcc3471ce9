"""Small problems from text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from symphys.problem import load_problem
from symphys.transcription import Transcription, transcribe

Make = Callable[..., Transcription]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """A transcription of a problem text."""

    def build(text: str, **settings: object) -> Transcription:
        path = tmp_path / "problem.toml"
        path.write_text(text, encoding="utf-8")
        return transcribe(load_problem(path, {k.replace("__", "."): v for k, v in settings.items()}), backend="casadi")

    return build
