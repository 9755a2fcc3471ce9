"""Pages in a browser: nothing beside its place, no complaint, one moment in all curves, light and dark."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tools.browser import BROWSER, visit

import symphys
from symphys.report import write_batch_report, write_run_report

pytestmark = BROWSER

OVERFLOW = """
const wide = document.documentElement.clientWidth;
const inside = (e) => e.closest(".scroll, pre, canvas, svg, summary");
const beyond = (e) => !inside(e) && e.getBoundingClientRect().right > wide + 1;
const over = [...document.querySelectorAll("main *")].filter(beyond);
return { page: document.documentElement.scrollWidth - wide, over: over.map((e) => e.outerHTML.slice(0, 80)),
         charts: document.querySelectorAll("figure.chart svg").length };
"""
HOVER = """
const svg = document.querySelector("figure.chart[data-name=states] svg");
const box = svg.getBoundingClientRect();
const at = { clientX: box.left + 0.12 * box.width, clientY: box.top + 60 };
svg.dispatchEvent(new window.PointerEvent("pointermove", at));
const cursors = [...document.querySelectorAll(".chart path.cursor")].filter((c) => c.getAttribute("d"));
const time = document.querySelector(".animation output").textContent;
const said = [...document.querySelectorAll(".chart output")].filter((o) => o.textContent).length;
svg.dispatchEvent(new window.PointerEvent("pointerleave"));
const left = [...document.querySelectorAll(".chart path.cursor")].filter((c) => c.getAttribute("d")).length;
return { cursors: cursors.length, time, said, left };
"""
PLAY = """
const slider = document.querySelector(".animation input");
slider.value = 500;
slider.dispatchEvent(new window.Event("input"));
const half = document.querySelectorAll(".chart path.cursor[d^=M]").length;
const canvas = document.querySelector("canvas");
canvas.dispatchEvent(new window.KeyboardEvent("keydown", { key: "ArrowRight" }));
return { half, time: document.querySelector(".animation output").textContent };
"""
PAPER = (
    OVERFLOW.replace("return {", "const seen = {").replace('svg").length };', 'svg").length };')
    + """
const shown = (e) => window.getComputedStyle(e).display !== "none";
seen.controls = [...document.querySelectorAll(".controls, nav, .theme")].filter(shown).length;
seen.paper = window.getComputedStyle(document.body).backgroundColor;
return seen;
"""
)
KEYBOARD = """
const every = [...document.querySelectorAll("a, button, input, select, summary, canvas")];
const shown = every.filter((e) => e.getClientRects().length && !e.disabled);
const reached = (e) => { e.focus(); return document.activeElement === e && e.tabIndex >= 0; };
return { count: shown.length, lost: shown.filter((e) => !reached(e)).map((e) => e.outerHTML.slice(0, 80)) };
"""
COMPARE = """
const boxes = () => [...document.querySelectorAll(".rows input[type=checkbox]")];
boxes()[0].click();
const one = document.querySelector(".pair").textContent;
boxes()[1].click();
const rows = [...document.querySelectorAll(".pair tr")].map((r) => [...r.children].map((c) => c.textContent.trim()));
return { one, rows };
"""
PEEK = """
const links = [...document.querySelectorAll("figure.chart[data-name=sweep] a")];
const over = (e) => e.dispatchEvent(new window.PointerEvent("pointerover", { bubbles: true }));
const player = document.querySelector(".animation"), says = () => player.querySelector(".shown").textContent;
player.style.marginTop = "3000px";
over(links[0].querySelector("circle"));
const first = says(), floats = player.classList.contains("peek");
links[1].focus();
const then = says();
over(document.querySelector("h1"));
return { first, floats, then, stays: player.classList.contains("peek") };
"""
STAGE = """
const player = document.querySelector(".animation").player, stage = player.stage, canvas = player.canvas;
if (!stage) return { stage: false, drawn: canvas.getContext("2d") !== null, time: player.output.textContent };
const where = () => stage.camera.position.toArray().map((x) => x.toFixed(3)).join();
const turned = { deltaY: -240, clientX: 200, clientY: 200, bubbles: true, cancelable: true };
const wheel = new window.WheelEvent("wheel", turned);
const before = where(), still = canvas.dispatchEvent(wheel) === false;
stage.controls.update();
const near = where();
player.views[2].click();
const top = where();
player.views[0].click();
const z = stage.bodies[0].group.position.toArray();
player.go(0.5 * player.last);
const moved = stage.bodies[0].group.position.toArray().some((x, k) => x !== z[k]);
const picture = stage.picture().length;
stage.camera.position.set(0, -10, -50);
stage.controls.update();
return { stage: true, still, zoomed: near !== before, top: top !== near, reset: where() !== near, moved, picture,
         low: stage.camera.position.z, level: stage.level };
