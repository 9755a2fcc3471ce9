"""Pages in a browser: nothing beside its place, no complaint, one moment in all curves, light and dark."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tools.browser import BROWSER, visit

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
