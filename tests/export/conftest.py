"""A ball that is pushed along the ground and bounces: controls, a parameter, costs, errors, and words that hurt C."""

from __future__ import annotations

from pathlib import Path

import pytest

from symphys.problem import load_problem
from symphys.transcription import Transcription, transcribe

KICK = """
title = "A kick */ #error ??/ \\"quoted\\" \\\\ ü"
[simulation]
duration = 0.4
dt = 0.02
[ground]
friction = 0.4
restitution = 0.6
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 0.5
position = [0, 0, 0.3]
[[variable]]
name = "push"
sets = "ball.force[0:2]"
knots = 3
guess = [[1, 0], [0, 1], [0.5, 0.5]]
lower = -5
[[variable]]
name = "mass"
sets = "ball.mass"
guess = 0.6
[[cost]]
name = "effort"
at = "always"
squares = "ball.force"
weight = 0.1
[[target]]
name = 'über "there" ?'
value = "ball.position[0:2] - [0.4, 0.2]"
tolerance = 0.01
[[constraint]]
name = "speed"
at = "always"
value = "ball.velocity[0]"
upper = 0.2
tolerance = 0.01
"""


@pytest.fixture(scope="session")
def kick(tmp_path_factory: pytest.TempPathFactory) -> Transcription:
    path = Path(tmp_path_factory.mktemp("problem")) / "1st kick-ü.toml"
    path.write_text(KICK, encoding="utf-8")
    return transcribe(load_problem(path), backend="casadi")
