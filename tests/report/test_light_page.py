"""A light page has the words and tables of the full one, its curves as numbers, and needs nothing else."""

from __future__ import annotations

import base64
import json
import re
import shutil
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.walker import motion, write_walker
from tools.page_scripts import NODE, run_script

from symphys.report import write_light_report, write_run_report
from symphys.report.charts.chart import RESOLUTION, Chart, Panel, differences, lines
from symphys.report.pages.markup import pack
from symphys.results.trajectories import read_trajectory

LARGEST = 60_000
OPTIONAL = ("trajectory.npz", "guess.npz", "scene.json", "trace.csv", "config.json", "problem.toml", "log.txt")


def read(run_dir: Path) -> str:
    return write_light_report(run_dir).read_text(encoding="utf-8")


def unpack(text: str) -> str:
    """The inverse of ``pack``."""
    return zlib.decompress(base64.b64decode(text)).decode()


def charts(text: str) -> dict[str, Any]:
    """The charts of a page by name, as its script reads them."""
    found = re.findall(r'<figure class="chart" data-name="(\w+)">.*?<script[^>]*>(.*?)</script>', text, re.DOTALL)
    return {name: json.loads(unpack(data)) for name, data in found}


def numbers(packed: Any) -> np.ndarray:
    """As the page's script unpacks them."""
    if isinstance(packed, dict):
        return np.cumsum(packed["d"]) * packed["q"]
    return np.array([np.nan if value is None else value for value in packed], float)


def tables(text: str) -> list[str]:
    return re.findall(r"<(?:table|dl|nav)\b.*?</(?:table|dl|nav)>|<h[12]>.*?</h[12]>", text, re.DOTALL)