"""
FILM = """
const player = document.querySelector(".animation").player, slider = player.film.querySelector("input");
const end = () => { player.go(player.last); return player.stage.bodies[0].group.position.toArray(); };
const result = end(), words = player.film.querySelector("output").textContent;
slider.value = "0";
slider.dispatchEvent(new window.Event("input"));
const guess = end(), label = player.film.querySelector("output").textContent;
const cursor = document.querySelector("figure[data-name=convergence] .cursor").getAttribute("d") || "";
slider.value = slider.max;
slider.dispatchEvent(new window.Event("input"));
return { result, guess, again: end(), words, label, cursor, max: Number(slider.max) };
"""
BRUSH = """
const svg = document.querySelector("figure.chart[data-name=states] svg"), box = svg.getBoundingClientRect();
const at = (share) => ({ clientX: box.left + share * box.width, clientY: box.top + 60 });
const draw = (a, b) => {
  svg.dispatchEvent(new window.PointerEvent("pointerdown", at(a)));
  svg.dispatchEvent(new window.PointerEvent("pointerup", at(b)));
};
const player = document.querySelector(".animation").player;
const bands = () => [...document.querySelectorAll(".chart path.band")].filter((b) => b.getAttribute("d")).length;
draw(0.2, 0.12);
const drawn = { stretch: player.stretch, time: player.time, bands: bands() };
draw(0.15, 0.15);
return { ...drawn, then: player.stretch, left: bands() };
"""
COLOURS = "return window.getComputedStyle(document.body).backgroundColor;"
THEME = """
document.getElementById("theme-dark").click();
return window.getComputedStyle(document.body).backgroundColor;
"""


@pytest.fixture(scope="module")
def pages(made: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The page of a run and that of a batch."""
    folder = Path(shutil.copytree(made, tmp_path_factory.mktemp("seen") / "batch"))
    return write_run_report(folder / "ball_throw" / "gradient-seed0"), write_batch_report(folder)


@pytest.mark.parametrize("width", [1400, 390])
@pytest.mark.parametrize("which", [0, 1], ids=["run", "batch"])
def test_nothing_lies_beside_the_page(pages: tuple[Path, Path], which: int, width: int) -> None:
    found = visit(pages[which], OVERFLOW, width)
    assert found.console == []
    assert found.seen["charts"] > 0 and found.seen["page"] <= 0 and found.seen["over"] == []


def test_the_pointer_shows_one_moment_in_all_curves_and_in_the_motion(pages: tuple[Path, Path]) -> None:
    found = visit(pages[0], HOVER)
    assert found.console == [] and found.seen["cursors"] >= 2 and found.seen["said"] >= 2
    assert found.seen["left"] == 0
    assert 0.5 < float(found.seen["time"].split()[0]) < 2.5


def test_the_motion_moves_the_curves(pages: tuple[Path, Path]) -> None:
    found = visit(pages[0], PLAY)
    assert found.console == [] and found.seen["half"] >= 2
    assert found.seen["time"].startswith("2.55 /")


def test_pages_are_light_or_dark(pages: tuple[Path, Path]) -> None:
    light, dark, chosen = visit(pages[0], COLOURS), visit(pages[0], COLOURS, dark=True), visit(pages[0], THEME)
    assert light.seen == "rgb(245, 247, 248)"
    assert dark.seen == chosen.seen == "rgb(18, 24, 30)"


@pytest.mark.parametrize("which", [0, 1], ids=["run", "batch"])
def test_on_paper_nothing_is_cut_and_nothing_is_to_be_clicked(pages: tuple[Path, Path], which: int) -> None:
    found = visit(pages[which], PAPER, 720, printed=True)
    assert found.seen["charts"] > 0 and found.seen["page"] <= 0 and found.seen["over"] == []
    assert found.seen["controls"] == 0 and found.seen["paper"] == "rgb(255, 255, 255)"


