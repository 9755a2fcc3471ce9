"""The geometry of the page's scripts is that of the figures; run by node."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from data.yard import area, prism
from tools.page_scripts import NODE, run_script
from tools.repeats import few

from symphys.report.scene.animation import solid_data
from symphys.report.scene.views import outline
from symphys.results.scene import Solid

pytestmark = NODE

EYE = "camera(-2, 0.4)"
SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))


@few("radius", [0.0, 0.3], 1)
def test_script_and_figures_have_the_same_outline(radius: float) -> None:
    axes = np.random.default_rng(1).standard_normal((3, 2))
    for points in (SIGNS @ axes, prism(24) @ axes, prism(24)[:, :2], prism(24)[:, 1:], SIGNS[:1, :2], SIGNS[:2, 1:]):
        found = np.array(run_script(f"outline({points.tolist()}, {radius})"))
        assert area(found) == pytest.approx(area(outline(points, radius)), abs=1e-9)


def placed(solid: Solid, name: str, fixed: bool = False) -> str:
    return (
        f"place({json.dumps(solid_data(solid))}, {{ p: [0, 0, 0], q: [1, 0, 0, 0] }}, '{name}', {str(fixed).lower()})"
    )


RAMP = Solid(0.0, SIGNS * [2, 1, 0.1])


@pytest.mark.slow
def test_what_lies_on_a_large_block_is_drawn_after_it() -> None:
    """Also at its far end, where its centre is farther away than that of the block."""
    for x, y in ((-1.8, 0.9), (1.8, 0.9), (1.8, -0.9), (-1.8, -0.9)):
        for solid in (Solid(0.1, centre=np.array([x, y, 0.2])), Solid(0.0, 0.1 * SIGNS, np.array([x, y, 0.2]))):
            both = f"[{placed(solid, 'top')}, {placed(RAMP, 'ramp')}]"
            assert run_script(f"inOrder({both}, {EYE}).map((s) => s.colour)") == ["ramp", "top"]
            under = replace(solid, centre=solid.centre * [1, 1, -1])
            both = f"[{placed(under, 'below')}, {placed(RAMP, 'ramp')}]"
            assert run_script(f"inOrder({both}, {EYE}).map((s) => s.colour)") == ["below", "ramp"]


def test_what_is_beside_each_other_does_not_overlap() -> None:
    ramp, ball = placed(RAMP, "ramp"), placed(Solid(0.1, centre=np.array([0.0, 0, 3.0])), "ball")
    assert run_script(f"overlap({ramp}, {ball}, {EYE})") is False
    near = placed(Solid(0.1, centre=np.array([0.0, 0, 0.2])), "ball")
    assert run_script(f"overlap({ramp}, {near}, {EYE})") is True


@pytest.mark.slow
def test_terrain_between_its_heights() -> None:
    hills = "{ x: [0, 1, 2], y: [0, 2], z: [0, 1, 1, 0, 1, null] }"
    assert run_script(f"heightAt({hills}, 0.25, 1)") == pytest.approx(0.25)
    assert run_script(f"heightAt({hills}, 1.5, 1)") is None
    assert run_script(f"heightAt({hills}, -1, 1)") is None
    assert run_script(f"mesh({hills}, []).length") == 1
    assert run_script(f"mesh({hills}, [{{ normal: [0, 0, 1], offset: 2 }}]).length") == 0
    assert len(run_script(f"rim({hills})")) == 5