@pytest.fixture(scope="module")
def shown(made: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("light") / "run"
    shutil.copytree(made / "ball_throw" / "gradient-seed0", folder)
    return folder, read(folder)


@pytest.mark.slow
def test_words_and_tables_are_those_of_the_full_page(shown: tuple[Path, str], run_dir: Path) -> None:
    full = write_run_report(run_dir).read_text(encoding="utf-8")
    assert len(tables(full)) > 5
    assert tables(shown[1]) == tables(full)


def test_curves_are_the_recorded_numbers(shown: tuple[Path, str]) -> None:
    """To the rounding of the picture: times and places of the ball, and its highest contact force."""
    folder, text = shown
    recorded, found = read_trajectory(folder / "trajectory.npz"), charts(text)
    assert list(found) == ["convergence", "states", "contacts"]
    panel = found["states"]["panels"][0]
    assert panel["title"] == "Position [m]" and [line["n"] for line in panel["lines"]] == ["x", "y", "z"]
    times = numbers(panel["x"][0])
    assert times[-1] == pytest.approx(recorded.time[-1], rel=2 / RESOLUTION)
    for axis, line in enumerate(panel["lines"]):
        place, found_places = recorded.position[:, 0, axis], numbers(line["y"])
        expected = np.interp(times, recorded.time, place)
        assert len(found_places) == len(times)
        assert np.abs(found_places - expected).max() <= 2 * max(np.ptp(place), 1e-12) / RESOLUTION + 0.01 * np.ptp(
            place
        )
    force = found["contacts"]["panels"][0]
    assert np.nanmax(numbers(force["lines"][0]["y"])) == pytest.approx(recorded.contact_force[..., 2].max(), rel=1e-3)


def test_page_is_small_whole_and_harmless(shown: tuple[Path, str]) -> None:
    folder, text = shown
    assert len(text.encode()) < LARGEST
    assert not (folder / "figures").exists()
    assert "http://" not in text and "https://" not in text and "src=" not in text
    assert text.count("sha256-") == 2 and "unsafe-eval" not in text
    assert text.endswith("</html>\n") and read(folder) == text
    assert "makes the full one" in text


@pytest.mark.parametrize("name", OPTIONAL)
def test_any_file_but_the_result_may_be_missing(run_dir: Path, name: str) -> None:
    (run_dir / name).unlink()
    text = read(run_dir)
    assert "All 3 checks are met" in text
    assert ("<canvas" in text) == (name != "trajectory.npz")


def test_text_from_files_is_escaped(run_dir: Path) -> None:
    evil = "</script><script>alert(1)</script>"
    with np.load(run_dir / "trajectory.npz") as archive:
        arrays = dict(archive) | {"body_names": np.array([evil]), "contact_names": np.array([evil])}
    np.savez(run_dir / "trajectory.npz", **arrays)
    text = read(run_dir)
    assert "<script>alert" not in text
    assert any(evil in panel["title"] for panel in charts(text)["contacts"]["panels"])


def test_robots_have_joints_motors_and_gait(tmp_path: Path, run_dir: Path) -> None:
    (tmp_path / "robot").mkdir()
    robot = write_walker(tmp_path / "robot", motion(0.5))
    for name in ("trajectory.npz", "scene.json"):
        shutil.copy(robot / name, run_dir / name)
    (run_dir / "guess.npz").unlink()
    found = charts(read(run_dir))
    assert {"joints", "motors", "states"} <= set(found)


@NODE
def test_the_script_draws_every_chart(shown: tuple[Path, str], batch: Path) -> None:
    """No number is lost on the way to the picture: no NaN, and as many lines as the chart has."""
    found = charts(shown[1]) | charts(read(batch / "two_balls" / "gradient-seed0"))
    assert {"variables", "controls"} <= set(found)
    code = f"{json.dumps(list(found.values()))}.map((chart) => drawChart(chart).html)"
    for svg, chart in zip(run_script(code, "numbers.js", "charts.js"), found.values(), strict=True):
        assert "NaN" not in svg and "undefined" not in svg and "Infinity" not in svg
        expected = sum(len(panel["lines"]) for panel in chart["panels"] if panel)
        assert svg.count('<g fill="none" stroke=') + svg.count('<g fill="#fff"') == expected


@NODE
def test_script_unpacks_what_was_packed() -> None:
    values = np.cumsum(np.random.default_rng(1).standard_normal(200))
    found = np.array(run_script(f"numbers({json.dumps(differences(values))})", "numbers.js", "charts.js"))
    assert np.abs(found - values).max() <= np.ptp(values) / RESOLUTION
    assert differences(np.array([1.0, np.nan])) == [1.0, None]
    assert differences(np.full(3, 7.25)) == [7.25] * 3
    assert unpack(pack("any text: \N{ROCKET}")) == "any text: \N{ROCKET}"


@NODE
@pytest.mark.parametrize(("scale", "values"), [(0.0, [-2.0, 3]), (-1.0, [1e-6, 1e3]), (1.0, [-500.0, 0.1, 5000])])
def test_ticks_lie_within_the_panel(scale: float, values: list[float]) -> None:
    panel = Panel("p", lines(np.arange(len(values)), np.array(values)[:, None], ["y"], ["red"]), "x", scale)
    data = json.dumps(Chart("c", "", (panel,)).to_json()["panels"][0])
    made = f"const p = new Panel({data}, 0, 0, 500);"
    code = f"(() => {{ {made} return [p.tall, ticksOf({scale}, ...p.tall).map(p.up)]; }})()"
    (low, high), ticks = run_script(code, "numbers.js", "charts.js")
    assert 3 <= len(ticks) <= 9
    assert all(low - 1e-9 <= tick <= high + 1e-9 for tick in ticks)


def test_the_motion_is_that_of_the_trajectory(shown: tuple[Path, str]) -> None:
    block = re.search(r'class="animation">.*?<script[^>]*class="packed">(.*?)</script>', shown[1], re.DOTALL)
    assert block is not None
    played, recorded = json.loads(unpack(block[1])), read_trajectory(shown[0] / "trajectory.npz")
    assert played["time"][-1] == pytest.approx(recorded.time[-1])
    assert played["position"][-3:] == pytest.approx(recorded.position[-1, 0].tolist(), abs=1e-3)