@pytest.mark.parametrize("which", [0, 1], ids=["run", "batch"])
def test_the_keyboard_reaches_everything(pages: tuple[Path, Path], which: int) -> None:
    found = visit(pages[which], KEYBOARD)
    assert found.seen["count"] > 10 and found.seen["lost"] == []


def test_two_runs_are_compared(pages: tuple[Path, Path]) -> None:
    found = visit(pages[1], COMPARE)
    assert found.console == [] and "Tick a second one" in found.seen["one"]
    heads, *rows = found.seen["rows"]
    assert heads[-1] == "difference" and len(heads) == 4
    rows = {row[0]: row[1:] for row in rows}
    assert "objective" in rows
    assert all(any(name.startswith(start) for name in rows) for start in ("throw.x", "error of ")), list(rows)


def test_the_pointer_on_a_point_of_a_sweep_shows_its_motion(
    run_dir: Path, tmp_path: Path, edit: Callable[..., None]
) -> None:
    root = tmp_path / "out"
    for k in range(3):
        folder = Path(shutil.copytree(run_dir, root / f"ball_throw@ball.mass={k + 1}" / "gradient-seed0"))
        edit(folder / "config.json", settings={"ball.mass": k + 1})
        write_run_report(folder)
    found = visit(write_batch_report(root), PEEK)
    assert found.console == []
    assert found.seen == {
        "first": "ball.mass=1, gradient, seed 0",
        "floats": True,
        "then": "ball.mass=2, gradient, seed 0",
        "stays": False,
    }


def test_the_motion_is_in_three_dimensions(pages: tuple[Path, Path]) -> None:
    """Wheel, views, time and picture; the camera never goes below the floor. The view comes back by its button."""
    found = visit(pages[0], STAGE)
    assert found.console == [], found.console
    assert found.seen["stage"] and found.seen["still"] and found.seen["zoomed"] and found.seen["top"]
    assert found.seen["reset"] and found.seen["moved"] and found.seen["picture"] > 2000
    assert found.seen["low"] > found.seen["level"]


def test_without_webgl_there_is_the_flat_picture(pages: tuple[Path, Path]) -> None:
    found = visit(pages[0], STAGE, flat=True)
    assert found.seen["stage"] is False and found.seen["drawn"] and found.seen["time"].endswith(" s")


def test_the_solve_is_a_film(tmp_path: Path) -> None:
    """From the guess to the solution, with the place on the way in the convergence."""
    symphys.solve("ball_throw", "least_squares", folder=tmp_path)
    found = visit(write_run_report(tmp_path / "ball_throw" / "least_squares-seed0"), FILM)
    assert found.console == [], found.console
    seen = found.seen
    assert seen["max"] >= 3 and seen["label"].startswith("iteration 0") and seen["words"].startswith("the result")
    assert seen["result"][0] == pytest.approx(10.0, abs=0.02) and abs(seen["guess"][0] - 10) > 1
    assert seen["again"] == seen["result"] and seen["cursor"].startswith("M")


def test_a_stretch_of_time_is_drawn_out(pages: tuple[Path, Path]) -> None:
    """It is played over and over, from its start; a click ends it."""
    found = visit(pages[0], BRUSH)
    assert found.console == [], found.console
    first, last = found.seen["stretch"]
    assert 0 < first < last < 5 and found.seen["time"] == pytest.approx(first) and found.seen["bands"] >= 2
    assert found.seen["then"] is None and found.seen["left"] == 0


def test_solvers_stand_side_by_side(made: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(made, tmp_path / "batch"))
    for path in (folder / "two_balls", *folder.glob("ball_throw/ipopt-*"), *folder.glob("ball_throw/nelder_mead-*")):
        shutil.rmtree(path)
    solvers = {(path.parent.name, path.name.partition("-seed")[0]) for path in folder.glob("*/*-seed*")}
    text = write_batch_report(folder).read_text("utf-8")
    assert len(solvers) > 2 and text.count("<canvas") == len(solvers)
    assert "One moment is shown in all of them" in text
