"""The page of an identification: what it says of a fit, and what was measured beside what is simulated."""

from __future__ import annotations

import html
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tools.page_scripts import charts, held

import symphys
from symphys.cli.app import main
from symphys.report import write_identification_page
from symphys.report.pages.identification import correlations
from symphys.report.scene.ghosts import with_ghosts
from symphys.results.identification import read_identification
from symphys.results.identification.replays import read_replays
from symphys.results.scene import read_scene

TOSSES = """
title = "Thrown"
[simulation]
duration = 0.5
dt = 0.01
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
[ground]
[[variable]]
name = "mass"
sets = "ball.mass"
lower = 0.1
upper = 5
[[variable]]
name = "speed"
sets = "ball.velocity[0]"
each = "recording"
[[recording]]
name = "toss"
rate = 50
until = 0.42
measured = [{ value = "ball.position", columns = "p", noise = 0.001 }]
[recording.table]
"""


def text_of(page: Path) -> str:
    text = re.sub(r"<(script|style|svg)\b.*?</\1>", " ", page.read_text("utf-8"), flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("identified")
    symphys.identify("bounce_recorded", path, bootstrap=0)
    write_identification_page(path)
    return path


@pytest.mark.slow
def test_it_says_what_was_found(folder: Path) -> None:
    found, page = read_identification(folder), text_of(folder / "report.html")
    each = found["bounce"]
    assert "Converged" in page
    assert f"{each.value:.5f}".rstrip("0") in page
    assert f"{each.lower:.6f}"[:7] in page
    assert "The recordings determine every number." in page
    assert "uncorrelated, without trend, and consistent with the noise level" in page
    for error in (found.fitted_errors[0], found.held_back_errors[0]):
        assert f"{error.mean:.3g}" in page
    assert "Among the worst: drops/0002 Held back" in page


@pytest.mark.slow
def test_figures_hold_the_numbers(folder: Path) -> None:
    found = read_identification(folder)
    page = charts((folder / "report.html").read_text("utf-8"))
    assert {"intervals", "residuals", "course", "replay-1"} <= set(page)
    ((name, _, ((low, high),), _),) = page["intervals"]["panels"][0]["bars"]
    assert name == "bounce" and low == pytest.approx(-high, rel=1e-6)
    assert high == pytest.approx((found["bounce"].upper - found["bounce"].value) / found["bounce"].error)
    assert 'class="correlations"' not in (folder / "report.html").read_text("utf-8"), "of one number there are none"
    assert not (folder / "figures").exists()
    assert symphys.write_report(folder, figures=True) == folder / "report.html"
    table = (folder / "figures" / "course.csv").read_text("utf-8")
    assert f"{found.history[-1, 0]:g}" in table
    assert (folder / "figures" / "residuals.svg").read_text("utf-8").startswith("<?xml")
    shutil.rmtree(folder / "figures")


def test_correlations_are_cells_whose_colour_follows_the_number(folder: Path) -> None:
    found = read_identification(folder)
    two = (replace(found.parameters[0], name="a<b"), replace(found.parameters[0], name="mass"))
    text = correlations(replace(found, parameters=two, correlation=np.array([[1.0, -0.75], [-0.75, 1.0]])))
    assert text.count("rgb(33 102 172 / 0.75)") == 2 and text.count("rgb(178 24 43 / 1.00)") == 2
    assert text.count("−0.75") == 2 and "a&lt;b" in text  # noqa: RUF001
    assert not correlations(replace(found, parameters=two, correlation=np.full((2, 2), np.nan)))


@pytest.mark.slow
def test_a_replay_is_what_was_measured_beside_the_simulation(folder: Path) -> None:
    replays, found = read_replays(folder), read_identification(folder)
    assert [each.name for each in replays] == [name for name, _ in found.worst(3)]
    (problem, first) = symphys.load("bounce_recorded"), replays[0]
    (recording,) = (each for each in problem.recordings if each.name == first.name)
    assert first.quantities[0].measured == pytest.approx(recording.measured[0].values)
    off = (first.quantities[0].simulated - first.quantities[0].measured) / 0.002
    assert np.sqrt(np.mean(off**2)) == pytest.approx(first.ratio, rel=1e-6)
    at = np.interp(first.time, first.motion.time, first.motion["ball.position"][:, 2])
    assert first.quantities[0].simulated.ravel() == pytest.approx(at, abs=1e-9)


def test_the_measured_body_is_seen_through(folder: Path) -> None:
    replay, page = read_replays(folder)[0], (folder / "report.html").read_text("utf-8")
    motion, scene = with_ghosts(replay, read_scene(folder / "scene.json"))
    assert motion.body_names == ("ball", "ball measured")
    assert scene.solids("ball measured") == scene.solids("ball")
    height = np.interp(motion.time, replay.time, replay.quantities[0].measured[:, 0])
    assert motion["ball measured.position"][:, 2] == pytest.approx(height)
    data = held(page, 'class="animation">')[0]
    assert [body["ghost"] for body in data["bodies"]] == [False, True]


@pytest.mark.slow
def test_what_is_not_determined_is_named(tmp_path: Path) -> None:
    time = np.arange(0, 0.42, 0.02)
    rows = [[0.5 * t, 0.0, 1 - 4.905 * t * t] for t in time]
    (tmp_path / "tosses.toml").write_text(f"{TOSSES}p = {json.dumps(rows)}\n", "utf-8")
    out = tmp_path / "out"
    found = symphys.identify(tmp_path / "tosses.toml", out)
    assert [each.names for each in found.open] == [("mass",)]
    page = text_of(write_identification_page(out))
    assert "not determined" in page
    assert "mass has no effect" in page.lower()
    assert found.open[0].advice in page


@pytest.mark.slow
def test_report_makes_it_again(folder: Path) -> None:
    page = folder / "report.html"
    before = page.read_text("utf-8")
    page.unlink()
    assert symphys.write_report(folder.parent / folder.name) == page
    assert page.read_text("utf-8") == before
    page.unlink()
    assert main(["report", str(folder)]) == 0
    assert page.read_text("utf-8") == before
