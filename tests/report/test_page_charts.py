"""A page has its curves as numbers, which its script draws, and needs nothing else."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.walker import motion, write_walker
from tools.page_scripts import NODE, charts, held, run_script, unpack

from symphys.report import write_light_report, write_run_report
from symphys.report.charts.chart import MARKS, RESOLUTION, Chart, Panel, differences, lines
from symphys.report.pages.markup import SCRIPTS, pack, packed_viewer, read_static, squeezed
from symphys.results.trajectories import read_trajectory

LARGEST = 60_000


def read(run_dir: Path) -> str:
    return write_run_report(run_dir).read_text(encoding="utf-8")


def numbers(packed: Any) -> np.ndarray:
    """As the page's script unpacks them."""
    if isinstance(packed, dict):
        return np.cumsum(packed["d"]) * packed["q"]
    return np.array([np.nan if value is None else value for value in packed], float)


@pytest.fixture(scope="module")
def shown(made: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("charts") / "run"
    shutil.copytree(made / "ball_throw" / "gradient-seed0", folder)
    return folder, read(folder)


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
    beside = len(packed_viewer()) + len(pack(squeezed(read_static(*SCRIPTS))))  # of a batch, whose pages share it
    assert len(text.encode()) - beside < LARGEST
    assert not (folder / "figures").exists()
    assert "http://" not in text and "https://" not in text and "src=" not in text
    assert text.count("sha256-") == 3 and "unsafe-eval" not in text
    assert text.endswith("</html>\n") and read(folder) == text
    assert "symphys report --figures" in text


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
        assert "[object" not in svg
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
    (played,) = held(shown[1], 'class="animation">')
    recorded = read_trajectory(shown[0] / "trajectory.npz")
    assert played["time"][-1] == pytest.approx(recorded.time[-1])
    assert played["position"][-3:] == pytest.approx(recorded.position[-1, 0].tolist(), abs=1e-3)


def test_the_old_name_of_the_page_still_works(run_dir: Path) -> None:
    page = write_run_report(run_dir)
    content = page.read_bytes()
    with pytest.warns(DeprecationWarning, match="write_run_report"):
        assert write_light_report(run_dir) == page
    assert page.read_bytes() == content


CURVES = {
    "steps": ([0.0, 1, 2], [5.0, 3, 1], "steps", "M0 0L1 0L1 1L2 1L2 2"),
    "a gap": ([0.0, 1, 2, 3, 4], [5.0, 3, None, 3, 1], "", "M0 0L1 1M3 1L4 2"),
}


@NODE
@pytest.mark.parametrize("name", CURVES)
def test_steps_hold_and_gaps_are_left_open(name: str) -> None:
    """In units of the samples: to the right by time, down by values of 5, 3 and 1."""
    x, y, look, expected = CURVES[name]
    panel = {"title": "p", "x": [x], "lines": [{"x": 0, "y": y, "c": "red", "w": 1, "l": look, "n": "y"}]}
    scale = "joined(run.map(([x, y]) => [(x - p.left) * 4 / p.width * LAST, (p.y(5) - y) / (p.y(5) - p.y(3))]))"
    code = f"""(() => {{
      const p = new Panel({json.dumps(panel)}, 0, 0, 500), LAST = {x[-1]} / 4;
      return p.runs(p.lines[0]).map((run) => {scale}).join("");
    }})()"""
    assert run_script(code, "numbers.js", "charts.js").replace(".0", "") == expected


@NODE
def test_a_logarithmic_abscissa_has_its_decades_evenly_apart() -> None:
    panel = Panel("p", lines(np.array([1.0, 10, 1000]), np.ones((3, 1)), ["y"], ["red"]), "x", across=-1.0)
    data = json.dumps(panel.to_json())
    code = f"(() => {{ const p = new Panel({data}, 0, 0, 500); return [1, 10, 100, 1000].map((v) => p.x(v)); }})()"
    places = np.diff(run_script(code, "numbers.js", "charts.js"))
    assert np.allclose(places, places[0]) and places[0] > 50


@NODE
def test_hovering_reads_the_step_that_holds() -> None:
    values = np.array([[9.0], [4], [2]])
    panel = Panel("p", lines(np.array([1.0, 10, 1000]), values, ["gd"], ["red"], look="steps"), "x")
    code = f"(() => {{ const p = new Panel({json.dumps(panel.to_json())}, 0, 0, 500); return p.at(p.x(900)); }})()"
    assert run_script(code, "numbers.js", "charts.js").endswith("gd 4")


def test_a_cloud_of_points_is_thinned_evenly() -> None:
    """Thinning by extremes would make an even cloud of residuals one of outliers."""
    values = np.random.default_rng(0).standard_normal(20_000)
    (line,) = lines(np.arange(20_000.0), values[:, None], ["y"], ["red"], look="points")
    (shown,) = Panel("p", (line,), "x").to_json()["lines"]
    assert len(numbers(shown["y"])) == MARKS
    assert np.std(numbers(shown["y"])) == pytest.approx(1.0, rel=0.1)


@NODE
def test_a_narrow_page_has_its_panels_below_each_other(shown: tuple[Path, str]) -> None:
    chart = json.dumps(charts(shown[1])["states"])
    wide, narrow = run_script(
        f"[WIDTH, NARROW].map((w) => drawChart({chart}, w).panels.map((p) => [p.left, p.top]))",
        "numbers.js",
        "charts.js",
    )
    assert len({top for _, top in wide}) == 1 and len({left for left, _ in narrow}) == 1


@NODE
@pytest.mark.parametrize(("edge", "drawn"), [(1.5, 1), (1e3, 0), (-1e3, 0)])
def test_edges_beyond_the_panel_are_not_drawn(edge: float, drawn: int) -> None:
    """Such as the largest torque of a motor that gives a thousandth of it."""
    panel = Panel("p", lines(np.arange(2.0), np.array([[0.0], [1]]), ["y"], ["red"]), "x", edges=(edge,))
    code = f"new Panel({json.dumps(panel.to_json())}, 0, 0, 500).svg().split('class=\"edge\"').length - 1"
    assert run_script(code, "numbers.js", "charts.js") == drawn
