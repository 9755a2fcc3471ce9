"""Exported functions load in a process that knows casadi only, and give the numbers of Python."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import casadi
import numpy as np
import pytest
from tools.repeats import few

from symphys.export import casadi_files, write_folders
from symphys.export.casadi_files import RESULTS
from symphys.export.sources import slopes_function, tangent_of
from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import Transcription, transcribe
from symphys.transcription.staged.linearization import Linearization

LOADED = """
import json, sys
sys.modules["symphys"] = None  # whoever imports it fails
import casadi
z = json.loads(sys.argv[1])
values = {}
for name in ("value", "gradient", "residuals", "jacobian", "nlp", "step", "linearize"):
    try:
        function = casadi.Function.load(name + ".casadi")
    except RuntimeError:
        continue
    given = {"x": 0.5, "p": 0.6} if name in ("step", "linearize") else {"z": z, "smoothing": 0}
    values[name] = {key: value.full().T.tolist() for key, value in function(**given).items()}
print(json.dumps(values))
"""


def test_plain_casadi_loads_them(kick: Transcription, tmp_path: Path) -> None:
    written = write_folders({tmp_path: casadi_files(kick, "1.2")})
    z = kick.shooting.start(1)
    command = [sys.executable, "-c", LOADED, json.dumps(z.tolist())]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    values = json.loads(done.stdout)
    assert {path.stem for path in written} == {*values, "README"}
    for name in ("value", "gradient", "nlp"):
        expected = getattr(kick.functions, name)(z, 0.0)
        assert values[name].keys() == set(RESULTS[name])
        for result, theirs in zip(RESULTS[name], expected, strict=True):
            np.testing.assert_allclose(np.ravel(values[name][result]), np.array(theirs).ravel(), rtol=1e-12, atol=1e-12)
    assert len(values["step"]["x_next"][0]) == 23
    assert values["linearize"]["x_next"] == values["step"]["x_next"]


def test_the_readme_names_everything(kick: Transcription) -> None:
    text = casadi_files(kick, "1.2")["README.txt"].decode()
    for line in (
        "gradient: z (7), smoothing (1) -> merit (1), objective (1), errors (2), gradient (7), outputs (0)",
        "step: x (23), u (3), p (1), smoothing (1) -> x_next (23)",
        "x[7..9]            ball.velocity [m/s]",
        'errors[0]          target über "there" ?',
    ):
        assert line in text


@few("name", ["kick", "fastest_move", "cart_pole", pytest.param("ice_and_asphalt", marks=pytest.mark.thorough)], 1)
def test_slopes_of_a_step_are_those_of_linearize(name: str, kick: Transcription) -> None:
    one = kick if name == "kick" else transcribe(load_problem(find(name)), backend="casadi")
    linearize = slopes_function(tangent_of(one))
    made = Linearization(one.rollout, backend="casadi")
    z = one.shooting.start(1)
    motion, p = made.motion(z, 0.0), made.start(z)[2]
    slopes = made.step.slopes(motion.x[:-1], motion.u, p, 0.0)
    for k in (0, len(motion.u) // 2):
        u = np.array(one.rollout.with_shares(casadi.DM(motion.u[k]), casadi.DM(k))).ravel()
        u = u if one.rollout.feedback is None else np.append(u, k * one.rollout.dt)
        after, *found = (np.array(each) for each in linearize(motion.x[k], u, p, 0))
        np.testing.assert_allclose(after.ravel(), motion.x[k + 1], rtol=1e-13, atol=1e-13)
        found[2] = found[2].reshape(len(found[0]), -1)[:, made.step.arguments.varied]
        for ours, theirs in zip(found, (*slopes[:2], slopes[2][:, :, made.step.arguments.varied]), strict=True):
            scale = np.abs(theirs[k]).max(initial=1e-9)
            np.testing.assert_allclose(ours.reshape(theirs[k].shape), theirs[k], rtol=0, atol=1e-11 * scale)
